"""Hard backgrounds: windows of equal frames, and clutter that towers over the target."""

from __future__ import annotations

import dataclasses

import numpy as np

from uwbbench.api import ComplexArray, Evidence, StagesOnTrial, Violation, hard_case

TAPS = StagesOnTrial.radar.taps


LOUDNESS = (1e6, 1e9, 1e12)


def _waves(length: int, count: int) -> ComplexArray:
    """Orthonormal columns (length, count): complex waves of the lowest frequencies."""
    place = np.arange(length)[:, None] * np.arange(count)
    return np.asarray(np.exp(2j * np.pi * place / length) / np.sqrt(length))


@hard_case("reject")
def rank_deficient_window(subject: StagesOnTrial) -> Evidence:
    """A window of one frame over and over, at any gain and phase, leaves nothing but zeros behind low-rank removal.

    Singular values beyond the first are rounding errors and their vectors arbitrary; what rounding leaves of the
    frames must not look like a signal.
    """
    stage = subject.stage("clutter.svd")
    rng = np.random.default_rng(5)
    shape = rng.normal(size=TAPS) + 1j * rng.normal(size=TAPS)
    frames = stage.params.frames_for(StagesOnTrial.radar) + 20
    gain = rng.uniform(0.5, 2.0, frames) * np.exp(2j * np.pi * rng.uniform(size=frames))
    left = subject.through(stage, subject.block_of(gain[:, None] * shape)).frames.preamble
    if np.any(left):
        raise Violation(f"{np.abs(left).max():.2g} is left of frames of amplitude 1")
    return Evidence("zeros", error_ulp=0.0)


@hard_case("equal")
def ill_conditioned_window(subject: StagesOnTrial) -> Evidence:
    """Behind clutter 120, 180 and 240 dB above it, the target is left to 64 units in the last place of the clutter.

    Clutter and target are orthogonal waves over the taps with orthogonal courses over the frames, so that they are the
    singular vectors themselves and the target alone is what should be left. A Gram matrix, the window times its own
    conjugate, squares the condition: singular values below 1e-8 of the largest are lost in it, half of all digits. It
    may be used only where no singular value that matters lies lower, for one dominant shape whose residue is not
    asked for more than 1e-8 of the clutter.
    """
    worst = 0.0
    rank = subject.stage("clutter.svd").params.largest_rank
    window = subject.stage("clutter.svd").params.frames_for(StagesOnTrial.radar)
    if window <= rank + 1:
        raise Violation(f"a window of {window} frames cannot hold {rank} shapes of clutter and a target")
    radar = dataclasses.replace(StagesOnTrial.radar, noise_taps=0)
    courses, shapes = _waves(window, rank + 1), _waves(TAPS, rank + 1)
    for loudness in LOUDNESS:
        heights = np.append(loudness * 2.0 ** np.arange(rank), 1.0)
        left = subject.through(
            subject.stage("clutter.svd", radar, rank=rank), subject.block_of((courses * heights) @ shapes.T)
        )
        target = courses[-1, -1] * shapes[:, -1]
        error = np.abs(left.frames.preamble[-1] - target).max()
        unit = np.spacing(np.abs((courses[-1] * heights) @ shapes.T).max())
        worst = max(worst, float(error / unit))
    if not worst <= 64:
        raise Violation(f"the target is {worst:.3g} units of the clutter off")
    return Evidence("target left behind clutter of 1e6, 1e9 and 1e12 times its height", error_ulp=worst)


@hard_case("equal")
def mean_after_a_loud_frame(subject: StagesOnTrial) -> Evidence:
    """Once a frame 200 dB above the others has left the window, the running mean is what it would be without it.

    Adding frames to a running sum and taking them away again leaves the loud one's rounding error for good. Within 64
    units in the last place of the quiet frames.
    """
    stage = subject.stage("clutter.mean")
    window = stage.params.frames_for(StagesOnTrial.radar)
    if window is None:
        return Evidence("the mean is over all frames so far, and never forgets")
    rng = np.random.default_rng(8)
    quiet = rng.normal(size=(3 * window, TAPS)) + 1j * rng.normal(size=(3 * window, TAPS))
    loud = quiet.copy()
    loud[3] *= 1e10
    one = subject.through(stage, subject.block_of(loud)).frames.preamble[2 * window :]
    other = subject.through(subject.stage("clutter.mean"), subject.block_of(quiet)).frames.preamble[2 * window :]
    error_ulp = float(np.abs(one - other).max() / np.spacing(np.abs(quiet).max()))
    if not error_ulp <= 64:
        raise Violation(f"means are {error_ulp:.3g} units off")
    return Evidence(f"{window} frames later", error_ulp=error_ulp)
