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


def ordered(found: Detections) -> Detections:
    """Detections by frame and then range: re-clustering hands them out in another order."""
    return found.take(np.lexsort((found.range_m, found.frame)))


def unchanged(found: Detections, expected: Detections, tolerance_m: float) -> Evidence:
    """Evidence that two runs agree: the same number in every frame, at ranges within a tolerance.

    Raises
    ------
    Violation
        If they differ.
    """
    one, other = ordered(found), ordered(expected)
    if not np.array_equal(one.frame, other.frame):
        raise Violation(f"{len(one)} detections where {len(other)} were expected, or in other frames")
    if not np.array_equal(np.isnan(one.range_m), np.isnan(other.range_m)):
        raise Violation("other detections have no range")
    error_m = float(np.nanmax(np.abs(one.range_m - other.range_m), initial=0.0)) if "range_m" in one else 0.0
    if not error_m <= tolerance_m:
        raise Violation(f"ranges differ by up to {error_m:.2g} m, more than {tolerance_m:g} m")
    return Evidence(f"{len(one)} detections, the same", error_m=error_m)


def in_frames(found: Detections, frames: IntArray) -> Detections:
    """Detections of the given frames, numbered by their places in that list."""
    kept = found.take(np.isin(found.frame, frames))
    order = np.argsort(frames)
    place = order[np.searchsorted(frames[order], kept.frame)]
    return kept.with_columns(frame=place)


def _partnered(found: Detections, other: Detections) -> BoolArray:
    """Mask of the detections that the other run has too, clustered or noise alike."""
    mask = np.zeros(len(found), bool)
    for row, frame in enumerate(found.frame):
        rivals = np.flatnonzero(other.frame == frame)
        same = (found.range_m[row] == other.range_m[rivals]) | (
            np.abs(found.range_m[row] - other.range_m[rivals]) <= SAME_M
        )
        if "cluster" in found:
            same &= (found["cluster"][row] < 0) == (other["cluster"][rivals] < 0)
        mask[row] = same.any()
    return mask


def flipped_share(found: Detections, other: Detections) -> float:
    """Share of the detections of two runs that only one of them has; 0 where neither has any."""
    total = len(found) + len(other)
    lonely = np.sum(~_partnered(found, other)) + np.sum(~_partnered(other, found))
    return float(lonely / total) if total else 0.0


def hit_share(found: Detections, capture: Capture, frames: Sequence[int] | IntArray | None = None) -> float:
    """Share of the frames in which a detection lies within :data:`NEAR_M` of the target's range."""
    assert capture.truth is not None  # noqa: S101  (the suite's captures have a truth)
    true_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    near = np.abs(found.range_m - true_m[found.frame]) <= NEAR_M
    looked_at = np.arange(len(capture)) if frames is None else np.asarray(frames)
    return float(np.isin(looked_at, found.frame[near]).mean())


def still_found(found: Detections, capture: Capture, usual: float, loss: float, frames: IntArray | None = None) -> str:
    """Say in how many frames the echo is found.

    Raises
    ------
    Violation
        If those are fewer than ``usual`` by more than ``loss``.
    """
    share = hit_share(found, capture, frames)
    told = f"echo found in {share:.0%} of frames, undisturbed in {usual:.0%}"
    if share < usual - loss:
        raise Violation(f"{told}: more than {loss:.0%} lost")
    return told
