"""Inner loop of the alignment: the crest of each frame's direct path, and the spectrum turned to it."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import BoolArray, ComplexArray, FloatArray, compiled
from uwbbench_detectors.compiled.rank import median

ROOT_2 = 1.4142135623730951 * (1 + 1e-9)
ROOT_LN_2 = math.sqrt(math.log(2))
TINY = float(np.finfo(np.float64).tiny)


@compiled
def vertex_shift(before: float, crest: float, after: float) -> float:
    """Distance from a crest to the vertex of the parabola through the logarithms of three magnitudes.

    What :func:`uwbbench_detectors.peaks.interpolation.vertex_shift` gives for one crest.

    Parameters
    ----------
    before, crest, after : float
        Magnitudes at consecutive points, not negative.

    Returns
    -------
    float
        Points, between -0.5 and 0.5; 0 where the crest is zero or the parabola opens upwards.
    """
    if not crest > 0:
        return 0.0
    left, right = (before - crest) / crest, (after - crest) / crest
    if left > -1 and right > -1:
        left, right = math.log1p(left), math.log1p(right)
    if not left + right < 0:
        return 0.0
    return min(max(0.5 * (left - right) / (left + right), -0.5), 0.5)


@compiled
def highest(real: FloatArray, imaginary: FloatArray) -> int:
    """Place of the largest magnitude, the first of equal ones.

    ``hypot``, which neither over- nor underflows, is taken only where it may exceed the largest so far.
    """
    largest, crest = 0.0, 0
    for place in range(len(real)):
        if max(abs(real[place]), abs(imaginary[place])) * ROOT_2 > largest:
            height = math.hypot(real[place], imaginary[place])
            if height > largest:
                largest, crest = height, place
    return crest


@compiled
def noise_of(frame: ComplexArray, leading: int) -> float:
    """Root mean square of the leading samples; without any, from the median magnitude of Rayleigh noise."""
    heights = np.empty(leading if leading else len(frame))
    for tap in range(len(heights)):
        heights[tap] = math.sqrt(frame[tap].real ** 2 + frame[tap].imag ** 2)
    if not leading:
        return median(heights) / ROOT_LN_2
    largest = total = 0.0
    for height in heights:
        largest = max(largest, height)
    for height in heights:
        total += (height / largest) ** 2 if largest > 0 else 0.0
    return float(largest * math.sqrt(total / leading))


@compiled
def turned_spectra(
    samples: ComplexArray,
    spectra: ComplexArray,
    valid: BoolArray,
    fine: FloatArray,
    grid: FloatArray,
    turn: FloatArray,
    back: ComplexArray,
    leading: int,
    ratio: float,
) -> tuple[ComplexArray, FloatArray, BoolArray]:
    """Spectra of the aligned frames.

    Parameters
    ----------
    samples, spectra : (frames, taps) arrays
        Frames and their discrete Fourier transforms.
    valid : (frames,) array
    fine : (2, taps // 2 + 1, points) array
        Real and imaginary part of the inverse transform from each frequency that is not the negative of another one to
        the points of a fine grid.
    grid : (points,) array
        The taps of those points.
    turn : (taps // 2 + 1,) array
        Radians that each of those frequencies turns over one tap.
    back : (taps,) array
        Transfer function of a delay to the tap where the crest goes.
    leading : int
        Samples of noise alone at the start of a frame.
    ratio : float
        Least magnitude of the direct path over the noise.

    Returns
    -------
    aligned : (frames, taps) array
        Zero for frames that were refused.
    crest_tap : (frames,) array
    clear : (frames,) bool array
        False for invalid and refused frames.
    """
    frames, taps = spectra.shape
    points = len(grid)
    aligned = np.empty((frames, taps), np.complex128)
    crest_tap, clear = np.empty(frames), np.zeros(frames, np.bool_)
    real, imaginary = np.empty(points), np.empty(points)
    for frame in range(frames):
        real[:] = 0
        imaginary[:] = 0
        for frequency in range(taps // 2 + 1):
            # h e^(ia) + g e^(-ia) = (h + g) cos a + i (h - g) sin a, with g at the negative frequency.
            even = odd = spectra[frame, frequency]
            if 0 < 2 * frequency < taps:
                even, odd = even + spectra[frame, taps - frequency], odd - spectra[frame, taps - frequency]
            cosine, sine = fine[0, frequency], fine[1, frequency]
            for point in range(points):
                real[point] += even.real * cosine[point] - odd.imag * sine[point]
                imaginary[point] += even.imag * cosine[point] + odd.real * sine[point]
        peak = highest(real, imaginary)
        crest_tap[frame] = grid[peak]
        if 0 < peak < points - 1:
            before = math.hypot(real[peak - 1], imaginary[peak - 1])
            after = math.hypot(real[peak + 1], imaginary[peak + 1])
            at_peak = math.hypot(real[peak], imaginary[peak])
            crest_tap[frame] += vertex_shift(before, at_peak, after) * (grid[1] - grid[0])
        crest = 0j
        turned = aligned[frame]
        for frequency in range(taps // 2 + 1):
            angle = turn[frequency] * crest_tap[frame]
            turned[frequency] = complex(math.cos(angle), math.sin(angle))
            if 0 < 2 * frequency < taps:
                turned[taps - frequency] = turned[frequency].conjugate()
        for frequency in range(taps):
            turned[frequency] *= spectra[frame, frequency]
            crest += turned[frequency]
        crest /= taps
        height = math.hypot(crest.real, crest.imag)
        # The reciprocal of a denormal number overflows.
        clear[frame] = valid[frame] and height >= TINY and height >= ratio * noise_of(samples[frame], leading)
        if not clear[frame]:
            turned[:] = 0
            continue
        unit = 1 / crest
        for frequency in range(taps):
            turned[frequency] *= unit * back[frequency]
    return aligned, crest_tap, clear
