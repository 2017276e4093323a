"""Inner loops of the filter: a Gaussian state of a robot and landmarks, how it moves and what measurements do to it."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray, IntArray, compiled


@compiled
def move(covariance: FloatArray, by_head: FloatArray, noise: FloatArray) -> None:
    """Covariance of a state whose pose moves: ``P <- F P F' + Q`` where F and Q are those of the pose alone.

    Parameters
    ----------
    covariance : (n, n) array
        Changed.
    by_head : (3, h) array
        Derivative of the pose by the first h numbers of the state.
    noise : (3, 3) array
        What the pose loses.
    """
    size, head = len(covariance), by_head.shape[1]
    moved = np.zeros((3, size))
    for row in range(3):
        for place in range(head):
            for column in range(size):
                moved[row, column] += by_head[row, place] * covariance[place, column]
    for row in range(3):
        for column in range(3, size):
            covariance[row, column] = moved[row, column]
            covariance[column, row] = moved[row, column]
        for column in range(row + 1):
            value = noise[row, column]
            for place in range(head):
                value += moved[row, place] * by_head[column, place]
            covariance[row, column] = value
            covariance[column, row] = value


@compiled
def squared_distances(
    covariance: FloatArray,
    starts: IntArray,
    by_pose: FloatArray,
    by_mark: FloatArray,
    off: FloatArray,
    noise: FloatArray,
) -> FloatArray:
    """Squared Mahalanobis distances (m,) of measurements from what is expected of m landmarks.

    Parameters
    ----------
    covariance : (n, n) array
        Of the state, the pose first.
    starts : (m,) int array
        First of the two places of each landmark in the state.
    by_pose : (m, k, 3) array
        Derivatives of the k numbers that are measured.
    by_mark : (m, k, 2) array
    off : (m, k) array
        Measured minus expected.
    noise : (k, k) array
        Covariance of what is measured.
    """
    marks, numbers = off.shape
    squared = np.zeros(marks)
    rows, left = np.empty(5, np.int64), np.empty(numbers)
    seen, spread = np.empty((numbers, 5)), np.empty((numbers, numbers))
    for mark in range(marks):
        rows[0], rows[1], rows[2], rows[3], rows[4] = 0, 1, 2, starts[mark], starts[mark] + 1
        for one in range(numbers):
            left[one] = off[mark, one]
            for row in range(3):
                seen[one, row] = by_pose[mark, one, row]
            for row in range(2):
                seen[one, 3 + row] = by_mark[mark, one, row]
            for other in range(one + 1):
                value = noise[one, other]
                for row in range(5):
                    for column in range(5):
                        value += seen[one, row] * covariance[rows[row], rows[column]] * seen[other, column]
                spread[one, other] = value
        # S = L D L', column by column, and L y = v along with it: the distance is the sum of y^2 / D.
        for one in range(numbers):
            squared[mark] += left[one] * left[one] / spread[one, one]
            for later in range(numbers - 1, one, -1):
                ratio = spread[later, one] / spread[one, one]
                left[later] -= ratio * left[one]
                for other in range(one + 1, later + 1):
                    spread[later, other] -= ratio * spread[other, one]
    return squared


@compiled
def _inverse(spread: FloatArray) -> FloatArray:
    """Inverse of a symmetric positive definite matrix, by Gauss and Jordan without pivots, which it does not need."""
    size = len(spread)
    left, inverse = np.empty((size, size)), np.zeros((size, size))
    for one in range(size):
        inverse[one, one] = 1.0
        for other in range(size):
            left[one, other] = spread[one, other]
    for one in range(size):
        pivot = left[one, one]
        for column in range(size):
            left[one, column] /= pivot
            inverse[one, column] /= pivot
        for other in range(size):
            if other != one:
                ratio = left[other, one]
                for column in range(size):
                    left[other, column] -= ratio * left[one, column]
                    inverse[other, column] -= ratio * inverse[one, column]
    return inverse


@compiled
def correct(
    mean: FloatArray,
    covariance: FloatArray,
    rows: IntArray,
    seen: FloatArray,
    off: FloatArray,
    noise: FloatArray,
    learning: tuple[int, int],
) -> tuple[FloatArray, FloatArray]:
    """Update a state with what depends on a few of its values alone.

    The covariance is that of Joseph's form, ``(I - K H) P (I - K H)' + K R K'``, multiplied out so that the zeros
    of H cost nothing: symmetric whatever is rounded.

    Parameters
    ----------
    mean : (n,) array
        Changed.
    covariance : (n, n) array
        Changed.
    rows : (r,) int array
        Places of these values.
    seen : (k, r) array
        Derivative H by them.
    off : (k,) array
        Innovation.
    noise : (k, k) array
        Covariance R.
    learning : int and int
        First place that is corrected, and the one behind the last.

    Returns
    -------
    (k, k) array, (k, n) array
        Inverse of the covariance of the innovation, and the gain K, turned.
    """
    size, numbers = len(mean), len(off)
    across = np.zeros((numbers, size))
    for one in range(numbers):
        for row in range(len(rows)):
            for column in range(size):
                across[one, column] += seen[one, row] * covariance[rows[row], column]
    spread = np.empty((numbers, numbers))
    for one in range(numbers):
        for other in range(one + 1):
            spread[one, other] = noise[one, other]
            for row in range(len(rows)):
                spread[one, other] += across[one, rows[row]] * seen[other, row]
            spread[other, one] = spread[one, other]
    weight, gain = _inverse(spread), np.zeros((numbers, size))
    for one in range(numbers):
        for other in range(numbers):
            for column in range(learning[0], learning[1]):
                gain[one, column] += weight[one, other] * across[other, column]
    for one in range(numbers):
        for other in range(numbers):
            for column in range(size):
                across[one, column] -= spread[one, other] / 2 * gain[other, column]
        for column in range(size):
            mean[column] += gain[one, column] * off[one]
    for row in range(size):
        for one in range(numbers):
            ahead, aside = gain[one, row], across[one, row]
            for column in range(size):
                covariance[row, column] -= ahead * across[one, column] + aside * gain[one, column]
    return weight, gain


@compiled
def sighted(pose: FloatArray, marks: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Range and bearing (m, 2) of points (m, 2) from a pose (3,), and derivatives by pose (m, 2, 3) and (m, 2, 2)."""
    count = len(marks)
    measured, by_pose, by_mark = np.empty((count, 2)), np.zeros((count, 2, 3)), np.empty((count, 2, 2))
    for mark in range(count):
        east, north = marks[mark, 0] - pose[0], marks[mark, 1] - pose[1]
        squared = max(east * east + north * north, 1e-12)
        range_m = math.sqrt(squared)
        measured[mark, 0], measured[mark, 1] = range_m, math.atan2(north, east) - pose[2]
        by_mark[mark, 0, 0], by_mark[mark, 0, 1] = east / range_m, north / range_m
        by_mark[mark, 1, 0], by_mark[mark, 1, 1] = -north / squared, east / squared
        for number in range(2):
            for axis in range(2):
                by_pose[mark, number, axis] = -by_mark[mark, number, axis]
        by_pose[mark, 1, 2] = -1.0
    return measured, by_pose, by_mark
