"""What a bootstrap draws: captures, or blocks of captures where these are few."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uwbbench.api.arrays import IntArray
from uwbbench.api.metric import Outcome


def groups_of(series: Sequence[Sequence[Outcome]], minimum: int) -> list[list[Outcome]]:
    """Each detector's outcomes of every group; the groups are the same for all detectors.

    Parameters
    ----------
    series : sequence of sequences of Outcome
        One for each detector, and in it one for each capture, the captures in the same order.
    minimum : int
        Scored captures from which on each is a group; with fewer, their blocks are.
    """
    scored = [captures for captures in zip(*series, strict=True) if any(len(outcome.group) for outcome in captures)]
    if len(scored) >= minimum:
        return [[captures[number] for captures in scored] for number in range(len(series))]
    parts: list[list[Outcome]] = [[] for _ in series]
    for captures in scored:
        blocks = np.unique(np.concatenate([outcome.group for outcome in captures]))
        for into, outcome in zip(parts, captures, strict=True):
            into += _split(outcome, blocks)
    return parts


def _split(outcome: Outcome, blocks: IntArray) -> list[Outcome]:
    """Parts of one outcome, one for each of the given blocks."""
    frames = _members(outcome.group, blocks)
    errors = _members(outcome.group[outcome.error_frame], blocks)
    position = np.empty(len(outcome.group), np.int64)
    parts = []
    for rows, error_rows in zip(frames, errors, strict=True):
        position[rows] = np.arange(len(rows))
        parts.append(taken(outcome, rows, error_rows, position))
    return parts


def taken(outcome: Outcome, rows: IntArray, error_rows: IntArray, position: IntArray) -> Outcome:
    """Outcome of some frames and their detections.

    Parameters
    ----------
    outcome : Outcome
    rows : int array
        Frames to keep.
    error_rows : int array
        Detections of these frames.
    position : (frames,) int array
        New row of each kept frame.
    """
    return Outcome(
        group=outcome.group[rows],
        tp=outcome.tp[rows],
        fp=outcome.fp[rows],
        fn=outcome.fn[rows],
        error_frame=position[outcome.error_frame[error_rows]],
        error_m=outcome.error_m[error_rows],
        matched=outcome.matched[error_rows],
        duration_s=outcome.duration_s * len(rows) / len(outcome.group) if len(rows) else 0.0,
        exhaustive=outcome.exhaustive,
    )


def _members(group: IntArray, blocks: IntArray) -> list[IntArray]:
    """Positions of each block's entries in ``group``, in order."""
    order = np.argsort(group, kind="stable")
    starts = np.searchsorted(group[order], blocks, side="left")
    ends = np.searchsorted(group[order], blocks, side="right")
    return [order[start:end] for start, end in zip(starts, ends, strict=True)]
