"""How old answers are, and what a detector knew at each moment."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tests.measure.accuracy.scenes import at_once, capture_of, counts, found_in, post
from uwbbench.api import Detections, ScoringError
from uwbbench.measure.accuracy.age import age_summary, latest_answers
from uwbbench.measure.accuracy.scoring import score

FRAMES = 10


def late(found: Detections, by: int, frames: int = FRAMES) -> Detections:
    """The same detections, everything about a frame held back for so many frames, or to the end."""
    return found.with_hand_outs(np.minimum(found.frame + by, frames), np.minimum(found.processed + by, frames))


def held(found: Detections, handed_out: list[int]) -> Detections:
    """The same detections handed out after these frames, although each frame was named as processed at once."""
    return found.with_hand_outs(handed_out, found.processed)


def answers(found: Detections) -> dict[int, list[float]]:
    """Ranges of the latest answer by moment, where there are any."""
    latest = latest_answers(found)
    return {int(frame): latest.range_m[latest.frame == frame].tolist() for frame in np.unique(latest.frame)}


def approaching() -> tuple[object, Detections]:
    """A robot that drives 0.15 m a frame towards a post, and its range in each frame."""
    x_m = 0.15 * np.arange(FRAMES)
    capture = capture_of(post(5), frames=FRAMES, position_m=np.c_[x_m, np.zeros((FRAMES, 2))])
    return capture, found_in(FRAMES, *enumerate(5 - x_m))


def test_answers_at_once_are_those_of_their_frames():
    found = at_once(found_in(6, (0, 1.0), (2, 2.0), (2, 3.0), (5, 4.0)))
    assert answers(found) == {0: [1.0], 2: [2.0, 3.0], 5: [4.0]}


def test_a_detector_that_waits_answers_with_what_it_knew_then():
    found = late(found_in(6, (0, 1.0), (1, 2.0), (3, 4.0)), by=2, frames=6)
    assert answers(found) == {2: [1.0], 3: [2.0], 5: [4.0]}


def test_the_last_answer_stays_while_detections_are_held_back():
    found = held(found_in(8, (0, 1.0), (1, 2.0), (4, 5.0)), [3, 3, 7])
    assert answers(found) == {3: [2.0], 4: [2.0], 5: [2.0], 6: [2.0], 7: [5.0]}


def test_a_frame_without_detections_is_no_answer_of_a_detector_that_names_frames_too_early():
    assert answers(held(found_in(6, (1, 2.0)), [3])) == {3: [2.0], 4: [2.0], 5: [2.0]}
    assert answers(late(found_in(6, (1, 2.0)), by=2, frames=6)) == {3: [2.0]}


def test_the_rest_of_an_answer_joins_it():
    found = held(found_in(6, (2, 1.0), (2, 3.0)), [2, 4]).take(np.array([1, 0]))
    assert answers(found) == {2: [1.0], 3: [1.0], 4: [3.0, 1.0], 5: [3.0, 1.0]}


def test_an_older_answer_does_not_replace_a_newer_one():
    found = held(found_in(5, (0, 1.0), (1, 2.0)), [3, 1])
    assert answers(found) == {frame: [2.0] for frame in range(1, 5)}


def test_what_comes_only_at_the_end_is_never_in_time():
    capture, found = approaching()
    assert answers(late(found, FRAMES)) == {}
    assert counts(score(late(found, FRAMES), capture, "latest")) == (0, 0, FRAMES)


def test_late_answers_of_a_moving_robot_are_wrong_by_how_far_it_has_moved():
    capture, found = approaching()
    assert counts(score(late(found, 0), capture, "latest")) == (FRAMES, 0, 0)
    one = score(late(found, 1), capture, "latest")
    assert counts(one) == (FRAMES - 1, 0, 1)  # 0.15 m is within the gate
    assert one.mae_m == pytest.approx(0.15)
    two = score(late(found, 2), capture, "latest")
    assert counts(two) == (0, FRAMES - 2, 2)
    assert two.bias_m == pytest.approx(0.3)


def test_late_answers_of_a_robot_that_stands_still_cost_the_first_frames_alone():
    found = found_in(FRAMES, *((frame, 2.0) for frame in range(FRAMES)))
    assert counts(score(late(found, 3), capture_of(post(2), frames=FRAMES), "latest")) == (FRAMES - 3, 0, 3)


def test_frames_that_were_not_processed_are_not_moments():
    found = Detections([0, 3], range_m=[1.0, 4.0], processed=[0, 1, 3])
    latest = latest_answers(late(found, 1, frames=4))
    assert_array_equal(latest.frame, [1])
    assert_array_equal(latest.processed, [0, 1, 3])


def test_detections_that_do_not_say_when_they_were_handed_out_are_not_judged_by_it():
    with pytest.raises(ScoringError, match=r"handed_out=True\), or run the experiment anew"):
        score(found_in(4, (0, 2.0)), capture_of(post(2)), "latest")


@pytest.mark.parametrize("by", [0, 1, 4])
def test_the_age_of_a_detector_that_waits_is_what_it_waits(by):
    found = late(found_in(100, *((frame, 2.0) for frame in range(0, 90, 3))), by, frames=100)
    age = age_summary(found, np.arange(100) * 0.02, np.full(100, 500.0))
    assert age is not None
    assert (age["n"], age["p50_frames"], age["p95_frames"], age["max_frames"], age["end_share"]) == (30, by, by, by, 0)
    assert [age["p50_s"], age["p95_s"]] == pytest.approx([0.02 * by + 0.0005] * 2)


def test_the_age_of_what_comes_at_the_end_is_counted_up_to_the_last_frame():
    found = held(found_in(5, (0, 1.0), (3, 2.0)), [5, 3])
    age = age_summary(found, np.arange(5.0), np.zeros(5))
    assert age is not None
    assert (age["max_frames"], age["end_share"], age["p50_s"]) == (4, 0.5, 2.0)


def test_without_detections_there_is_no_age():
    assert age_summary(at_once(found_in(5)), np.arange(5.0), np.zeros(5)) is None
    assert age_summary(found_in(5, (1, 2.0)), np.arange(5.0), np.zeros(5)) is None
