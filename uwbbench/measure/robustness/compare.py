"""How far two results are apart: in metres, in units in the last place, and in detections that come and go."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uwbbench.api.arrays import BoolArray, IntArray
from uwbbench.api.capture import Capture
from uwbbench.api.case import Evidence, Violation
from uwbbench.api.detections import Detections
from uwbbench.measure.robustness.subject import NEAR_M

SAME_M = 0.075
"""Ranges at most half a tap apart are of the same detection."""


def ordered(detections: Detections) -> Detections:
    """Detections by frame and then range: re-clustering hands them out in another order."""
    return detections.take(np.lexsort((detections.range_m, detections.frame)))


def unchanged(detections: Detections, expected: Detections, tolerance_m: float) -> Evidence:
    """Evidence that two runs agree: the same number in every frame, at ranges within a tolerance.

    Parameters
    ----------
    detections, expected : Detections
        Of the run that is judged, and of its reference; in any order inside a frame.
    tolerance_m : float
        Largest difference of two ranges, inclusive. A range that is NaN must be so in both.

    Returns
    -------
    Evidence
        With the largest difference of ranges, in metres.

    Raises
    ------
    Violation
        If they differ.
    """
    detections, expected = ordered(detections), ordered(expected)
    if not np.array_equal(detections.frame, expected.frame):
        raise Violation(f"{len(detections)} detections where {len(expected)} were expected, or in other frames")
    if not np.array_equal(np.isnan(detections.range_m), np.isnan(expected.range_m)):
        raise Violation("other detections have no range")
    error_m = (
        float(np.nanmax(np.abs(detections.range_m - expected.range_m), initial=0.0)) if "range_m" in detections else 0.0
    )
    if not error_m <= tolerance_m:
        raise Violation(f"ranges differ by up to {error_m:.2g} m, more than {tolerance_m:g} m")
    return Evidence(f"{len(detections)} detections, the same", error_m=error_m)


def in_frames(detections: Detections, frames: IntArray) -> Detections:
    """Detections of the given frames, numbered by their places in that list."""
    kept = detections.take(np.isin(detections.frame, frames))
    order = np.argsort(frames)
    place = order[np.searchsorted(frames[order], kept.frame)]
    return kept.with_columns(frame=place)


def _partnered(detections: Detections, other: Detections) -> BoolArray:
    """Mask of the detections that the other run has too, clustered or noise alike.

    One without a range speaks of its frame as a whole, and is partnered by another such of that frame.
    """
    mask = np.zeros(len(detections), bool)
    for row, frame in enumerate(detections.frame):
        rivals = np.flatnonzero(other.frame == frame)
        same = (detections.range_m[row] == other.range_m[rivals]) | (
            np.abs(detections.range_m[row] - other.range_m[rivals]) <= SAME_M
        )
        same |= np.isnan(detections.range_m[row]) & np.isnan(other.range_m[rivals])
        if "cluster" in detections:
            same &= (detections["cluster"][row] < 0) == (other["cluster"][rivals] < 0)
        mask[row] = same.any()
    return mask


def flipped_share(detections: Detections, other: Detections) -> float:
    """Share of the detections of two runs that only one of them has; 0 where neither has any."""
    total = len(detections) + len(other)
    lonely = np.sum(~_partnered(detections, other)) + np.sum(~_partnered(other, detections))
    return float(lonely / total) if total else 0.0


def hit_share(detections: Detections, capture: Capture, frames: Sequence[int] | IntArray | None = None) -> float:
    """Share of the frames in which a detection lies within :data:`NEAR_M` of the target's range.

    Parameters
    ----------
    detections : Detections
        On that capture.
    capture : Capture
        With the truth of one target.
    frames : sequence of int, optional
        Frames that count, by their index in the capture; all of them by default.
    """
    assert capture.truth is not None  # noqa: S101  (the suite's captures have a truth)
    true_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    near = np.abs(detections.range_m - true_m[detections.frame]) <= NEAR_M
    looked_at = np.arange(len(capture)) if frames is None else np.asarray(frames)
    return float(np.isin(looked_at, detections.frame[near]).mean())


def still_found(
    detections: Detections, capture: Capture, usual: float, loss: float, frames: IntArray | None = None
) -> str:
    """Say in how many frames the echo is found.

    Parameters
    ----------
    detections : Detections
    capture : Capture
        Disturbed; with the truth of one target.
    usual : float
        Share of frames (0...1) with the echo in the undisturbed capture.
    loss : float
        Largest share of all frames that may be lost against it.
    frames : int array, optional
        Frames that count; all of them by default.

    Returns
    -------
    str
        Both shares, for people.

    Raises
    ------
    Violation
        If those are fewer than ``usual`` by more than ``loss``.
    """
    share = hit_share(detections, capture, frames)
    observed = f"echo found in {share:.0%} of frames, undisturbed in {usual:.0%}"
    if share < usual - loss:
        raise Violation(f"{observed}: more than {loss:.0%} lost")
    return observed
