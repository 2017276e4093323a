"""Pictures of what mappers made of a run."""

import numpy as np
import pytest

from uwbbench.api import ConfigError
from uwbbench.show.figures.drive import draw_drive_map, draw_trajectories
from uwbbench.show.figures.source import from_run

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def results(mapped_run):
    return {result.detector: result for result in from_run(mapped_run)}


def test_a_map_shows_the_estimate_over_the_truth_and_says_what_it_is(results, look):
    shown = look(draw_drive_map(results["reckoning"]))
    assert {"robot path", "estimated path", "points"} <= shown.legend().keys()
    assert shown.caption.startswith("SIMULATED run usual, channel 9, receivers front, side. Detector reckoning.")
    assert shown.caption.endswith("The start of the estimate lies on the true one.")


def test_a_trajectory_alone_has_its_band_and_several_have_none(results, look):
    alone = look(draw_trajectories([results["reckoning"]]))
    assert "95 %, as stated" in alone.legend()
    several = look(draw_trajectories(list(results.values())))
    assert set(results) <= several.legend().keys()
    assert "95 %, as stated" not in several.legend()


def test_a_trajectory_in_a_frame_of_its_own_has_the_errors_of_the_one_that_it_is(results, look):
    errors = [look(draw_trajectories([results[name]])).axes[1].lines[0].get_ydata() for name in ("reckoning", "other")]
    np.testing.assert_allclose(*errors, atol=1e-6)
    assert errors[0].max() > 0.1


def test_a_detector_without_a_mapper_has_no_trajectory(paper):
    with pytest.raises(ConfigError, match="'paper' has no mapper"):
        draw_trajectories([paper])
