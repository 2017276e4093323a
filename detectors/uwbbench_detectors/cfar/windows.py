"""Inner loops of the CFAR detectors: sums and ranks of training windows, and the cells that exceed them."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray, IntArray, compiled
from uwbbench_detectors.compiled.rank import smallest

CA, GO, SO, OS = range(4)
"""Codes of the statistics."""


@compiled
def _add(left: FloatArray, right: FloatArray, total: FloatArray) -> None:
    for place in range(len(total)):
        total[place] = left[place] + right[place]


@compiled
def _add_to(total: FloatArray, part: FloatArray) -> None:
    for place in range(len(total)):
        total[place] += part[place]


@compiled
def window_sums(values: FloatArray, length: int, scratch: FloatArray, sums: FloatArray) -> None:
    """Sums of all runs of ``length`` values, by doubling: runs of 1, 2, 4... from two runs of half the length each.

    The binary digits of ``length`` say which of them make up a run. Nothing is ever subtracted, so that of values that
    are not negative every digit stays: the relative error is at most ``2 log2(length) + 1`` units of rounding, less
    than that of adding up each run, where a difference of running sums keeps no digit of a small value behind a large
    one. NaN and infinity reach only the runs that hold them. Neighbouring runs are added eight at a time by one
    instruction; running sums inside stretches of ``length`` (van Herk, Pattern Recognition Letters 13, 1992) take
    fewer additions, but one after the other, and longer at every length that a window may have.

    Parameters
    ----------
    values : (n,) array
    length : int
        From 1 to n.
    scratch : (2, n) array
        Overwritten.
    sums : (n,) array
        The first ``n - length + 1`` become the sums of the runs that start there.
    """
    windows = len(values) - length + 1
    sums[:windows] = 0.0
    runs, doubled, spare = values, scratch[0], scratch[1]
    width, covered = 1, 0
    while True:
        if length & width:
            _add_to(sums[:windows], runs[covered:])
            covered += width
        if covered == length:
            return
        _add(runs, runs[width:], doubled[: len(values) - 2 * width + 1])
        runs, doubled, spare = doubled, spare, doubled
        width *= 2


@compiled
def estimate_by_mean(
    power: FloatArray, half: int, guard: int, statistic: int, scratch: FloatArray, noise: FloatArray
) -> None:
    """Noise estimate of each cell from the mean power of its two sides; of one side at the edges.

    Parameters
    ----------
    power, noise : (cells,) arrays
    half, guard : int
        Training and guard cells on a side; twice their sum is at most ``cells``.
    statistic : int
        CA, GO or SO.
    scratch : (3, cells) array
        Overwritten.
    """
    cells, edge, beyond = len(power), half + guard, guard + 1
    mean = scratch[2]
    window_sums(power, half, scratch[:2], mean)
    for window in range(cells - half + 1):
        mean[window] /= half
    # The window that starts at cell w lies right of cell w - beyond and left of cell w + edge.
    for cell in range(edge):
        noise[cell] = mean[beyond + cell]
        noise[cells - edge + cell] = mean[cells - 2 * edge + cell]
    inner, right = noise[edge : cells - edge], mean[edge + beyond :]
    if statistic == CA:
        for cell in range(len(inner)):
            inner[cell] = (mean[cell] + right[cell]) / 2
    elif statistic == GO:
        for cell in range(len(inner)):
            inner[cell] = np.maximum(mean[cell], right[cell])
    else:
        for cell in range(len(inner)):
            inner[cell] = np.minimum(mean[cell], right[cell])


@compiled
def _count_below(scaled: FloatArray, power: FloatArray, below: IntArray) -> None:
    for cell in range(len(below)):
        below[cell] += scaled[cell] < power[cell]


@compiled
def estimate_by_rank(
    power: FloatArray,
    half: int,
    guard: int,
    factor: FloatArray,
    places: tuple[int, int],
    scratch: FloatArray,
    below: IntArray,
    noise: FloatArray,
) -> None:
    """Order statistic of the training cells of each cell that exceeds its threshold, infinity in all others.

    A cell exceeds ``factor`` times the k-th smallest of its training cells exactly if it exceeds ``factor`` times at
    least k of them, since rounding keeps the order of products. Counting them needs no sorted window, and eight cells
    are counted at a time; the order statistic itself is looked for only where that says so.

    Parameters
    ----------
    power, noise : (cells,) arrays
    half, guard : int
        Training and guard cells on a side; twice their sum is at most ``cells``.
    factor : (cells,) array
        Factor of every cell: one of them at the edges, with training cells on one side, another one inside.
    places : (int, int)
        Rank k among the training cells of one side and of both, from 1.
    scratch : (cells,) array
        Overwritten.
    below : (cells,) int array
        Overwritten.
    """
    cells, edge, beyond = len(power), half + guard, guard + 1
    last = cells - edge
    below[:] = 0
    for place in range(cells):
        scratch[place] = factor[0] * power[place]
    for offset in range(half):
        _count_below(scratch[beyond + offset :], power[:edge], below[:edge])
        _count_below(scratch[last - edge + offset :], power[last:], below[last:])
    if last > edge:
        for place in range(cells):
            scratch[place] = factor[edge] * power[place]
        for offset in range(half):
            _count_below(scratch[offset:], power[edge:last], below[edge:last])
            _count_below(scratch[edge + beyond + offset :], power[edge:last], below[edge:last])
    for cell in range(cells):
        inside = edge <= cell < last
        place = places[1] if inside else places[0]
        noise[cell] = np.inf
        if below[cell] < place:
            continue
        count = 0 * cell
        if cell >= edge:
            count = _gather(power[cell - edge : cell - guard], factor[cell], power[cell], scratch, count)
        if cell < last:
            count = _gather(power[cell + beyond : cell + beyond + half], factor[cell], power[cell], scratch, count)
        noise[cell] = scratch[place - 1]


@compiled
def _gather(training: FloatArray, factor: float, cell: float, into: FloatArray, count: int) -> int:
    """Put the training cells that a cell exceeds by the factor among sorted ones; return how many there are now."""
    for power in training:
        if factor * power < cell:
            place = count
            while place > 0 and into[place - 1] > power:
                into[place] = into[place - 1]
                place -= 1
            into[place] = power
            count += 1
    return count


@compiled
def _collect(training: FloatArray, factor: float, cell: float, into: FloatArray, count: int) -> int:
    """Append the training cells that a cell exceeds by the factor; return how many there are now."""
    for power in training:
        into[count] = power  # overwritten by the next one, if not exceeded
        count += factor * power < cell
    return count


@compiled
def estimate_by_rank_at(
    cell: int, power: FloatArray, half: int, guard: int, factor: float, places: tuple[int, int], scratch: FloatArray
) -> float:
    """Order statistic of the training cells of one cell, as :func:`estimate_by_rank` has it of all.

    Where only crests are tested this is far less work.

    Parameters
    ----------
    cell : int
    power : (cells,) array
    half, guard : int
        Training and guard cells on a side.
    factor : float
        Of this cell.
    places : (int, int)
        Rank among the training cells of one side and of both, from 1.
    scratch : (cells,) array
        Overwritten.
    """
    edge, last = half + guard, len(power) - half - guard
    left = power[cell - edge : cell - guard] if cell >= edge else power[:0]
    right = power[cell + guard + 1 : cell + guard + 1 + half] if cell < last else power[:0]
    place = places[1] if edge <= cell < last else places[0]
    height = power[cell]
    none = 0 * cell  # what is called with a plain 0 is compiled for it alone
    count = _collect(right, factor, height, scratch, _collect(left, factor, height, scratch, none))
    if count < place:
        return np.inf
    return smallest(scratch[:count], place - 1)


@compiled
def is_crest(amplitude: FloatArray, tap: int, reach: int) -> bool:
    """Whether no tap within ``reach`` exceeds this one; of equal ones the first is the crest.

    Parameters
    ----------
    amplitude : (taps,) array
        Magnitudes of one frame.
    tap : int
    reach : int
        Taps on either side that are compared, as far as the frame has them.
    """
    height = amplitude[tap]
    for other in range(max(tap - reach, 0), min(tap + reach + 1, len(amplitude))):
        higher = height > amplitude[other] or (height == amplitude[other] and tap <= other)
        if not higher:  # nor beside NaN
            return False
    return True


@compiled
def _copies(
    rows: IntArray, tested: IntArray, score_db: FloatArray, count: int, room: int
) -> tuple[IntArray, IntArray, FloatArray]:
    """The first cells found, in arrays with room for so many."""
    row, tap, score = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room)
    for place in range(count):
        row[place], tap[place], score[place] = rows[place], tested[place], score_db[place]
    return row, tap, score


@compiled
def detect(
    amplitude: FloatArray,
    start: int,
    half: int,
    guard: int,
    factor: FloatArray,
    statistic: int,
    places: tuple[int, int],
    reach: int,
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, bool]:
    """Cells that exceed their thresholds, by frame and then tap.

    Parameters
    ----------
    amplitude : (frames, taps) array
        Magnitudes.
    start : int
        First tap that is tested and trained on.
    half, guard : int
        Training and guard cells on a side.
    factor : (taps - start,) array
        Factor on the noise estimate of every cell.
    statistic : int
        CA, GO, SO or OS.
    places : (int, int)
        OS: rank among the training cells of one side and of both, from 1.
    reach : int
        Taps on both sides, skipped ones included, that must not exceed a detected one; 0 takes every cell.

    Returns
    -------
    row, tap : (n,) int arrays
    amplitude : (n,) array
        Magnitude of each detected cell.
    score_db : (n,) array
        Power of the cell over the noise estimate.
    silent : bool
        Whether some cells, of order statistics some crests, hold a signal and their noise estimate is zero; those are
        not detected.
    """
    frames, taps = amplitude.shape
    cells = taps - start
    power, noise = np.empty(cells), np.empty(cells)
    scratch, below = np.empty((3, cells)), np.empty(cells, np.int64)
    rows, tested = np.empty(frames + 16, np.int64), np.empty(frames + 16, np.int64)
    score_db = np.empty(frames + 16)
    count, silent = 0 * frames, False  # what is called with a plain 0 is compiled for it alone
    for frame in range(frames):
        heights = amplitude[frame]
        for cell in range(cells):
            power[cell] = heights[start + cell] * heights[start + cell]
        if statistic == OS and reach:
            for cell in range(cells):
                noise[cell] = np.inf
                if power[cell] > 0 and is_crest(heights, start + cell, reach):
                    noise[cell] = estimate_by_rank_at(cell, power, half, guard, factor[cell], places, scratch[0])
        elif statistic == OS:
            estimate_by_rank(power, half, guard, factor, places, scratch[0], below, noise)
        else:
            estimate_by_mean(power, half, guard, statistic, scratch, noise)
        for cell in range(cells):
            if not power[cell] > factor[cell] * noise[cell]:
                continue
            if noise[cell] == 0:
                silent = True
                continue
            if reach and not is_crest(heights, start + cell, reach):
                continue
            if count == len(rows):
                rows, tested, score_db = _copies(rows, tested, score_db, count, 2 * count)
            rows[count], tested[count] = frame, start + cell
            score_db[count] = 10 * (math.log10(power[cell]) - math.log10(noise[cell]))
            count += 1
    rows, tested, score_db = _copies(rows, tested, score_db, count, count)
    magnitude = np.empty(count)
    for place in range(count):
        magnitude[place] = amplitude[rows[place], tested[place]]
    return rows, tested, magnitude, score_db, silent
