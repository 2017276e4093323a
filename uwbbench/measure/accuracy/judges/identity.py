"""Which track follows which object from frame to frame, after CLEAR-MOT.

A pair of the frame before is kept as long as it is near, and only what is left is assigned anew (Bernardin and
Stiefelhagen, EURASIP Journal on Image and Video Processing 2008, section 2.1.2): two tracks that lie on one object are
then no switch in every frame in which noise brings the other one nearer.
"""

from __future__ import annotations

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.measure.accuracy.set_distances import assigned


def followers(frame: IntArray, track: IntArray, cost: FloatArray, partner: IntArray, cutoff: float) -> IntArray:
    """Object that each row's track follows.

    Parameters
    ----------
    frame : (n,) int array
        Rising.
    track : (n,) int array
    cost : (n, objects) array
        Distance to each object that the row may follow; NaN where it may not.
    partner : (n,) int array
        Object of each row where every frame is matched for itself, -1 where it has none.
    cutoff : float

    Returns
    -------
    (n,) int array
        As ``partner``.
    """
    near = (~np.isnan(cost)).astype(np.int64)
    first = np.flatnonzero(np.diff(frame, prepend=-1))
    if not near.size:
        return partner
    rivals = np.add.reduceat(near, first, axis=0).max(axis=1) > 1
    contested = rivals | (np.maximum.reduceat(near.sum(axis=1), first) > 1)
    if not contested.any():
        return partner
    follows = partner.copy()
    held: dict[int, int] = {}
    for start, stop, open_choice in zip(first, [*first[1:], len(frame)], contested, strict=True):
        members = slice(start, stop)
        if open_choice:
            follows[members] = _kept(track[members], cost[members], held, cutoff)
        held |= {
            one: number
            for one, number in zip(follows[members].tolist(), track[members].tolist(), strict=True)
            if one >= 0
        }
    return follows


def _kept(track: IntArray, cost: FloatArray, held: dict[int, int], cutoff: float) -> IntArray:
    """Object of each row of one frame: those of before first."""
    left, follows = cost.copy(), np.full(len(track), -1, np.int64)
    for one, number in held.items():
        for row in np.flatnonzero((track == number) & ~np.isnan(left[:, one])).tolist():
            follows[row] = one
            left[row], left[:, one] = np.nan, np.nan
    rows, columns = assigned(left, cutoff, 2.0)
    follows[rows] = columns
    return follows


def changes(frame: IntArray, track: IntArray, follows: IntArray, visible: BoolArray) -> tuple[IntArray, IntArray]:
    """Switches and fragmentations (frames,) of all objects, in the frames in which they come to be.

    Parameters
    ----------
    frame, track, follows : (n,) int array
    visible : (frames, objects) bool array
        Frames in which each object is to be followed.
    """
    rows = np.flatnonzero(follows >= 0)
    rows = rows[np.lexsort((frame[rows], follows[rows]))]
    before, after = rows[:-1], rows[1:]
    same = follows[before] == follows[after]
    before, after = before[same], after[same]
    seen = np.cumsum(visible, axis=0)
    gap = seen[frame[after], follows[after]] - seen[frame[before], follows[before]] > 1
    counts = (
        np.bincount(frame[after[which]], minlength=len(visible)) for which in (track[before] != track[after], gap)
    )
    switches, fragmentations = (count.astype(np.int64) for count in counts)
    return switches, fragmentations
