"""Regions of the grid as signed boxes, against looking at every cell."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.tools.tune.sweep.kernels import first_retained, regions


@st.composite
def peaks_on_a_grid(draw):
    shape = tuple(draw(st.lists(st.integers(1, 4), min_size=1, max_size=3)))
    frames = draw(st.lists(st.lists(st.tuples(*(st.integers(0, n - 1) for n in shape)), max_size=7), max_size=4))
    corner = np.array([peak for frame in frames for peak in frame], np.int64).reshape(-1, len(shape))
    start = np.cumsum([0, *map(len, frames)])
    return start, corner, shape


def retained_cells(start, corner, shape, count):
    """Whether each peak is retained in each cell, by the definition."""
    expected = np.zeros((len(corner), *shape), bool)
    for first, stop in itertools.pairwise(start):
        for cell in np.ndindex(shape):
            passing = [peak for peak in range(first, stop) if all(corner[peak] >= cell)]
            expected[(passing[: count or None], *cell)] = True
    return expected


@settings(deadline=None)  # the first example compiles
@given(peaks_on_a_grid(), st.integers(0, 3))
def test_signed_boxes_add_up_to_the_cells_in_which_a_peak_is_retained(grid, count):
    start, corner, shape = grid
    found = np.zeros((len(corner), *shape), int)
    for peak, cell, sign in zip(*regions(start, corner, np.array(shape), count), strict=True):
        found[(peak, *(slice(0, place + 1) for place in np.unravel_index(cell, shape)))] += sign
    assert np.array_equal(found, retained_cells(start, corner, shape, count))


@settings(deadline=None)  # the first example compiles
@given(peaks_on_a_grid())
def test_a_peak_that_is_retained_nowhere_has_no_boxes(grid):
    start, corner, shape = grid
    peak, _, sign = regions(start, corner, np.array(shape), 1)
    retained = retained_cells(start, corner, shape, 1).reshape(len(corner), int(np.prod(shape))).any(axis=1)
    assert set(peak) == set(np.flatnonzero(retained))
    assert (sign != 0).all()


@settings(deadline=None)  # the first example compiles
@given(peaks_on_a_grid())
def test_the_first_peak_that_passes_is_retained(grid):
    start, corner, shape = grid
    sets = np.array(list(np.ndindex(shape)))
    expected = np.full((len(sets), len(start) - 1), -1)
    for peak, *cell in np.argwhere(retained_cells(start, corner, shape, 1)):
        frame = np.searchsorted(start, peak, side="right") - 1
        expected[np.ravel_multi_index(cell, shape), frame] = peak
    assert np.array_equal(first_retained(start, corner, sets), expected)


def test_many_peaks_of_one_frame_need_more_room_than_was_expected():
    rng = np.random.default_rng(0)
    shape, corner = (9, 9, 9), rng.integers(0, 9, (40, 3))
    corner = corner[np.argsort(corner.sum(axis=1))]  # each passes where the ones before do not: many steps
    peak, cell, sign = regions(np.array([0, 40]), corner, np.array(shape), 3)
    assert len(peak) > 2 * 40 + 16
    found = np.zeros((40, *shape), int)
    for one, place, weight in zip(peak, cell, sign, strict=True):
        found[(one, *(slice(0, at + 1) for at in np.unravel_index(place, shape)))] += weight
    assert np.array_equal(found, retained_cells(np.array([0, 40]), corner, shape, 3))
