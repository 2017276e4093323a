"""Scores of all sets at once against scoring each set's detections."""

import dataclasses

import numpy as np
import pytest

from uwbbench.api import Obstacle, ScoringError, Truth
from uwbbench.detect.pipeline import load_detector
from uwbbench.measure.accuracy.scoring import Region, ScoringRules, outcomes, score
from uwbbench.tools.tune.sweep.scores import SetScores, set_scores
from uwbbench.tools.tune.sweep.sweep import Sweep

GRID = {
    "pipeline.filter.prominence.params.minimum": [0.0, 0.03, 0.2],
    "pipeline.filter.width.params.minimum": [2.5, 0.2],
    "pipeline.filter.snr.params.minimum_db": [5, 30, 99],
}


@pytest.fixture(scope="module")
def capture(short):
    return short(start_m=3.0, stop_m=0.2)


@pytest.fixture(scope="module")
def sweep():
    return Sweep(load_detector("paper-filtering"), GRID)


def assert_equal_to_scoring_each(sweep, capture, rules):
    found = set_scores(sweep.run(capture), capture, rules)
    for index in range(len(sweep)):
        detections = sweep.detector(index).run(capture)
        expected = score(detections, capture, rules.scoring, rules.gate_m, rules.region, rules.strongest)
        assert (found.tp[index], found.fp[index], found.fn[index]) == (expected.tp, expected.fp, expected.fn)
        error_m = outcomes(detections, capture, rules)["filtering"].error_m
        error_m = error_m[np.isfinite(error_m)]
        assert found.errors[index] == len(error_m)
        for name, value in (("precision", expected.precision), ("recall", expected.recall), ("f1", expected.f1)):
            assert getattr(found, name)[index] == pytest.approx(value, abs=0, rel=1e-15, nan_ok=True)
        rmse_m = np.sqrt(np.mean(error_m**2)) if len(error_m) else np.nan
        assert found.mae_m[index] == pytest.approx(expected.mae_m, rel=1e-12, nan_ok=True)
        assert found.rmse_m[index] == pytest.approx(rmse_m, rel=1e-12, nan_ok=True)


@pytest.mark.parametrize("scoring", ["frame", "peak", "object"])
@pytest.mark.parametrize("region", [Region(), Region(0.0), Region(1.0, 2.0)])
def test_every_set_has_the_scores_of_its_detections(sweep, capture, scoring, region):
    assert_equal_to_scoring_each(sweep, capture, ScoringRules(scoring, region=region))


@pytest.mark.parametrize("scoring", ["frame", "peak", "object"])
def test_several_objects_walls_and_unlabelled_frames_are_scored_alike(sweep, capture, scoring):
    plate = capture.truth.objects[0].outline_m
    moving = np.broadcast_to(plate + np.array([0.5, 0.3]), (len(capture), *plate.shape)).copy()
    moving[:10] = np.nan
    things = (*capture.truth.objects, Obstacle("other", "metal", moving), Obstacle("wall", "brick", plate + 1.0, True))
    crowded = dataclasses.replace(capture, truth=Truth(things))
    assert_equal_to_scoring_each(sweep, crowded, ScoringRules(scoring, gate_m=0.3))


def test_scores_of_several_captures_add_up(short, sweep, capture):
    other = short(5, material="metal")
    parts = [set_scores(sweep.run(one), one, ScoringRules()) for one in (capture, other)]
    merged = SetScores.merged(parts)
    assert np.array_equal(merged.tp, parts[0].tp + parts[1].tp)
    counts = [merged.tp, merged.fp, merged.fn]
    assert merged.f1 == pytest.approx(2 * counts[0] / (2 * counts[0] + counts[1] + counts[2]))
    squared = sum(part.rmse_m[0] ** 2 * part.errors[0] for part in parts)
    assert merged.rmse_m[0] == pytest.approx(np.sqrt(squared / merged.errors[0]))


def test_several_detections_a_frame_are_not_scored_together(capture):
    detector = load_detector("paper-filtering", changes={"pipeline.select.strongest.params": {"count": 2}})
    with pytest.raises(ScoringError, match="one detection a frame"):
        set_scores(Sweep(detector, GRID).run(capture), capture, ScoringRules())


def test_truth_that_is_not_exhaustive_gives_no_f1(sweep, capture):
    partial = dataclasses.replace(capture, truth=Truth(capture.truth.objects, exhaustive=False))
    with pytest.raises(ScoringError, match="not exhaustive"):
        set_scores(sweep.run(partial), partial, ScoringRules())


def test_a_detector_without_ranges_cannot_be_scored(capture):
    sweep = Sweep(load_detector("paper-filtering"), GRID, leave_out=["range"])
    with pytest.raises(ScoringError, match="add the stage 'range'"):
        set_scores(sweep.run(capture), capture, ScoringRules())
