"""Where in a grid of threshold sets each peak is the one that is retained."""

from __future__ import annotations

import numpy as np

from uwbbench.api.arrays import IntArray
from uwbbench.api.compiling import compiled


@compiled
def regions(start: IntArray, corner: IntArray, shape: IntArray, count: int) -> tuple[IntArray, IntArray, IntArray]:
    """Regions of the grid in which each peak is retained, as signed boxes.

    The sets that a peak passes are a box: all cells up to its corner, thresholds rising along each axis. It is
    retained where it passes and fewer than ``count`` stronger peaks of its frame do. Let T_j be the cells that at
    least j of the stronger peaks pass, each T_j a sum of boxes with signs and T_0 the whole grid. Since the meeting of
    two boxes is the box of the smaller coordinates, the region B - B T_c of a box B is such a sum too, and so is what
    B adds to T_j: B T_(j-1) - B T_j. Boxes of the same corner merge, and most cancel. The cost therefore depends on
    the peaks, not on the number of sets.

    Parameters
    ----------
    start : (frames + 1,) int array
        First peak of each frame, and the number of peaks.
    corner : (peaks, axes) int array
        Cell of the strictest thresholds that each peak passes. The peaks of a frame are ordered by rank.
    shape : (axes,) int array
        Cells along each axis.
    count : int
        Peaks retained in a frame; 0 for all.

    Returns
    -------
    peak, cell, sign : (terms,) int arrays
        A peak is retained in a set where the signs of its boxes that hold the set add up to 1; elsewhere they add up
        to 0. ``cell`` is the flat index of a box's corner, the last axis running fastest.
    """
    axes = len(shape)
    none = 0 * axes  # what is called with a plain number is compiled for it alone
    one = none + 1
    cells = 1
    stride = np.empty(axes, np.int64)
    for axis in range(axes - 1, -1, -1):
        stride[axis] = cells
        cells *= shape[axis]
    coordinate = np.empty((cells, axes), np.int64)
    for flat in range(cells):
        for axis in range(axes):
            coordinate[flat, axis] = flat // stride[axis] % shape[axis]

    weight = np.zeros((count + 1, cells), np.int64)  # of the boxes of T_j, by corner
    listed = np.empty((count + 1, cells), np.int64)  # corners whose weight is not 0
    length = np.zeros(count + 1, np.int64)
    weight[0, cells - 1], listed[0, 0], length[0] = 1, cells - 1, 1
    change = np.zeros(cells, np.int64)
    touched = np.empty(2 * cells + 1, np.int64)

    room = 2 * len(corner) + 16
    terms = np.empty((3, room), np.int64)
    made = 0
    for frame in range(len(start) - 1):
        for peak in range(start[frame], start[frame + 1]):
            own = 0
            for axis in range(axes):
                own += corner[peak, axis] * stride[axis]
            change[own] = 1
            touched[0] = own
            many = one
            if count > 0:
                many = _meet(corner[peak], weight[count], listed[count], length[count], -one, coordinate, stride,
                             change, touched, many)  # fmt: skip
            if made + many > room:
                room = 2 * (room + many)
                larger = np.empty((3, room), np.int64)
                for row in range(3):
                    for place in range(made):
                        larger[row, place] = terms[row, place]
                terms = larger
            before = made
            for place in range(many):
                cell = touched[place]
                if change[cell] != 0:
                    terms[0, made], terms[1, made], terms[2, made] = peak, cell, change[cell]
                    change[cell] = 0
                    made += 1
            if made == before:  # at least ``count`` stronger peaks pass wherever this one does
                continue
            for level in range(count, 0, -1):
                many = _meet(corner[peak], weight[level - 1], listed[level - 1], length[level - 1], one, coordinate,
                             stride, change, touched, none)  # fmt: skip
                many = _meet(corner[peak], weight[level], listed[level], length[level], -one, coordinate, stride,
                             change, touched, many)  # fmt: skip
                length[level] = _merge(weight[level], listed[level], length[level], change, touched, many)
        for level in range(1, count + 1):
            for place in range(length[level]):
                weight[level, listed[level, place]] = 0
            length[level] = 0
    return terms[0, :made], terms[1, :made], terms[2, :made]


@compiled
def _meet(
    corner: IntArray,
    weight: IntArray,
    listed: IntArray,
    length: int,
    sign: int,
    coordinate: IntArray,
    stride: IntArray,
    change: IntArray,
    touched: IntArray,
    many: int,
) -> int:
    """Add to ``change`` the boxes of a sum met with the box of ``corner``; returns the number of touched cells."""
    for place in range(length):
        other = listed[place]
        cell = 0
        for axis in range(len(stride)):
            cell += min(corner[axis], coordinate[other, axis]) * stride[axis]
        change[cell] += sign * weight[other]
        touched[many] = cell
        many += 1
    return many


@compiled
def _merge(weight: IntArray, listed: IntArray, length: int, change: IntArray, touched: IntArray, many: int) -> int:
    """Add ``change`` to the weights of a sum and clear it; returns the number of boxes that are left."""
    for place in range(many):
        cell = touched[place]
        if change[cell] != 0:
            if weight[cell] == 0:
                listed[length] = cell
                length += 1
            weight[cell] += change[cell]
            change[cell] = 0
    left = 0
    for place in range(length):
        if weight[listed[place]] != 0:
            listed[left] = listed[place]
            left += 1
    return left


@compiled
def first_retained(start: IntArray, corner: IntArray, sets: IntArray) -> IntArray:
    """Peak that each threshold set retains in each frame.

    Parameters
    ----------
    start : (frames + 1,) int array
    corner : (peaks, axes) int array
        As in :func:`regions`.
    sets : (sets, axes) int array
        Cell of each set.

    Returns
    -------
    (sets, frames) int array
        The first peak of the frame that passes; -1 where none does.
    """
    frames = len(start) - 1
    retained = np.full((len(sets), frames), -1, np.int64)
    for number in range(len(sets)):
        for frame in range(frames):
            for peak in range(start[frame], start[frame + 1]):
                passes = True
                for axis in range(sets.shape[1]):
                    passes &= corner[peak, axis] >= sets[number, axis]
                if passes:
                    retained[number, frame] = peak
                    break
    return retained
