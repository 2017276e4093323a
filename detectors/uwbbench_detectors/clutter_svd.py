"""Removal of the dominant shapes of a sliding window of frames."""

from __future__ import annotations

from typing import Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import ComplexArray, ConfigError, FloatArray, IntArray, Params, Radar
from uwbbench_detectors.clutter import EPSILON, ClutterRemoval, without_rounding


class SvdClutterParams(Params):
    """Window and rank of the clutter."""

    window_frames: int = Field(64, ge=2, description="Frames of the window, the current one included.")
    rank: int | None = Field(1, ge=1, description="Dominant shapes removed; null: as many as hold 'energy'.")
    energy: float = Field(0.95, gt=0, lt=1, description="Share of the window's energy to remove where rank is null.")
    maximum_rank: int = Field(3, ge=1, description="Limit of the rank where it is chosen by energy.")
    every: int = Field(1, ge=1, description="Frames between two decompositions, counted along the capture.")

    @property
    def largest_rank(self) -> int:
        """Most shapes that may be removed."""
        return self.maximum_rank if self.rank is None else self.rank

    @model_validator(mode="after")
    def _window_exceeds_rank(self) -> Self:
        if self.largest_rank >= self.window_frames:
            name = "maximum_rank" if self.rank is None else "rank"
            raise ValueError(
                f"'{name}' is {self.largest_rank}, which removes all of a window of {self.window_frames} frames; "
                "it must be smaller than 'window_frames'"
            )
        return self


class SvdClutter(ClutterRemoval[SvdClutterParams]):
    """Frame minus its projection on the dominant shapes of the last frames.

    The window X (frames, taps) holds the last ``window_frames`` frames, the current one included. With
    ``X = U S V^H`` a frame loses its part in the span of the first ``rank`` columns of V; unlike a mean this follows
    gain and phase of the clutter from frame to frame (Sabushimike et al., Sensors 16(9):1409, 2016, compare low-rank
    rejection with averages). Frames come out as zero until the window holds one frame more than the rank, or than
    ``maximum_rank`` where energy decides. What stands still vanishes, and an echo brighter than the direct path
    becomes the first shape itself. Frames whose delay wanders must be aligned first.

    Raises
    ------
    ConfigError
        From ``open``, if the rank is not smaller than the number of taps.
    """

    def open(self, radar: Radar) -> None:
        """Start with an empty window."""
        super().open(radar)
        if self.params.largest_rank >= radar.taps:
            shapes = self.params.largest_rank
            raise ConfigError(f"clutter.svd: removing {shapes} shapes leaves nothing of frames of {radar.taps} taps")
        self._window = np.zeros((self.params.window_frames, radar.taps), dtype=np.complex128)
        self._count = 0
        self._shapes: ComplexArray | None = None
        self._period = -1

    def remove(self, samples: ComplexArray, index: IntArray) -> ComplexArray:
        """Frames minus their projections; zeros while the window is too short."""
        residue = np.zeros_like(samples)
        for row, frame in enumerate(samples):
            # The order of rows does not change V, so the oldest row is simply overwritten.
            self._window[self._count % len(self._window)] = frame
            self._count += 1
            if self._count <= self.params.largest_rank:
                continue
            period = int(index[row]) // self.params.every
            if self._shapes is None or period != self._period:
                self._shapes = self._dominant(self._window[: self._count])
                self._period = period
            residue[row] = frame - (frame @ self._shapes) @ self._shapes.conj().T
        return without_rounding(residue, samples, 4 * sum(self._window.shape))

    def _dominant(self, window: ComplexArray) -> ComplexArray:
        """Orthonormal shapes (taps, rank) that are clutter."""
        singular, shapes = dominant_shapes(window, self.params.largest_rank)
        if self.params.rank is not None:
            return shapes
        energy = np.cumsum(singular**2)
        return shapes[:, : int(np.searchsorted(energy, self.params.energy * energy[-1])) + 1]


def dominant_shapes(window: ComplexArray, most: int) -> tuple[FloatArray, ComplexArray]:
    """Singular values of a window of frames and its leading right singular vectors.

    A QR decomposition first leaves a small square matrix to decompose. The product of the window with its own
    conjugate would be smaller still and faster, but loses singular values below 1e-8 of the largest.

    Parameters
    ----------
    window : (frames, taps) complex array
        Not all zero.
    most : int
        Vectors wanted.

    Returns
    -------
    singular : (min(frames, taps),) array
        Descending, in units of the largest sample.
    shapes : (taps, k) complex array
        Orthonormal columns, ``k <= most``: the vectors of a rank-deficient window's null space are left out, since
        they are arbitrary.
    """
    scaled = window / np.abs(window).max()
    frames, taps = window.shape
    wide = frames < taps
    _, singular, adjoint = np.linalg.svd(np.linalg.qr(scaled.conj().T if wide else scaled, mode="r"))
    solid = singular[:most] > max(frames, taps) * EPSILON * singular[0]
    vectors = adjoint[: len(solid)][solid].conj().T
    if wide:  # so far left singular vectors: X^H u / s is the right one, orthogonal up to rounding
        vectors = np.linalg.qr(scaled.conj().T @ (vectors / singular[: len(solid)][solid]))[0]
    return singular, vectors
