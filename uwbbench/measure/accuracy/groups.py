"""Parts of an outcome: some of its frames, or blocks of a capture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uwbbench.api.arrays import IntArray
from uwbbench.api.metric import Outcome

BLOCKS = 4
"""Blocks of a capture."""


def blocks_of(capture: Sequence[Outcome]) -> list[list[Outcome]]:
    """Each detector's outcomes of four blocks of a capture, which last equally long and are the same for all detectors.

    Parameters
    ----------
    capture : sequence of Outcome
        One for each detector, all of one capture.

    Returns
    -------
    list of lists of Outcome
        None where the capture is too short.
    """
    seconds = np.unique(np.concatenate([outcome.group for outcome in capture]))
    if len(seconds) < BLOCKS:
        return []
    ends = np.array([part[-1] for part in np.array_split(seconds, BLOCKS)])
    return [_split(outcome, ends) for outcome in capture]


def _split(outcome: Outcome, ends: IntArray) -> list[Outcome]:
    """Parts of one outcome, each up to the given second."""
    block = np.searchsorted(ends, outcome.group)
    error_block = block[outcome.error_frame]
    position = np.empty(len(outcome.group), np.int64)
    parts = []
    for number in range(len(ends)):
        rows = np.flatnonzero(block == number)
        position[rows] = np.arange(len(rows))
        parts.append(taken(outcome, rows, np.flatnonzero(error_block == number), position))
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
