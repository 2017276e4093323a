"""Removal of the dominant shapes of a sliding window of frames."""

from __future__ import annotations

import math
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import ComplexArray, ConfigError, FloatArray, IntArray, Radar
from uwbbench_detectors.clutter.background import ClutterRemoval
from uwbbench_detectors.clutter.window import WindowParams

EPSILON = float(np.finfo(np.float64).eps)
TOLERANCE = 1e-10
"""Largest error of a cleaned sample, over the frame's largest one, that the fast way of decomposing may leave."""


class SvdClutterParams(WindowParams):
    """Window and rank of the clutter."""

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
        least = self.least_frames
        if self.largest_rank >= least:
            name = "maximum_rank" if self.rank is None else "rank"
            raise ValueError(
                f"'{name}' is {self.largest_rank}, which removes all of a window of {least} frames; "
                "it must be smaller than 'window_frames'"
            )
        return self


class SvdClutter(ClutterRemoval[SvdClutterParams]):
    """Frame minus its projection on the dominant shapes of the last frames.

    The window X (frames, taps) holds the last frames, the current one included. With
    ``X = U S V^H`` a frame loses its part in the span of the first ``rank`` columns of V; unlike a mean this follows
    gain and phase of the clutter from frame to frame (Sabushimike et al., Sensors 16(9):1409, 2016, compare low-rank
    rejection with averages). Frames come out as zero until the window holds one frame more than the rank, or than
    ``maximum_rank`` where energy decides. What stands still vanishes, and an echo brighter than the direct path
    becomes the first shape itself. Frames whose delay wanders must be aligned first.

    With a fixed ``rank`` the shapes of the frame before are refined on the small matrix ``X X^H``, of which a new frame
    replaces one row and one column, wherever a bound shows that no cleaned sample comes out wrong by more than 1e-10 of
    the frame's largest one (:func:`uwbbench_detectors.clutter.gram.refine`). Elsewhere, for the first window and where
    ``energy`` chooses the rank, X itself is decomposed (:func:`dominant_shapes`). Which of the two is taken depends on
    the frames so far alone, not on how they are cut into blocks.

    Raises
    ------
    ConfigError
        From ``open``, if the rank is not smaller than the number of taps.
    """

    @property
    def every_nth(self) -> bool:
        """Whether some frames are cleaned with the shapes of an earlier one."""
        return self.params.every != 1

    def open(self, radar: Radar) -> None:
        """Start with an empty window."""
        super().open(radar)
        if self.params.largest_rank >= radar.taps:
            shapes = self.params.largest_rank
            raise ConfigError(f"clutter.svd: removing {shapes} shapes leaves nothing of frames of {radar.taps} taps")
        from uwbbench_detectors.clutter import gram as clutter_gram

        self._products = clutter_gram
        frames = self.params.frames_for(radar)
        self._window = np.zeros((frames, radar.taps), dtype=np.complex128)
        self._turned = np.zeros((radar.taps, frames), dtype=np.complex128)
        self._gram = np.zeros((frames, frames), dtype=np.complex128)
        self._count = 0
        self._shapes = np.zeros((0, radar.taps), dtype=np.complex128)
        self._period: int | None = None

    def remove(self, samples: ComplexArray, index: IntArray) -> ComplexArray:
        """Frames minus their projections; zeros while the window is too short."""
        residue = np.zeros_like(samples)
        operations = 4.0 * sum(self._window.shape)
        for row, (frame, period) in enumerate(zip(samples, (index // self.params.every).tolist(), strict=True)):
            # The order of rows does not change V, so the oldest row is simply overwritten.
            slot = self._count % len(self._window)
            self._products.enter_frame(frame, slot, self._window, self._turned, self._gram)
            self._count += 1
            if self._count <= self.params.largest_rank:
                continue
            if period != self._period:
                self._renew_shapes()
                self._period = period
            residue[row] = self.loops.less_projection(frame, self._shapes, operations)
        return residue

    def flush(self) -> None:
        """Say so if the capture ended before the window was full."""
        if 0 < self._count < len(self._window):
            self.note(
                f"clutter.svd: the capture has only {self._count} usable frames for a window of {len(self._window)}"
            )

    def _renew_shapes(self) -> None:
        """Orthonormal shapes (rank, taps) that are clutter, of the window as it is now."""
        if len(self._shapes) == self.params.rank:
            angle = TOLERANCE / math.sqrt(self._shapes.shape[1])
            if self._products.refine(self._gram, self._window, self._turned, self._shapes, angle):
                return
        singular, shapes = dominant_shapes(self._window[: self._count], self.params.largest_rank)
        if self.params.rank is None:
            energy = np.cumsum(singular**2)
            shapes = shapes[:, : int(np.searchsorted(energy, self.params.energy * energy[-1])) + 1]
        self._shapes = np.ascontiguousarray(shapes.T)


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
