"""Counts at every threshold of a score."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import average_precision_score

from tests.detect.test_shipped_detectors import plate
from tests.measure.accuracy.test_scoring import capture_of, found_in, post
from uwbbench import load_detector
from uwbbench.api import Detections
from uwbbench.measure.accuracy.judge import judge
from uwbbench.measure.accuracy.ranked import order_of, pooled, ranked, without_each
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene

FRAMES = 4
RULES = ScoringRules("object")


def ranked_of(rows, *objects, found=(), exhaustive=True):
    """Counts of candidates given as (frame, range_m, score)."""
    capture = capture_of(*objects, frames=FRAMES, exhaustive=exhaustive)
    frame, range_m, score = np.array(rows, float).reshape(-1, 3).T
    candidates = Detections(frame, range_m=range_m, score_db=score)
    detections = found_in(FRAMES, *found).annotated(candidates=candidates)
    return ranked(detections, Scene.of(detections, capture), RULES), candidates, capture


def at(candidates, capture, threshold):
    """Counts of true and false ones among the candidates that reach a threshold."""
    chosen = candidates.take(candidates["score_db"] >= threshold).annotated(processed=np.arange(FRAMES))
    outcome = judge(chosen, Scene.of(chosen, capture), RULES, "filtering").outcome
    return int(outcome.tp.sum()), int(outcome.fp.sum())


@pytest.mark.slow
@settings(deadline=None, max_examples=80)
@given(
    rows=st.lists(
        st.tuples(st.integers(0, FRAMES - 1), st.floats(0.7, 5.0), st.integers(-8, 8).map(float)), max_size=30
    ),
    posts=st.lists(st.tuples(st.floats(0.7, 4.0), st.booleans()), min_size=1, max_size=5),
)
def test_every_threshold_counts_as_judging_what_reaches_it(rows, posts):
    objects = [post(x, 0.1 * place, structure=wall) for place, (x, wall) in enumerate(posts)]
    counts, candidates, capture = ranked_of(rows, *objects)
    cumulative = list(zip(np.cumsum(counts.tp).tolist(), np.cumsum(counts.fp).tolist(), strict=True))
    assert cumulative == [at(candidates, capture, threshold) for threshold in counts.score]


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.booleans(), st.integers(-5, 5)), min_size=1, max_size=FRAMES * 8))
def test_average_precision_is_that_of_scikit_learn_where_every_candidate_has_its_own_object(labels):
    """Each frame has eight posts a metre apart and at most one candidate for each, at it or between two."""
    objects = [post(1.0 + place) for place in range(8)]
    rows = [
        (number // 8, 1.0 + number % 8 + (0.0 if true else 0.5), score) for number, (true, score) in enumerate(labels)
    ]
    counts, _, _ = ranked_of(rows, *objects)
    there, found = FRAMES * len(objects), sum(true for true, _ in labels)
    truth, score = [true for true, _ in labels], [score for _, score in labels]
    expected = average_precision_score(truth, score) * found / there if found else 0.0
    assert counts.there == there
    assert counts.average_precision == pytest.approx(expected, abs=1e-12)


def test_equal_scores_are_one_step():
    counts, _, _ = ranked_of([(0, 2.0, 5.0), (1, 4.0, 5.0), (2, 2.0, 1.0)], post(2))
    assert counts.score.tolist() == [5.0, 1.0]
    assert (counts.tp.tolist(), counts.fp.tolist()) == ([1, 1], [1, 0])
    assert counts.precision.tolist() == [0.5, pytest.approx(2 / 3)]


def test_candidates_without_a_score_come_last():
    counts, _, _ = ranked_of([(0, 2.0, np.nan), (1, 2.0, -3.0)], post(2))
    assert counts.score.tolist() == [-3.0, -np.inf]
    assert counts.recall.tolist() == [1 / FRAMES, 2 / FRAMES]


def test_pooled_counts_are_those_of_all_captures_at_every_threshold():
    parts = [ranked_of(rows, post(2))[0] for rows in ([(0, 2.0, 5.0), (1, 3.0, 4.0)], [(0, 2.0, 4.0), (1, 3.0, 9.0)])]
    both = pooled(parts)
    assert both.score.tolist() == [9.0, 5.0, 4.0]
    assert (both.tp.tolist(), both.fp.tolist()) == ([0, 1, 1], [1, 0, 1])
    assert both.there == 2 * FRAMES
    assert both.duration_s == sum(part.duration_s for part in parts)


@pytest.mark.parametrize("exhaustive", [[True, True, True], [True, False, True], [False, True, True]])
def test_the_average_precision_without_each_capture_is_that_of_the_others_pooled(exhaustive):
    rows = [[(0, 2.0, 5.0), (1, 3.0, 4.0)], [(0, 2.0, 4.0), (1, 3.0, 9.0)], [(0, 3.0, 4.5), (1, 2.0, np.nan)]]
    parts = [ranked_of(part, post(2), exhaustive=known)[0] for part, known in zip(rows, exhaustive, strict=True)]
    others = [pooled([one for one in parts if one is not part]).average_precision for part in parts]
    assert without_each(parts) == pytest.approx(others, nan_ok=True)


def test_precision_is_undefined_where_the_truth_is_not_exhaustive():
    counts, _, _ = ranked_of([(0, 2.0, 5.0)], post(2), exhaustive=False)
    assert np.isnan(counts.average_precision)
    assert counts.recall.tolist() == [1 / FRAMES]


def test_the_order_is_the_column_asked_for_or_the_first_usual_one():
    both = Detections([0], amplitude=[1.0], prominence=[1.0], own=[1.0])
    assert [order_of(both, asked) for asked in ("own", "", "score_db")] == ["own", "prominence", "prominence"]
    assert order_of(Detections([0], range_m=[1.0])) is None


def test_a_detector_that_thresholds_its_score_alone_lies_on_its_curve():
    """The threshold lies in the middle between two scores that are told apart."""
    finest = 2.0**-7  # of scores from 8 to 16
    least = 9.0 + finest / 2
    changes = {"pipeline.filter.snr.params.minimum_db": least, "pipeline.filter.first_path.params.guard_taps": 0.0}
    found = load_detector("background-mean", changes=changes).run(plate(), candidates=True)
    before = found.candidates["rejected_by"] != list(found.chain).index("filter.first_path")
    alone = found.annotated(candidates=found.candidates.take(before))
    counts = ranked(alone, Scene.of(found, plate()), RULES)
    reached = counts.score > least
    assert (counts.tp[reached].sum(), counts.fp[reached].sum()) == (counts.set_tp, counts.set_fp)
    assert counts.set_tp > 0


def test_the_gate_and_region_of_the_rules_hold_and_their_scoring_does_not():
    counts, candidates, capture = ranked_of([(0, 2.3, 5.0), (0, 2.0, 3.0)], post(2))
    detections = found_in(FRAMES).annotated(candidates=candidates)
    scene = Scene.of(detections, capture)
    same = ranked(detections, scene, dataclasses.replace(RULES, scoring="frame", strongest=1))
    assert (same.tp.tolist(), same.fp.tolist()) == (counts.tp.tolist(), counts.fp.tolist())
    wide = ranked(detections, scene, dataclasses.replace(RULES, gate_m=0.4))
    assert wide.tp.tolist() == [1, 0]
