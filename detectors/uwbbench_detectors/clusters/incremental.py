"""Exact DBSCAN that takes points in one after the other, in bounded time each."""

from __future__ import annotations

import numpy as np

from uwbbench.api import BoolArray, FloatArray, IntArray, compiled
from uwbbench_detectors.clusters.grid import (
    AROUND,
    BORDER,
    LARGEST_INDEX,
    NONE,
    OWN,
    UNNUMBERED,
    Grid,
    Radius,
    bounds_reach,
    cell_at,
    joined,
    neighbours,
    root_of,
    widen_bounds,
)
from uwbbench_detectors.clusters.tree import core_point_near


class IncrementalDbscan:
    """Clusters of all points so far, equal to those of a DBSCAN run anew over them.

    Two points are neighbours if ``dx * dx + dy * dy <= eps * eps`` in double precision. A border point belongs to the
    cluster of a neighbouring core point; where those are several, to the cluster whose first core point arrived
    first. Clusters are numbered by their first core points. Labels so equal those of scikit-learn's ``DBSCAN`` with
    ``algorithm="kd_tree"``, also for border points.

    A point costs a look at the 25 cells around it: cells hold fewer than ``min_samples`` points that are not core,
    core points of one cell are in one cluster, and between two cells of one cluster nothing is compared.

    Parameters
    ----------
    eps : float
        Neighbourhood radius, in the unit of the coordinates.
    min_samples : int
        Points in the neighbourhood of a core point, itself included.

    Raises
    ------
    ValueError
        If the square of ``eps`` is no normal number.

    References
    ----------
    Ester, Kriegel, Sander, Wimmer, Xu, Incremental clustering for mining in a data warehousing environment,
    VLDB 1998; cells as in Gunawan, A faster algorithm for DBSCAN, TU Eindhoven 2013.
    """

    def __init__(self, eps: float, min_samples: int) -> None:
        self.radius = Radius.of(eps)
        self.min_samples = min_samples
        self.grid = Grid.empty()

    def __len__(self) -> int:
        return int(self.grid.used[0])

    def insert(self, points: FloatArray) -> None:
        """Take in the next points.

        Parameters
        ----------
        points : (n, 2) array

        Raises
        ------
        ValueError
            If a coordinate is not finite, or exceeds ``eps`` more than 10^12 times.
        """
        self.put(points)
        insert(self.grid, len(self), len(self) + len(points), self.radius, self.min_samples)
        self.grid.used[2] = 0

    def put(self, points: FloatArray) -> None:
        """Store points where the kernels find them, without taking them in."""
        if len(points) and not np.abs(points).max() < LARGEST_INDEX * self.radius.side:
            raise ValueError(
                f"points lie farther than {LARGEST_INDEX * self.radius.side:g} from the origin, or nowhere: too far "
                f"to resolve neighbours within {self.radius.squared**0.5:g}"
            )
        self.grid = self.grid.with_room(len(points))
        room = self.grid.points[len(self) : len(self) + len(points)]
        room["x"], room["y"] = points[:, 0], points[:, 1]

    def labels(self) -> IntArray:
        """Cluster of each point (n,) in order of arrival; -1 is noise."""
        labels = np.empty(len(self), np.int64)
        label(self.grid, labels)
        return labels

    @property
    def core(self) -> BoolArray:
        """Whether each point (n,) is a core point."""
        return np.asarray(self.grid.points["count"][: len(self)] >= self.min_samples)


def dbscan(points: FloatArray, eps: float, min_samples: int) -> tuple[IntArray, BoolArray]:
    """Clusters of points, equal to those of scikit-learn's ``DBSCAN``, as :class:`IncrementalDbscan` says.

    Parameters
    ----------
    points : (n, 2) array
    eps : float
        Neighbourhood radius, in the unit of the coordinates.
    min_samples : int
        Points in the neighbourhood of a core point, itself included.

    Returns
    -------
    labels : (n,) array
        -1 is noise.
    core : (n,) bool array

    Raises
    ------
    ValueError
        If a coordinate is not finite, or exceeds ``eps`` more than 10^12 times.
    """
    clusters = IncrementalDbscan(eps, min_samples)
    clusters.insert(points)
    return clusters.labels(), clusters.core


@compiled
def insert(grid: Grid, start: int, stop: int, radius: Radius, min_samples: int) -> None:
    """Take in the points ``start`` to ``stop``, and queue every point that a cluster takes in by that.

    Parameters
    ----------
    grid : Grid
        Holds the coordinates of these points already, with room for a cell of each; written.
    start, stop : int
        Places of the points in the order of arrival; all before ``start`` were taken in.
    radius : Radius
    min_samples : int
        Points in the neighbourhood of a core point, itself included.
    """
    points, cells = grid.points, grid.cells
    for new in range(start, stop):
        x, y = points[new].x, points[new].y
        home = cell_at(grid, int(np.floor(x / radius.side)), int(np.floor(y / radius.side)))
        cells[home].points += 1
        count = min_samples if cells[home].points >= min_samples else 1
        reach = 0
        risen = NONE  # newest of the points that are core from now on, listed by their ``next``
        for place in range(AROUND):
            near = grid.around[home, place]
            if near < 0:
                continue
            before = NONE
            point = cells[near].waiting
            while point >= 0:
                after = points[point].next
                if place == OWN or neighbours(points[point], x, y, radius):
                    count += 1
                    points[point].count += 1
                    if points[point].count >= min_samples:
                        if before < 0:
                            cells[near].waiting = after
                        else:
                            points[before].next = after
                        points[point].next = risen
                        risen = point
                    else:
                        before = point
                else:
                    before = point
                point = after
            if count >= min_samples or (place != OWN and not bounds_reach(cells[near], x, y, radius)):
                continue
            point = cells[near].core
            while point >= 0 and count < min_samples:
                if place == OWN or neighbours(points[point], x, y, radius):
                    count += 1
                    reach |= 1 << place
                point = points[point].next
        points[new].cell = home
        points[new].count = min(count, min_samples)
        if count >= min_samples:
            points[new].reach = 0
            points[new].next = risen
            risen = new
        else:
            points[new].reach = reach
            grid.owner[new] = BORDER if reach else NONE
            points[new].next = cells[home].waiting
            cells[home].waiting = new
            if reach:
                _enqueue(grid, new)
        while risen >= 0:
            point = risen
            risen = points[point].next
            _make_core(grid, point, radius)
    grid.used[0] = stop


@compiled
def _make_core(grid: Grid, new: int, radius: Radius) -> None:
    """List a point as core, join the components that it connects, and let it reach the waiting points around."""
    points, cells = grid.points, grid.cells
    x, y = points[new].x, points[new].y
    home = points[new].cell
    if points[new].reach == 0:
        _enqueue(grid, new)
    points[new].next = cells[home].core
    cells[home].core = new
    widen_bounds(cells[home], x, y)
    grid.owner[new] = home
    if grid.parent[home] < 0:
        grid.parent[home] = home
        grid.dense[grid.used[3]] = home
        grid.used[3] += 1
        cells[home].first = new
        cells[home].number = UNNUMBERED
    root = root_of(grid.parent, home)
    cells[root].first = min(cells[root].first, new)
    for place in range(AROUND):
        near = grid.around[home, place]
        if near < 0:
            continue
        seen_from_there = 1 << (AROUND - 1 - place)
        point = cells[near].waiting
        while point >= 0:
            reach = points[point].reach
            if not reach & seen_from_there and (place == OWN or neighbours(points[point], x, y, radius)):
                points[point].reach = reach | seen_from_there
                grid.owner[point] = BORDER
                if reach == 0:
                    _enqueue(grid, point)
            point = points[point].next
        if grid.parent[near] < 0:
            continue
        other = root_of(grid.parent, near)
        if other != root and core_point_near(grid, near, x, y, radius):
            root = joined(grid, root, other)


@compiled
def _enqueue(grid: Grid, point: int) -> None:
    grid.queue[grid.used[2]] = point
    grid.used[2] += 1


@compiled
def root_of_border(grid: Grid, point: int) -> int:
    """Root of the component that a border point belongs to: of those it reaches, that of the first core point.

    Where it reaches one only, it will stay there, and is given an owner.
    """
    root = NONE
    contested = False
    reach = grid.points[point].reach
    place = 0
    while reach:
        if reach & 1:
            near = root_of(grid.parent, grid.around[grid.points[point].cell, place])
            contested |= root >= 0 and near != root
            if root < 0 or grid.cells[near].first < grid.cells[root].first:
                root = near
        reach >>= 1
        place += 1
    if not contested:
        grid.owner[point] = root
    return root


@compiled
def label(grid: Grid, labels: IntArray) -> None:
    """Number the clusters by their first core points, and write the number of each point's cluster."""
    dense = grid.dense[: grid.used[3]]
    opens = np.zeros(len(labels), np.bool_)  # a cluster
    for cell in dense:
        if grid.parent[cell] == cell:
            opens[grid.cells[cell].first] = True
    rank = np.empty(grid.used[1] - BORDER, np.int32)  # of the cluster that each owner is in
    rank[NONE - BORDER] = NONE
    rank[0] = BORDER
    clusters = 0
    for point in range(len(labels)):
        if opens[point]:
            rank[root_of(grid.parent, grid.owner[point]) - BORDER] = clusters
            clusters += 1
    for cell in dense:
        rank[cell - BORDER] = rank[root_of(grid.parent, cell) - BORDER]
    for point in range(len(labels)):
        labels[point] = rank[grid.owner[point] - BORDER]
    for point in range(len(labels)):
        if labels[point] == BORDER:
            labels[point] = rank[root_of_border(grid, point) - BORDER]
