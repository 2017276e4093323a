"""Samples between the taps of a band-limited response."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import compiled, inlined

Float32Array = NDArray[np.float32]

LENGTH = 12
"""Samples that one in between is made of."""

PHASES = 256
"""Places between two taps that are told apart."""

PAD = 24
"""Zeros before and behind a response, so that it can be moved by half as many taps."""

BETA = 6.0
"""Shape of the Kaiser window: what is cut off the sinc leaves an error of -60 dB, below the noise of any frame here."""


def between_table() -> Float32Array:
    """Windowed sinc for each of the places between two taps, each row of sum 1.

    ``h(k) = sinc(k - f) I0(beta sqrt(1 - ((k - f) / 6)^2)) / I0(beta)`` at the twelve samples around, for the fraction
    f = 0, 1/256, .., 1. A response sampled at twice its bandwidth, as by radios of 499.2 MHz with 998.4 MHz, leaves
    half the band to the flanks of the window.

    Returns
    -------
    (257, 12) array
    """
    fraction = np.arange(PHASES + 1)[:, None] / PHASES
    off = np.arange(LENGTH) - (LENGTH // 2 - 1) - fraction
    window = np.i0(BETA * np.sqrt(np.clip(1 - (off / (LENGTH / 2)) ** 2, 0, 1))) / np.i0(BETA)
    table = np.sinc(off) * window
    return np.asarray(table / table.sum(axis=1, keepdims=True), np.float32)


@compiled
def moved(padded: Any, tap: float, table: Any, start: int, stop: int, made: Any) -> None:
    """Samples of a response moved so that what was at ``tap`` comes to tap 0.

    Parameters
    ----------
    padded : (2, taps + 2 PAD) float32 array
        Real and imaginary parts behind PAD zeros, and before as many.
    tap : float
        Between -12 and 12.
    table : (PHASES + 1, LENGTH) float32 array
    start, stop : int
        Taps that are made.
    made : (2, taps) float32 array
        Written from ``start`` to ``stop``.
    """
    whole = math.floor(tap)
    phase = int((tap - whole) * PHASES + 0.5)
    first = whole - (LENGTH // 2 - 1) + PAD
    for part in range(2):
        source, target = padded[part], made[part]
        for place in range(start, stop):
            target[place] = np.float32(0)
        for term in range(LENGTH):
            weight, at = table[phase, term], first + term
            for place in range(start, stop):
                target[place] += weight * source[at + place]


@inlined
def power_between(padded: Any, tap: float, table: Any) -> float:
    """Squared magnitude of a response between its taps.

    Parameters
    ----------
    padded : (2, taps + 2 PAD) float32 array
        As in :func:`moved`.
    tap : float
    table : (PHASES + 1, LENGTH) float32 array
    """
    whole = math.floor(tap)
    phase = int((tap - whole) * PHASES + 0.5)
    first = whole - (LENGTH // 2 - 1) + PAD
    real = imaginary = np.float32(0)
    for term in range(LENGTH):
        weight = table[phase, term]
        real += weight * padded[0, first + term]
        imaginary += weight * padded[1, first + term]
    return float(real * real + imaginary * imaginary)
