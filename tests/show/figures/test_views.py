"""The two pictures from above: the map, and the chain of filters."""

import dataclasses

import numpy as np
import pytest

from uwbbench.api import ConfigError, StoreError
from uwbbench.detect.pipeline import load_detector
from uwbbench.show.figures.chain import draw_pipeline, panels
from uwbbench.show.figures.environment import draw_map
from uwbbench.show.figures.source import from_capture, from_run, one_of


def xy(found, rows=slice(None)):
    points = np.stack([found["x_m"], found["y_m"]], axis=1)[rows]
    return points[np.lexsort(points.T)]


def test_the_map_shows_every_point_of_every_cluster(paper, look):
    seen = look(draw_map(paper))
    found = paper.detections
    for number, name in enumerate(np.unique(found["cluster"][found["cluster"] >= 0])):
        (points,) = seen.lines("os^DvPX"[number])
        np.testing.assert_allclose(points[np.lexsort(points.T)], xy(found, found["cluster"] == name))
    assert (seen.axes[0].get_xlabel(), seen.axes[0].get_ylabel()) == ("x (m)", "y (m)")
    assert seen.axes[0].get_aspect() == 1.0


@pytest.mark.parametrize("draw", [draw_map, draw_pipeline])
def test_outline_and_path_are_those_of_the_capture(paper, draw, look):
    seen = look(draw(paper))
    outline = paper.header.truth.objects[0].outline_m
    np.testing.assert_allclose(seen.axes[0].patches[0].get_xy()[:-1], outline[:, :2])
    path = next(line for line in seen.axes[0].lines if line.get_linestyle() == "--")
    np.testing.assert_allclose(path.get_xydata(), paper.header.trajectory.position_m[:, :2])
    assert {"robot path", "start", "true outline"} <= set(seen.legend())
    assert "SIMULATED" in seen.caption


def test_the_paper_chain_has_five_panels_with_the_counts_of_its_steps(paper, look):
    chain = paper.detections.chain
    counts = [int(panel.rows.sum()) for panel in panels(paper)]
    clustered = int((paper.detections["cluster"] >= 0).sum())
    expected = [chain[step] for step in ("peaks", "filter.width", "filter.snr", "select.strongest")]
    assert counts == [*expected, clustered]
    seen = look(draw_pipeline(paper))
    titles = [axes.get_title() for axes in seen.axes if axes.get_title()]
    assert titles[1] == f"(b) first_path, prominence, width: {chain['filter.width']}"
    assert len(titles) == 5


def test_the_panels_hold_the_peaks_coloured_by_their_score(paper, look):
    seen = look(draw_pipeline(paper))
    for axes, panel in zip(seen.axes, panels(paper), strict=False):
        points = axes.collections[0].get_offsets()
        np.testing.assert_allclose(points[np.lexsort(points.T)], xy(paper.candidates, panel.rows))
        shown = np.sort(axes.collections[0].get_array())
        np.testing.assert_allclose(shown, np.sort(paper.candidates["score_db"][panel.rows]))


def test_a_run_gives_the_picture_of_its_capture(folder, look):
    (found,) = from_run(folder, "paper", "approach-ch9-metal-1")
    assert look(draw_pipeline(found)).caption.startswith("SIMULATED capture approach-ch9-metal-1")


@pytest.mark.parametrize("draw", [draw_map, draw_pipeline])
def test_detections_without_positions_are_refused_with_the_reason(approach_without_sts, draw):
    found = from_capture(approach_without_sts, load_detector("paper"))
    with pytest.raises(ConfigError, match=r"'paper' gives no positions .* no STS responses"):
        draw(found)


def test_a_capture_that_two_datasets_hold_is_told_apart_by_dataset(folder):
    ours = from_run(folder, "paper", "approach-ch9-metal-1")
    twins = [ours[0], dataclasses.replace(ours[0], dataset="other")]
    with pytest.raises(ConfigError, match="run: choose one with --dataset: metal, other"):
        one_of(twins, "run")
    assert one_of(from_run(folder, "paper", dataset="plywood"), "run").header.name == "approach-ch9-plywood-1"
    with pytest.raises(ConfigError, match="not together"):
        from_run(folder, "paper", "approach-ch9-metal-1", "plywood")


def test_a_run_that_did_not_keep_the_peaks_is_told_how_to(folder):
    (found,) = from_run(folder, "paper", "approach-ch9-metal-1")
    found.detections._candidates = None
    with pytest.raises(StoreError, match="add 'peak' to the experiment's scoring"):
        draw_pipeline(found)
