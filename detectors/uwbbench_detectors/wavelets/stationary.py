"""Features of taps by a stationary wavelet transform."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from uwbbench.api import Block, ConfigError, FloatArray, Params, Radar, Stage, ports

Wavelet = Literal["haar", "db2", "db4"]

_ROOT = math.sqrt(3)
SCALING: Mapping[Wavelet, tuple[float, ...]] = {
    "haar": (1 / math.sqrt(2), 1 / math.sqrt(2)),
    "db2": tuple(one / (4 * math.sqrt(2)) for one in (1 + _ROOT, 3 + _ROOT, 3 - _ROOT, 1 - _ROOT)),
    "db4": (
        0.2303778133088965,
        0.7148465705529157,
        0.6308807679298589,
        -0.027983769416859854,
        -0.18703481171909309,
        0.030841381835560764,
        0.0328830116668852,
        -0.010597401785069032,
    ),
}
"""Scaling filters of Daubechies' orthogonal wavelets."""


def filters_of(wavelet: Wavelet) -> tuple[FloatArray, FloatArray]:
    """Decomposition filters of a wavelet: low-pass and high-pass.

    Parameters
    ----------
    wavelet : {"haar", "db2", "db4"}

    Returns
    -------
    (K,) array, (K,) array
    """
    scaling = np.array(SCALING[wavelet])
    signs = np.where(np.arange(len(scaling)) % 2, 1.0, -1.0)
    return scaling[::-1].copy(), signs * scaling


class StationaryParams(Params):
    """Which wavelet, and how deep."""

    wavelet: Wavelet = Field("db4", description="Daubechies' wavelets of one, two and four vanishing moments.")
    levels: int = Field(3, ge=1, le=8, description="Levels; each looks at twice the taps of the one before.")
    floor: float = Field(
        1e-4,
        gt=0,
        description="Added to magnitudes before their logarithm is taken, in their units: behind 'align' the crest of "
        "the direct path is 1.",
    )


class StationaryWavelet(Stage[StationaryParams]):
    """Features of each tap: the logarithm of its magnitude, and the bands of its stationary wavelet transform.

    A stationary (undecimated) transform has as many coefficients at every level as there are taps, so that an echo
    that moves by a tap moves its coefficients by a tap. Frames are lengthened by their first and last tap to a multiple
    of 2^levels, and taken to repeat themselves beyond. The features are, in order: log10(|h| + floor), the
    approximation of the last level, the details from the last level to the first.

    Raises
    ------
    ConfigError
        From ``open``, if a frame is shorter than the coarsest filter.

    References
    ----------
    G. P. Nason and B. W. Silverman, "The stationary wavelet transform and some statistical applications", 1995;
    I. Daubechies, Comm. Pure and Applied Mathematics 41(7), 1988 (filters).
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("features")

    def open(self, radar: Radar) -> None:
        """Prepare the filters."""
        super().open(radar)
        from uwbbench_detectors.wavelets import stationary_loops

        p = self.params
        self._filters = filters_of(p.wavelet)
        if radar.taps < 1 << p.levels:
            raise ConfigError(
                f"wavelet.stationary: {p.levels} levels need {1 << p.levels} taps, but a frame has {radar.taps}; "
                "lower 'levels'"
            )
        self._log_features = stationary_loops.log_features

    def step(self, block: Block) -> Block:
        """Block with ``features``."""
        p = self.params
        return block.replace(features=self._log_features(block.frames.amplitude, p.floor, *self._filters, p.levels))
