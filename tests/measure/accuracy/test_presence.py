"""Frames that hold something, or nothing: the scoring ``presence``."""

import numpy as np
import pytest
from sklearn.metrics import average_precision_score, balanced_accuracy_score, roc_auc_score

from tests.measure.accuracy.scenes import capture_of, post
from uwbbench.api import Detections, Obstacle, ScoringError
from uwbbench.measure.accuracy.metrics.presence import AveragePrecision, BalancedAccuracy, RocAuc
from uwbbench.measure.accuracy.ranked import ranked
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.scoring import score

FRAMES = 40


def half_empty(material="wood", frames=FRAMES):
    """A post at 3 m that is out of reach in the second half of the frames."""
    near, far = np.array(post(3).outline_m), np.array(post(30).outline_m)
    outline = np.stack([near if frame < frames // 2 else far for frame in range(frames)])
    return capture_of(Obstacle("box", material, outline), frames=frames)


def answer(probability, threshold=0.5, **columns):
    """A row a frame; those below the threshold are candidates only."""
    probability = np.asarray(probability, float)
    frame = np.arange(len(probability))
    every = Detections(frame, range_m=np.full(len(frame), np.nan), probability=probability, **columns)
    return every.take(probability > threshold).annotated(processed=frame, candidates=every)


def present():
    return np.arange(FRAMES) < FRAMES // 2


def test_a_frame_is_true_false_missed_or_rightly_empty():
    said = present().copy()
    said[:5] = False  # missed
    said[-3:] = True  # false
    block = score(answer(said), half_empty(), "presence").filtering
    assert (block.tp, block.fp, block.fn, block.true_empty, block.retained) == (15, 3, 5, 17, 18)
    assert block.balanced_accuracy == pytest.approx(balanced_accuracy_score(present(), said))


def test_ranks_are_those_of_scikit_learn_ties_included():
    rng = np.random.default_rng(5)
    probability = np.round(0.3 * present() + 0.7 * rng.uniform(size=FRAMES), 1)  # ten values, many of them tied
    block = score(answer(probability), half_empty(), "presence").filtering
    assert block.roc_auc == pytest.approx(roc_auc_score(present(), probability), abs=1e-15)
    assert block.average_precision == pytest.approx(average_precision_score(present(), probability), abs=1e-15)


@pytest.mark.parametrize("seed", range(20))
def test_random_ranks_with_ties_are_those_of_scikit_learn(seed):
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 200))
    probability = rng.integers(0, rng.integers(1, 30) + 1, size) / 30
    there = rng.uniform(size=size) < rng.uniform(0.1, 0.9)
    there[:2] = True, False
    partial = np.stack([probability, there], axis=1)
    assert RocAuc.value(partial) == pytest.approx(roc_auc_score(there, probability), abs=1e-14)
    assert AveragePrecision.value(partial) == pytest.approx(average_precision_score(there, probability), abs=1e-14)


def test_a_capture_of_one_kind_alone_has_no_rank_and_no_balance():
    partial = np.array([[0.4, 1.0], [0.6, 1.0]])
    assert np.isnan(RocAuc.value(partial))
    assert np.isnan(BalancedAccuracy.value(np.array([1.0, 2.0, 0.0, 0.0])))


def test_the_curve_of_frames_ends_in_the_same_average_precision():
    rng = np.random.default_rng(6)
    probability = np.round(0.5 * present() + 0.5 * rng.uniform(size=FRAMES), 1)
    found, capture = answer(probability), half_empty()
    curve = ranked(found, Scene.of(found, capture), ScoringRules("object"))
    assert curve.order == "probability"
    assert curve.average_precision == pytest.approx(average_precision_score(present(), probability), abs=1e-3)
    assert (curve.set_tp, curve.there) == (np.sum(present() & (probability > 0.5)), FRAMES // 2)


def test_without_candidates_the_rows_that_are_left_are_ranked():
    found = answer(np.where(present(), 0.9, 0.2))
    alone = found.annotated(candidates=None)
    bare = Detections(alone.frame, processed=np.arange(FRAMES), range_m=alone.range_m, probability=alone["probability"])
    assert score(bare, half_empty(), "presence").roc_auc == 1.0


def test_detections_with_ranges_say_presence_where_they_lie_in_the_region():
    found = Detections(np.arange(FRAMES), range_m=np.where(present(), 3.0, 0.1))
    block = score(found, half_empty(), "presence").filtering
    assert block.balanced_accuracy == 1.0
    assert np.isnan(block.roc_auc)


def test_classes_are_those_of_the_nearest_obstacle():
    sure = {"class_probability_empty": ~present(), "class_probability_metal": present()}
    sure["class_probability_person"] = np.zeros(FRAMES)
    columns = {name: values.astype(float) for name, values in sure.items()}
    columns["class_probability_person"][:4] = 2.0  # four frames of metal are taken for a person
    block = score(answer(present(), **columns), half_empty("metal"), "presence").filtering
    assert block.class_accuracy == pytest.approx(36 / 40)
    assert (block.confusion_metal_as_person, block.confusion_metal_as_metal, block.confusion_empty_as_empty) == (
        4,
        16,
        20,
    )


@pytest.mark.parametrize("scoring", ["frame", "object", "track", "segment"])
def test_other_scorings_refuse_rows_without_a_range(scoring):
    with pytest.raises(ScoringError, match="score them by 'presence'"):
        score(answer(np.full(FRAMES, 0.9)), half_empty(), scoring)


def test_rows_without_a_column_of_ranges_are_judged_by_presence_alone():
    found = Detections(np.arange(FRAMES), probability=np.full(FRAMES, 0.9))
    assert score(found, half_empty(), "presence").recall == 1.0
    with pytest.raises(ScoringError, match="range"):
        score(found, half_empty(), "object")
