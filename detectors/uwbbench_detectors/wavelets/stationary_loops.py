"""Inner loops of the stationary wavelet transform."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray, compiled


@compiled
def transform(signal: FloatArray, low: FloatArray, high: FloatArray, bands: FloatArray) -> None:
    """Stationary wavelet transform of one signal, which is taken to repeat itself (algorithme a trous).

    At level j the approximation of the level before is filtered by both filters with 2^(j-1) - 1 zeros between their
    coefficients, and nothing is dropped: ``a_j[n] = sum_k low[k] a_(j-1)[n + 2^(j-1) (K / 2 - k)]``.

    Parameters
    ----------
    signal : (n,) array
        A multiple of 2^levels long.
    low, high : (K,) arrays
        Decomposition filters.
    bands : (n, 1 + levels) array
        Becomes the approximation of the last level, and the details from the last level to the first.
    """
    length, levels = len(signal), bands.shape[1] - 1
    approximation, coarser = np.empty(length), np.empty(length)
    for place in range(length):
        approximation[place] = signal[place]
    for level in range(levels):
        step = 1 << level
        for place in range(length):
            total = detail = 0.0
            for coefficient in range(len(low)):
                value = approximation[(place + step * (len(low) // 2 - coefficient)) % length]
                total += low[coefficient] * value
                detail += high[coefficient] * value
            coarser[place] = total
            bands[place, levels - level] = detail
        approximation, coarser = coarser, approximation
    for place in range(length):
        bands[place, 0] = approximation[place]


@compiled
def log_features(amplitude: FloatArray, floor: float, low: FloatArray, high: FloatArray, levels: int) -> FloatArray:
    """Logarithm of the magnitudes of each frame, and its wavelet bands.

    Parameters
    ----------
    amplitude : (frames, taps) array
    floor : float
        Added to each magnitude before the logarithm is taken.
    low, high : (K,) arrays
        Decomposition filters.
    levels : int

    Returns
    -------
    (frames, taps, 2 + levels) array
        Decimal logarithm, approximation, and details from the last level to the first.
    """
    frames, taps = amplitude.shape
    length = -(-taps >> levels) << levels
    before = (length - taps) // 2
    padded, bands = np.empty(length), np.empty((length, 1 + levels))
    features = np.empty((frames, taps, 2 + levels))
    for frame in range(frames):
        for place in range(length):
            tap = min(max(place - before, 0), taps - 1)
            padded[place] = math.log10(amplitude[frame, tap] + floor)
        transform(padded, low, high, bands)
        for tap in range(taps):
            features[frame, tap, 0] = padded[before + tap]
            for band in range(1 + levels):
                features[frame, tap, 1 + band] = bands[before + tap, band]
    return features
