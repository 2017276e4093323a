"""Hard sequences of frames: lost, doubled, swapped and single ones, and surroundings that change at once."""

from __future__ import annotations

import numpy as np

from uwbbench.api.arrays import ComplexArray, IntArray
from uwbbench.api.case import Evidence, NotApplicable, Violation, hard_case
from uwbbench.api.errors import CaptureError
from uwbbench.measure.robustness.compare import flipped_share, hit_share, in_frames, still_found, unchanged
from uwbbench.measure.robustness.scene import FRAMES, NOISE, altered, approach, chosen
from uwbbench.measure.robustness.subject import Subject

LOSS = 0.10
"""Share of the frames in which an echo may be missed that is found without the disturbance."""


def _frame_by_frame(subject: Subject) -> None:
    """Leave out what one answer for a window of frames cannot do.

    Raises
    ------
    NotApplicable
        If a stage gives such an answer.
    """
    if any(stage.whole_windows for _, stage in subject.stages()):
        raise NotApplicable("the detector gives one answer for a whole window, which hangs on all of its frames")


def _usual_share(subject: Subject, rows: IntArray) -> float:
    return hit_share(subject.usual, subject.capture, rows)


def _survives(subject: Subject, rows: IntArray, timestamp_s: np.ndarray | None = None) -> Evidence:
    """Evidence that the echo is found as often in a capture made of these rows."""
    capture = chosen(subject.capture, rows, timestamp_s)
    return Evidence(still_found(subject.run(capture), capture, _usual_share(subject, rows), LOSS))


@hard_case("survive")
def lost_frames(subject: Subject) -> Evidence:
    """With every fifth frame lost, and 20 frames in a row, the echo is found in as large a share of the others."""
    _frame_by_frame(subject)
    kept = np.array([row for row in range(FRAMES) if row % 5 != 2 and not 70 <= row < 90])
    return _survives(subject, kept)


@hard_case("survive")
def duplicated_frames(subject: Subject) -> Evidence:
    """With every fourth frame delivered twice, at the same time, the echo is found in as large a share."""
    return _survives(subject, np.sort(np.concatenate([np.arange(FRAMES), np.arange(0, FRAMES, 4)])))


@hard_case("survive")
def reordered_frames(subject: Subject) -> Evidence:
    """With neighbours swapped every ten frames, and times in order, the echo is found in as large a share."""
    rows = np.arange(FRAMES)
    rows[9:-1:10], rows[10::10] = rows[10::10].copy(), rows[9:-1:10].copy()
    return _survives(subject, rows, subject.capture.trajectory.timestamp_s)


@hard_case("reject")
def time_going_backwards(subject: Subject) -> Evidence:
    """A capture whose time goes backwards is refused before any detector sees it, and the frame is named."""
    times = subject.capture.trajectory.timestamp_s.copy()
    times[60] = times[58]
    try:
        chosen(subject.capture, np.arange(FRAMES), times)
    except CaptureError as refusal:
        if "frame 60" not in str(refusal):
            raise Violation(f"refused without naming frame 60: {refusal}") from refusal
        return Evidence("refused, frame 60 named")
    raise Violation("a capture with decreasing times was accepted")


@hard_case("equal")
def one_frame_capture(subject: Subject) -> Evidence:
    """A capture of one frame yields what that frame yields at the start of a longer one."""
    _frame_by_frame(subject)
    first = np.array([0])
    return unchanged(subject.run(chosen(subject.capture, first)), in_frames(subject.usual, first), 0.0)


@hard_case("survive")
def no_frames(subject: Subject) -> Evidence:
    """A capture without frames yields nothing."""
    detections = subject.run(chosen(subject.capture, np.empty(0, np.int64)))
    if len(detections) or len(detections.processed):
        raise Violation(f"{len(detections)} detections in no frames")
    return Evidence("no detections")


STEP_FRAME, SETTLED = 40, np.arange(130, FRAMES)


@hard_case("equal")
def clutter_step(subject: Subject) -> Evidence:
    """90 frames after the clutter has changed at once, the echo is found as often as if it had always been so.

    A second piece of robot-fixed clutter, 26 dB below the direct path, comes up at frame 40. What is compared is a
    capture that has had it from the start: a detector without background removal sees the same frames in both, one
    with a background must have learnt the new one.
    """

    def risen(index: IntArray) -> list[tuple[float, ComplexArray]]:
        return [(3.5, np.where(index >= STEP_FRAME, 0.05, 0.0) * np.exp(0.7j))]

    def lasting(index: IntArray) -> list[tuple[float, ComplexArray]]:
        return [(3.5, np.full(len(index), 0.05) * np.exp(0.7j))]

    stepped, steady = approach(standing=risen), approach(standing=lasting)
    usual = hit_share(subject.run_altered(steady), steady, SETTLED)
    detections = subject.run(stepped)
    return Evidence(still_found(detections, stepped, usual, LOSS, SETTLED))


@hard_case("survive")
def interference_bursts(subject: Subject) -> Evidence:
    """Three frames flooded 40 dB above the noise, and single samples as strong, leave later frames as they were.

    Judged 80 frames later, where at most a tenth of the detections may come or go: a background that averages has
    taken the burst in, and must have forgotten it.
    """
    _frame_by_frame(subject)
    burst = NOISE * 100
    rng = np.random.default_rng(11)

    def flooded(samples: ComplexArray) -> ComplexArray:
        hit = slice(45, 48)
        shape = samples[hit].shape
        samples[hit] += burst / np.sqrt(2) * (rng.normal(size=shape) + 1j * rng.normal(size=shape))
        samples[20:50:7, 33] += burst
        return samples

    detections = subject.run_altered(altered(subject.capture, flooded))
    share = flipped_share(in_frames(detections, SETTLED), in_frames(subject.usual, SETTLED))
    if share > LOSS:
        raise Violation(f"{share:.0%} of the detections 80 frames later come or go")
    return Evidence(f"{share:.0%} of the detections 80 frames later come or go")
