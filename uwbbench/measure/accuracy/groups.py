"""Parts of an outcome: some of its frames, or blocks of a capture."""

from __future__ import annotations

import dataclasses
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
    return [taken(outcome, np.flatnonzero(block == number)) for number in range(len(ends))]


def taken(outcome: Outcome, rows: IntArray) -> Outcome:
    """Outcome of some frames, with what belongs to them; of any subclass.

    Parameters
    ----------
    outcome : Outcome
    rows : int array
        Frames to keep.
    """
    position = np.full(len(outcome.group), -1, np.int64)
    position[rows] = np.arange(len(rows))
    kept = {name: getattr(outcome, name)[rows] for name in outcome.per_frame}
    for frame, names in outcome.per_item.items():
        place = position[getattr(outcome, frame)]
        items = np.flatnonzero(place >= 0)
        kept |= {frame: place[items]} | {name: getattr(outcome, name)[items] for name in names}
    duration_s = outcome.duration_s * len(rows) / len(outcome.group) if len(rows) else 0.0
    return dataclasses.replace(outcome, **kept, duration_s=duration_s)
