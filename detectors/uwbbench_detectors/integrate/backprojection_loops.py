"""Inner loops of back-projection: a look is added to the map, and the map is searched."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import ComplexArray, FloatArray, IntArray, compiled, inlined

REAL, IMAGINARY, LOOKS, BEGAN_M, CLOSED, STRETCHES = range(6)
"""Of a cell: coherent sum of its stretch, looks in it and where on the way it began; evidence and number of those
before."""
FIELDS = 6

TX_X, TX_Y, RX_X, RX_Y, AHEAD_X, AHEAD_Y, ZERO, WAY_M, BREAKS = range(9)
"""Of a look: transmitter, receiver, direction of boresight, tap of a path of no length, way of the receiver so far; and
whether the look before lies too far away to be added in phase."""
LOOK = 9

CELL_M, TAPS_PER_M, TURN_PER_M, BAND_PER_M, WIDE_M = range(5)
"""Settings: cell; taps and phase a metre of path; bandwidth over the speed of light; width of an object."""
NEAREST_M, FARTHEST_M, VIEW = range(5, 8)
"""Range of cells; cosine of half the field of view."""
LONGEST_M, STRETCH_PER_M, FORGET_M, FORGET_PER_M = range(8, 12)
"""Way of a stretch at most, and a metre of range; the same of the way over which evidence is forgotten."""
MARGIN, NOISE, ARRAY_RAD, DIRECT_SINE = range(12, 16)
"""How far a side lobe may exceed what is expected of it; what noise alone may reach; phase between two antennas at a
sine of 1, 0 of one alone; sine of the direct path."""
SETTINGS = 16

EULER = 0.5772156649015329
ROOT_HALF = math.sqrt(0.5)
TEN_DB = math.log(10)
CANDIDATES = 256
"""Crests that are looked at, strongest first."""


@compiled
def flooded(samples: ComplexArray, log_level: FloatArray) -> bool:
    """Whether the power of a look lies 10 dB above that of the looks so far, by the mean of logarithms over the taps.

    Parameters
    ----------
    samples : (taps,) complex array
    log_level : (taps,) array
        As of :func:`in_units_of_noise`.
    """
    rise, known = 0.0, 0
    for tap in range(len(samples)):
        height = math.hypot(samples[tap].real, samples[tap].imag)
        if height > 0 and not math.isnan(log_level[tap]):
            rise += 2 * math.log(height) - log_level[tap]
            known += 1
    return rise > TEN_DB * known


@compiled
def in_units_of_noise(
    samples: ComplexArray, log_level: FloatArray, weight: float, half: int, ceiling: FloatArray, reach: int
) -> ComplexArray:
    """Divide a look by the level of noise and clutter, from the mean logarithm of the power of looks and taps around.

    The power of complex noise of mean s is distributed exponentially, and the mean of its logarithm is
    ``ln s - 0.5772``. Unlike a mean of powers it is hardly raised by the few taps that hold an echo.

    An echo comes nearer by less than a tap from look to look, and does not grow by more than 6 dB. What exceeds both
    that and 12 dB above the noise is a burst, and is cut down to it.

    Parameters
    ----------
    samples : (taps,) complex array
    log_level : (taps,) array
        Running mean of the logarithm, NaN where there was no power yet; carried on.
    weight : float
        Of this look in the running mean.
    half : int
        Taps to each side that the level is taken from.
    ceiling : (taps,) array
        Magnitudes of the look before, carried on; infinite where there was none.
    reach : int
        Taps that an echo may have moved.

    Returns
    -------
    (taps,) array
    """
    taps = len(samples)
    total, known = np.zeros(taps + 1), np.zeros(taps + 1)
    for tap in range(taps):
        height = math.hypot(samples[tap].real, samples[tap].imag)
        if height > 0:
            value = 2 * math.log(height)
            log_level[tap] = value if math.isnan(log_level[tap]) else log_level[tap] + weight * (value - log_level[tap])
        seen = not math.isnan(log_level[tap])
        total[tap + 1] = total[tap] + (log_level[tap] if seen else 0.0)
        known[tap + 1] = known[tap] + seen
    scaled, heights = np.zeros_like(samples), np.zeros(taps)
    for tap in range(taps):
        low, high = max(tap - half, 0), min(tap + half + 1, taps)
        if known[high] > known[low]:
            mean = (total[high] - total[low]) / (known[high] - known[low])
            scaled[tap] = samples[tap] * math.exp(-0.5 * (mean + EULER))
        heights[tap] = math.hypot(scaled[tap].real, scaled[tap].imag)
        most = 4.0
        for near in range(max(tap - reach, 0), min(tap + reach + 1, taps)):
            most = max(most, 2 * ceiling[near])
        if heights[tap] > most:
            scaled[tap] *= most / heights[tap]
            heights[tap] = most
    ceiling[:] = heights
    return scaled


@inlined
def _path_m(x: float, y: float, look: FloatArray) -> float:
    """Path from the transmitter over a point to the receiver of a look."""
    to_x, to_y, from_x, from_y = x - look[TX_X], y - look[TX_Y], x - look[RX_X], y - look[RX_Y]
    path: float = math.sqrt(to_x * to_x + to_y * to_y) + math.sqrt(from_x * from_x + from_y * from_y)
    return path


@inlined
def _seen_range_m(x: float, y: float, look: FloatArray, at: FloatArray) -> float:
    """Range of a point from the receiver of a look; -1 where it is out of range or view."""
    dx, dy = x - look[RX_X], y - look[RX_Y]
    range_m = math.sqrt(dx * dx + dy * dy)
    if not at[NEAREST_M] <= range_m <= at[FARTHEST_M]:
        return -1.0
    return range_m if dx * look[AHEAD_X] + dy * look[AHEAD_Y] >= at[VIEW] * range_m else -1.0


@inlined
def _sine_of(x: float, y: float, range_m: float, look: FloatArray) -> float:
    """Sine of the azimuth of a point at a range, positive to the left."""
    sine: float = (look[AHEAD_X] * (y - look[RX_Y]) - look[AHEAD_Y] * (x - look[RX_X])) / range_m
    return sine


@inlined
def _at_tap(samples: ComplexArray, tap: float) -> complex:
    """Sample between taps, by the cubic through four of them."""
    k = int(tap)
    f = tap - k
    a, b, c, d = samples[k - 1], samples[k], samples[k + 1], samples[k + 2]
    curved = a - 2.5 * b + 2 * c - 0.5 * d + f * (1.5 * (b - c) + 0.5 * (d - a))
    sample: complex = b + f * (0.5 * (c - a) + f * curved)
    return sample


@compiled
def move_window(cells: FloatArray, owner: IntArray, centre: int, columns: bool) -> None:
    """Give the columns, or rows, of a map to the cells of the world around a centre; what leaves it is forgotten.

    Parameters
    ----------
    cells : (n, n, FIELDS) array
    owner : (n,) int array
        Cell of the world that each column or row holds.
    centre : int
    columns : bool
    """
    size = len(owner)
    for cell in range(centre - size // 2, centre - size // 2 + size):
        place = cell % size
        if owner[place] != cell:
            owner[place] = cell
            if columns:
                cells[:, place] = 0
            else:
                cells[place] = 0


@compiled
def add_look(
    cells: FloatArray, owner: IntArray, samples: ComplexArray, second: ComplexArray, look: FloatArray, at: FloatArray
) -> None:
    """Add a look to every cell that it sees, in phase with the others of the cell's stretch.

    Parameters
    ----------
    cells : (n, n, FIELDS) array
    owner : (2, n) int array
        Cell of the world that each column, and each row, holds.
    samples, second : (taps,) complex arrays
        In units of the noise, at baseband; the other is that of the second antenna, which ``ARRAY_RAD`` asks for.
    look : (LOOK,) array
    at : (SETTINGS,) array
    """
    size, taps = len(cells), len(samples)
    for axis in range(2):
        move_window(cells, owner[axis], math.floor(look[RX_X + axis] / at[CELL_M]), axis == 0)
    for row in range(size):
        y = (owner[1, row] + 0.5) * at[CELL_M]
        for column in range(size):
            x = (owner[0, column] + 0.5) * at[CELL_M]
            range_m = _seen_range_m(x, y, look, at)
            if range_m < 0:
                continue
            path = _path_m(x, y, look)
            tap = look[ZERO] + path * at[TAPS_PER_M]
            if not 1 <= tap < taps - 2:
                continue
            cell = cells[row, column]
            stretch_m = look[WAY_M] - cell[BEGAN_M]
            if cell[LOOKS] > 0 and (look[BREAKS] > 0 or stretch_m >= min(at[LONGEST_M], at[STRETCH_PER_M] * range_m)):
                kept = math.exp(-stretch_m / min(at[FORGET_M], at[FORGET_PER_M] * range_m))
                cell[CLOSED] = kept * cell[CLOSED] + (cell[REAL] ** 2 + cell[IMAGINARY] ** 2) / cell[LOOKS]
                cell[STRETCHES] = kept * cell[STRETCHES] + 1
                cell[REAL] = cell[IMAGINARY] = cell[LOOKS] = 0.0
            if cell[LOOKS] == 0:
                cell[BEGAN_M] = look[WAY_M]
            z = _at_tap(samples, tap)
            if at[ARRAY_RAD] > 0:
                late_rad = at[ARRAY_RAD] * (_sine_of(x, y, range_m, look) - at[DIRECT_SINE])
                z = (z + _at_tap(second, tap) * complex(math.cos(late_rad), -math.sin(late_rad))) * ROOT_HALF
            cosine, sine = math.cos(at[TURN_PER_M] * path), math.sin(at[TURN_PER_M] * path)
            cell[REAL] += z.real * cosine - z.imag * sine
            cell[IMAGINARY] += z.real * sine + z.imag * cosine
            cell[LOOKS] += 1.0


@compiled
def _between(before: float, here: float, after: float) -> float:
    """Place of a crest between cells, by a parabola through logarithms, or through values that have none."""
    if before > 0 and after > 0:
        before, here, after = math.log(before), math.log(here), math.log(after)
    bend = 2 * here - before - after
    return min(max(0.5 * (after - before) / bend, -0.5), 0.5) if bend > 0 else 0.0


@compiled
def crests(cells: FloatArray, owner: IntArray, look: FloatArray, at: FloatArray, thresholds: FloatArray) -> FloatArray:
    """Find the crests of the map that noise does not explain, in view of a look.

    Parameters
    ----------
    cells : (n, n, FIELDS) array
    owner : (2, n) int array
    look : (LOOK,) array
    at : (SETTINGS,) array
    thresholds : (stretches,) array
        Of the evidence of a cell with as many stretches, rising; that of the last holds for more.

    Returns
    -------
    (crests, 3) array
        x, y and evidence.
    """
    size = len(cells)
    value = np.empty((size, size))
    for row in range(size):
        for column in range(size):
            cell = cells[row, column]
            value[row, column] = cell[CLOSED] - cell[STRETCHES]
            if cell[LOOKS] > 0:
                value[row, column] += (cell[REAL] ** 2 + cell[IMAGINARY] ** 2) / cell[LOOKS] - 1
    found = np.empty((size * size // 4 + size, 3))
    count = 0
    for row in range(size):
        for column in range(size):
            here = value[row, column]
            if not here >= thresholds[1]:
                continue
            stretches = math.ceil(cells[row, column, STRETCHES]) + (cells[row, column, LOOKS] > 0)
            if here < thresholds[min(stretches, len(thresholds) - 1)]:
                continue
            up, right = (row + 1) % size, (column + 1) % size
            highest = here > value[row - 1, column] and here > value[row, column - 1]
            highest &= here >= value[up, column] and here >= value[row, right]
            highest &= here > value[row - 1, column - 1] and here > value[row - 1, right]
            highest &= here >= value[up, column - 1] and here >= value[up, right]
            if not highest:
                continue
            x = owner[0, column] + 0.5 + _between(value[row, column - 1], here, value[row, right])
            y = owner[1, row] + 0.5 + _between(value[row - 1, column], here, value[up, column])
            if _seen_range_m(x * at[CELL_M], y * at[CELL_M], look, at) >= 0:
                found[count, 0], found[count, 1], found[count, 2] = x * at[CELL_M], y * at[CELL_M], here
                count += 1
    return found[:count].copy()


@compiled
def explained(point: FloatArray, strong: FloatArray, looks: FloatArray, at: FloatArray) -> float:
    """Share of the evidence of a point object that may turn up at another point.

    Of a look, the pulse leaves ``1 / (1 + (pi B t)^2)`` of the power, the envelope of that of a flat band, at the delay
    t between the two, and two antennas ``cos^2`` of half the difference of their phases. Over a stretch in which the
    difference of the two paths turns the phase by 2 x, the sum falls as ``(sin x / x)^2``, of which the envelope is
    taken too, ``1 / (1 + x^2 / 3)``: where the zeros lie hangs on a hundredth of a wavelength.

    Parameters
    ----------
    point, strong : (3,) arrays
        The other point, and the object.
    looks : (n, LOOK) array
    at : (SETTINGS,) array

    Returns
    -------
    float
        At most 1.
    """
    share = total = height = count = began_m = 0.0
    shortest_m = longest_m = 0.0
    for index in range(len(looks) + 1):
        look = looks[min(index, len(looks) - 1)]
        range_m = _seen_range_m(point[0], point[1], look, at)
        ends = index == len(looks)
        if range_m < 0 and not ends:
            continue
        stretch_m = look[WAY_M] - began_m
        if count > 0 and (ends or look[BREAKS] > 0 or stretch_m >= min(at[LONGEST_M], at[STRETCH_PER_M] * range_m)):
            turn = 0.5 * at[TURN_PER_M] * (longest_m - shortest_m)
            kept = math.exp(-stretch_m / min(at[FORGET_M], at[FORGET_PER_M] * abs(range_m)))
            share = kept * share + height / (1 + turn * turn / 3)
            total = kept * total + count
            height = count = 0.0
        if ends:
            break
        off_m = _path_m(point[0], point[1], look) - _path_m(strong[0], strong[1], look)
        if count == 0:
            began_m, shortest_m, longest_m = look[WAY_M], off_m, off_m
        shortest_m, longest_m = min(shortest_m, off_m), max(longest_m, off_m)
        late = math.pi * at[BAND_PER_M] * off_m
        power = 1 / (1 + late * late)
        if at[ARRAY_RAD] > 0:
            other_m = math.hypot(strong[0] - look[RX_X], strong[1] - look[RX_Y])
            sines = _sine_of(point[0], point[1], range_m, look) - _sine_of(strong[0], strong[1], other_m, look)
            power *= math.cos(0.5 * at[ARRAY_RAD] * sines) ** 2
        height += power
        count += 1.0
    return share / total if total > 0 else 0.0


@compiled
def objects_among(found: FloatArray, looks: FloatArray, at: FloatArray, most: int) -> FloatArray:
    """Crests that the side lobes of stronger ones do not explain, strongest first.

    Side lobe and noise add in amplitude.

    Parameters
    ----------
    found : (crests, 3) array
        Changed: the evidence of crests that were looked at becomes 0.
    looks : (n, LOOK) array
    at : (SETTINGS,) array
    most : int

    Returns
    -------
    (objects, 3) array
    """
    kept = np.empty((most, 3))
    count = 0
    for _ in range(min(len(found), CANDIDATES)):
        best = 0
        for index in range(len(found)):
            if found[index, 2] > found[best, 2]:
                best = index
        crest, evidence = found[best], found[best, 2]
        free = True
        for other in range(count):
            free &= math.hypot(crest[0] - kept[other, 0], crest[1] - kept[other, 1]) >= at[WIDE_M]
        for other in range(count):
            lobe = at[MARGIN] * explained(crest, kept[other], looks, at) * kept[other, 2] if free else 0.0
            free &= math.sqrt(evidence) > math.sqrt(lobe) + math.sqrt(at[NOISE])
        if free:
            kept[count, 0], kept[count, 1], kept[count, 2] = crest[0], crest[1], evidence
            count += 1
        crest[2] = 0.0
        if count == most:
            break
    return kept[:count].copy()
