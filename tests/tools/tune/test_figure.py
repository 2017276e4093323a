"""The picture of F1 over a grid of thresholds."""

import numpy as np
import pytest
import yaml

from uwbbench.api import ConfigError
from uwbbench.tools.tune import read_tuning, tune
from uwbbench.tools.tune.figure import draw_stable_zone

GRID = {
    "pipeline.filter.prominence.params.minimum": [0.01, 0.1, 0.4],
    "pipeline.filter.width.params.minimum": [0.5, 1.5, 2.5, 3.5],
    "pipeline.filter.snr.params.minimum_db": [15],
}


@pytest.fixture
def outcome(tmp_path):
    def made(**changes):
        use = {"use": "approach", "params": {"frame_rate_hz": 8, "seed": 1, "sts": False}}
        other = {"use": "approach", "params": {"frame_rate_hz": 8, "seed": 2, "sts": False}}
        data = {"schema": 1, "detector": "paper-filtering", "grid": GRID, "tuning": [use], "held_out": [other]}
        data |= {"groups": ["overall"], "intervals": {"resamples": 100}, **changes}
        path = tmp_path / "own.yaml"
        given = {key: value for key, value in data.items() if value is not None}
        path.write_text(yaml.safe_dump(given, sort_keys=False))
        return tune(read_tuning(path))

    return made


def panels(figure):
    return [axes for axes in figure.axes if axes.get_visible() and axes.get_label() != "<colorbar>"]


def test_each_pair_of_thresholds_has_a_panel_through_the_chosen_set(outcome):
    found = outcome()
    (tuned,) = found.groups
    drawn = panels(draw_stable_zone(found))
    assert [axes.get_images()[0].get_array().shape for axes in drawn] == [(3, 4), (3, 1), (4, 1)]
    f1 = tuned.scores.f1.reshape(3, 4, 1)
    place = np.unravel_index(tuned.best, f1.shape)
    assert np.array_equal(drawn[0].get_images()[0].get_array(), f1[:, :, place[2]])
    assert (drawn[0].get_xlabel(), drawn[0].get_ylabel()) == ("filter.width.minimum", "filter.prominence.minimum")
    (circle,) = drawn[0].get_lines()
    assert (circle.get_xdata()[0], circle.get_ydata()[0]) == (place[1], place[0])


def test_one_threshold_is_a_curve(outcome):
    path = "pipeline.filter.width.params.minimum"
    found = outcome(grid={path: GRID[path]})
    (axes,) = panels(draw_stable_zone(found))
    assert axes.get_lines()[0].get_ydata().tolist() == found.groups[0].scores.f1.tolist()


def test_the_picture_says_that_captures_are_simulated_and_how_large_the_zone_is(outcome):
    found = outcome(grid={"pipeline.filter.width.params.minimum": [0.5, 1.5]})
    drawn = draw_stable_zone(found)
    assert "SIMULATED" in drawn.get_supxlabel()
    assert f"{found.groups[0].zone.share:.1%}" in panels(drawn)[0].get_title(loc="left")


def test_a_search_has_no_zone_to_draw(outcome):
    pytest.importorskip("optuna")
    space = {"pipeline.filter.width.params.minimum": {"low": 0.0, "high": 1.0}}
    with pytest.raises(ConfigError, match="a search has none"):
        draw_stable_zone(outcome(grid=None, search={"space": space, "trials": 1}))
