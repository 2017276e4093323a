"""Removal of what windows of frames have in common, by robust principal component analysis."""

from __future__ import annotations

import math
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Block, ComplexArray, IntArray, Radar
from uwbbench_detectors.clutter.background import LEAST_FRAMES, ClutterRemoval
from uwbbench_detectors.clutter.window import WindowParams

TOLERANCE = 1e-7
"""Largest part of a window, in the norm of Frobenius, by which the two parts may miss it."""
MOST_ROUNDS = 200
GROWTH = 1e7
"""Of the penalty, at most."""


class RobustClutterParams(WindowParams):
    """Window, and how its two parts are weighed."""

    window_frames: int = Field(64, ge=LEAST_FRAMES, description="Frames of the window.")
    every: int = Field(
        16,
        ge=1,
        description="Frames from one window to the next, which come out together: a frame waits for at most so many "
        "less one. A decomposition takes some twenty to forty milliseconds.",
    )
    weight: float = Field(
        1.0,
        gt=0,
        description="Of the sparse part: lambda in units of 1 / sqrt(max(frames, taps)). Below 1 what moves slowly "
        "stays in sight, and more noise with it.",
    )
    rho: float = Field(1.5, gt=1, le=10, description="By which the penalty grows from round to round.")

    @model_validator(mode="after")
    def _windows_overlap(self) -> Self:
        least = self.least_frames
        if self.every > least:
            raise ValueError(f"'every' is {self.every}, but a window of {least} frames must hold all of them")
        return self


class RobustClutter(ClutterRemoval[RobustClutterParams]):
    """Sparse part of overlapping windows of frames, whose low-rank part is the clutter.

    The window X (frames, taps) is split into ``X = L + S`` of least ``|L|_* + lambda |S|_1``
    (:func:`robust_parts`). What stands still, in any shape and with any gain of its own in each frame, has low rank;
    what moves fills few taps of few frames. Unlike a projection on a fixed number of shapes this needs no rank, and an
    echo brighter than the clutter does not become clutter. Most taps of what comes out are exactly zero: the noise of
    its frames is no measure of anything.

    A window advances by ``every`` frames, whose rows of S come out together, all of the first window with it: frames
    are held back until then, which the scoring ``latest`` counts as delay. A capture that ends before the first window
    is full is split as it is, and the results say so; fewer than 16 frames come out as zeros.

    Of clutter that fills few taps, such as the direct path alone, the window must have at least as many frames as a
    frame has taps; else it is sparse itself, and stays. Frames whose delay wanders must be aligned first.

    Reconstructed after Sabushimike et al., Sensors 16(9):1409, 2016, who reject clutter so in overlapping windows;
    their lengths are not known here.
    """

    fidelity = "reconstruction"

    @property
    def every_nth(self) -> bool:
        """Whether frames come out in groups."""
        return self.params.every != 1

    @property
    def whole_windows(self) -> bool:
        """Whether what comes out of a frame hangs on all of its window: those behind it, too."""
        return True

    def open(self, radar: Radar) -> None:
        """Start with an empty window."""
        super().open(radar)
        self._frames = self.params.frames_for(radar)
        self._window = np.zeros((0, radar.taps), dtype=np.complex128)
        self._held: Block | None = None  # frames that wait, those of the window among them marked
        self._marked = np.zeros(0, bool)
        self._split_once = False

    def step(self, block: Block) -> Block:
        """Block of the frames that are ready, cleaned."""
        usable = self.loops.usable_frames(
            np.ascontiguousarray(block.frames.preamble, dtype=np.complex128), block.frames.valid
        )
        self._held = block if self._held is None else Block.join([self._held, block])
        self._marked = np.concatenate([self._marked, usable])
        marked = np.flatnonzero(self._marked)
        groups, taken = [], 0
        while taken + self._due <= len(marked):
            groups.append(marked[taken : taken + self._due])
            taken += self._due
            self._split_once = True
        # What no window needs goes out at once, so that a radar without a signal fills no memory.
        return self._hand_out(groups, int(marked[taken]) if taken < len(marked) else len(self._marked))

    def flush(self) -> Block | None:
        """The last frames, split with those before them."""
        if self._held is None:
            return None
        left = np.flatnonzero(self._marked)
        if not self._split_once and len(left) < self._frames:
            self.note(
                f"clutter.rpca: the capture has only {len(left)} usable frames for a window of {self._frames}"
                + ("; they yield nothing" if len(left) < LEAST_FRAMES else "")
            )
        return self._hand_out([left] if len(left) else [], len(self._held.frames))

    @property
    def _due(self) -> int:
        """Usable frames that the next decomposition waits for."""
        return self.params.every if self._split_once else self._frames

    def _hand_out(self, groups: list[IntArray], stop: int) -> Block:
        """First held frames, cleaned group by group, the window moving on with each; the others stay."""
        held = self._held
        assert held is not None  # noqa: S101 - set by step, without which nothing is flushed
        samples = np.asarray(held.frames.preamble, dtype=np.complex128)
        cleaned = np.zeros((stop, samples.shape[1]), dtype=np.complex128)
        for group in groups:
            self._window = np.concatenate([self._window, samples[group]])[-self._frames :]
            if len(self._window) >= LEAST_FRAMES:
                cleaned[group] = robust_parts(self._window, self.params.weight, self.params.rho)[1][-len(group) :]
        ready = held.cut(0, stop)
        self._held, self._marked = held.cut(stop, len(held.frames)), self._marked[stop:]
        return ready.replace(frames=ready.frames.with_preamble(cleaned))


def robust_parts(window: ComplexArray, weight: float = 1.0, rho: float = 1.5) -> tuple[ComplexArray, ComplexArray]:
    """Low-rank and sparse part of a window.

    Minimises ``|L|_* + lambda |S|_1`` subject to ``L + S = X`` by the inexact method of augmented Lagrange multipliers.
    Round by round, with ``D_t`` shrinking singular values by t and ``H_t`` magnitudes:
    ``L = D_(1/mu)(X - S + Y/mu)``, ``S = H_(lambda/mu)(X - L + Y/mu)``, ``Y += mu (X - L - S)``, ``mu *= rho``, from
    ``mu = 1.25 / |X|_2`` and ``Y = X / max(|X|_2, |X|_max / lambda)``, until the parts miss the window by less than
    1e-7 of its norm. Singular values come from the product of the smaller side with itself: those that it would lose,
    below 1e-8 of the largest, lie below every threshold that is asked for. What is left within 1e-7 becomes zero.

    Parameters
    ----------
    window : (frames, taps) complex array
    weight : float
        lambda in units of ``1 / sqrt(max(frames, taps))`` (Candes, Li, Ma, Wright, J. ACM 58(3), 2011).
    rho : float
        Above 1.

    Returns
    -------
    low_rank, sparse : (frames, taps) complex arrays

    References
    ----------
    Lin, Chen, Ma, "The Augmented Lagrange Multiplier Method for Exact Recovery of Corrupted Low-Rank Matrices",
    arXiv:1009.5055, 2010, algorithm 5.
    """
    height = np.abs(window).max(initial=0.0)
    if height == 0:
        return window.copy(), np.zeros_like(window)
    scaled = window / height
    balance = weight / math.sqrt(max(scaled.shape))
    norm, spectral = float(np.linalg.norm(scaled)), float(np.linalg.norm(scaled, 2))
    penalty = 1.25 / spectral
    most = penalty * GROWTH
    multiplier = scaled / max(spectral, 1 / balance)
    sparse = np.zeros_like(scaled)
    for _ in range(MOST_ROUNDS):
        shift = multiplier / penalty
        low_rank = _shrunk_values(scaled - sparse + shift, 1 / penalty)
        sparse = _shrunk_magnitudes(scaled - low_rank + shift, balance / penalty)
        missing = scaled - low_rank - sparse
        multiplier = multiplier + penalty * missing
        if np.linalg.norm(missing) <= TOLERANCE * norm:
            break
        penalty = min(penalty * rho, most)
    sparse[np.abs(sparse) <= TOLERANCE * norm] = 0
    return low_rank * height, sparse * height


def _shrunk_values(matrix: ComplexArray, threshold: float) -> ComplexArray:
    """Matrix whose singular values are less by the threshold, and at least 0."""
    wide = matrix.shape[0] <= matrix.shape[1]
    squares, vectors = np.linalg.eigh(matrix @ matrix.conj().T if wide else matrix.conj().T @ matrix)
    values = np.sqrt(np.maximum(squares, 0))
    kept = values > threshold
    vectors = vectors[:, kept]
    shares = vectors * ((values[kept] - threshold) / values[kept])
    return np.asarray(shares @ (vectors.conj().T @ matrix) if wide else (matrix @ shares) @ vectors.conj().T)


def _shrunk_magnitudes(matrix: ComplexArray, threshold: float) -> ComplexArray:
    """Matrix whose entries are less by the threshold in magnitude, and at least 0."""
    magnitude = np.abs(matrix)
    share = np.zeros(matrix.shape)
    np.divide(magnitude - threshold, magnitude, out=share, where=magnitude > threshold)
    return np.asarray(matrix * share)
