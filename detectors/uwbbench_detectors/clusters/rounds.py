"""Clustering again after every few new points, and what each such round decides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uwbbench.api import FloatArray, IntArray, compiled
from uwbbench_detectors.clusters.grid import NONE, UNNUMBERED, Grid, Radius, root_of
from uwbbench_detectors.clusters.incremental import IncrementalDbscan, dbscan, insert, root_of_border
from uwbbench_detectors.compiled.rank import sort


class Decided(NamedTuple):
    """Points that rounds have decided, round after round, in each in their order of arrival.

    Attributes
    ----------
    points : (n,) array
        Places in the order of arrival, counted from the first point of all.
    clusters : (n,) array
        Number of the cluster; -1 for a point that left the window as noise.
    rounds : (n,) array
        Round of this call, from 0.
    """

    points: IntArray
    clusters: IntArray
    rounds: IntArray


class GrowingRounds:
    """Rounds over all points so far.

    Parameters
    ----------
    eps, min_samples
        As of :class:`IncrementalDbscan`.
    every : int
        Points from round to round.
    """

    def __init__(self, eps: float, min_samples: int, every: int) -> None:
        self._dbscan = IncrementalDbscan(eps, min_samples)
        self._every = every
        self._clusters = 0
        self._decided = 0

    def extend(self, points: FloatArray) -> Decided:
        """Take in points (n, 2) that follow a round, and cluster after every few and after the last of them.

        Raises
        ------
        ValueError
            If a coordinate exceeds ``eps`` more than 10^12 times.
        """
        start = len(self._dbscan)
        self._dbscan.put(points)
        decided = np.empty((3, start + len(points) - self._decided), np.int64)
        written, self._clusters = _rounds(
            self._dbscan.grid,
            start,
            start + len(points),
            self._dbscan.radius,
            self._dbscan.min_samples,
            self._every,
            self._clusters,
            decided,
        )
        self._decided += written
        return Decided(*decided[:, :written])


class WindowedRounds:
    """Rounds over the newest points; a point that is noise when it leaves them stays noise.

    Parameters
    ----------
    eps, min_samples
        As of :class:`IncrementalDbscan`.
    every : int
        Points from round to round.
    window : int
        Points of a round.
    """

    def __init__(self, eps: float, min_samples: int, every: int, window: int) -> None:
        self._eps, self._min_samples, self._every, self._window = eps, min_samples, every, window
        self._points = np.empty((0, 2))
        self._ids = np.empty(0, np.int64)  # clusters of these points; NONE marks those not decided
        self._left = 0
        self._clusters = 0

    def extend(self, points: FloatArray) -> Decided:
        """Take in points (n, 2) that follow a round, and cluster after every few and after the last of them.

        Raises
        ------
        ValueError
            If a coordinate exceeds ``eps`` more than 10^12 times.
        """
        parts = [self._round(points[at : at + self._every]) for at in range(0, len(points), self._every)]
        rounds = np.repeat(np.arange(len(parts)), [len(places) for places, _ in parts])
        places, ids = (np.concatenate(column) for column in zip(*parts, strict=True))
        return Decided(places, ids, rounds)

    def _round(self, new: FloatArray) -> tuple[IntArray, IntArray]:
        points = np.concatenate([self._points, new])
        ids = np.concatenate([self._ids, np.full(len(new), NONE)])
        waiting = ids == NONE
        left = max(len(points) - self._window, 0)
        ids[left:] = self._numbered(points[left:], ids[left:])
        decided = np.flatnonzero(waiting & ((ids != NONE) | (np.arange(len(ids)) < left)))
        places = self._left + decided
        self._points, self._ids, self._left = points[left:], ids[left:], self._left + left
        return places, ids[decided]

    def _numbered(self, points: FloatArray, ids: IntArray) -> IntArray:
        """Numbers (n,) that stay the same between rounds; points that are noise now keep theirs.

        Core points alone carry a number on: a border point may lie between two clusters and change sides.
        """
        labels, core = dbscan(points, self._eps, self._min_samples)
        numbered = ids.copy()
        taken: set[int] = set()
        for label in range(int(labels.max(initial=NONE)) + 1):
            known = set(ids[core & (labels == label)].tolist()) - taken - {NONE}
            number = min(known, default=self._clusters)
            self._clusters = max(self._clusters, number + 1)
            taken.add(number)
            numbered[labels == label] = number
        return numbered


@compiled
def _rounds(
    grid: Grid,
    start: int,
    stop: int,
    radius: Radius,
    min_samples: int,
    every: int,
    clusters: int,
    decided: IntArray,
) -> tuple[int, int]:
    """Take in points round by round, write down what is decided, and count that and the clusters so far.

    A component keeps the smallest number of those it was joined from. What a new component consists of was not
    decided before, so that its first core point is met here first.
    """
    written = 0
    place = 0
    while start < stop:
        end = min(start + every, stop)
        insert(grid, start, end, radius, min_samples)
        queue = grid.queue[: grid.used[2]]
        sort(queue)
        for point in queue:
            if grid.points[point].count >= min_samples:
                root = root_of(grid.parent, grid.points[point].cell)
                if grid.cells[root].number == UNNUMBERED:
                    grid.cells[root].number = clusters
                    clusters += 1
        for point in queue:
            if grid.points[point].count >= min_samples:
                root = root_of(grid.parent, grid.points[point].cell)
            else:
                root = root_of_border(grid, point)
            decided[0, written] = point
            decided[1, written] = grid.cells[root].number
            decided[2, written] = place
            written += 1
        grid.used[2] = 0
        start = end
        place += 1
    return written, clusters
