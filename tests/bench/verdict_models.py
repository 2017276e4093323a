"""Studies from models: what equal detectors, or ones that differ by a known amount, do on scenes that differ.

A scene has an effect that all detectors share, and each detector an effect of its own on it (the interaction). What is
found in a scene of some length is a mean over correlated frames. Lengths are equal, or spread over a factor of ten.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uwbbench.api import FloatArray

RATE_HZ = 10
"""Frames a second of the models."""


@dataclass(frozen=True)
class Model:
    """How scenes and detectors vary.

    Attributes
    ----------
    title : str
    level : float
        Expected share.
    scene, own : float
        Variance of the effect of a scene, and of a detector's own effect on it, as shares of ``level (1 - level)``, the
        most that there can be.
    correlation_s : float
        Over which single frames are correlated.
    unequal : bool
        Whether lengths are spread, from 5 s to 50 s; else 20 s each.
    failing : float
        Share of scenes in which a detector finds nothing.
    """

    title: str
    level: float
    scene: float
    own: float
    correlation_s: float
    unequal: bool
    failing: float = 0.0

    @property
    def expected(self) -> float:
        """Expected share, failing scenes included."""
        return self.level * (1 - self.failing)

    def lengths(self, shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
        """Frames of each scene."""
        seconds = np.exp(rng.uniform(np.log(5), np.log(50), shape)) if self.unequal else np.full(shape, 20.0)
        return np.round(seconds * RATE_HZ)

    def found(self, frames: FloatArray, kept: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Hits (..., detectors, scenes) on scenes with so many frames (..., scenes).

        Parameters
        ----------
        frames : (..., scenes) array
        kept : (detectors, 1) array
            Part of the expected share that each detector reaches: 1, or less for a worse one.
        rng : Generator
        """
        shape = (*frames.shape[:-1], len(kept), frames.shape[-1])
        shared = kept * rng.beta(*_beta(self.level, self.scene), frames.shape)[..., None, :]
        # a beta distribution about the scene's own level keeps the expectation where it is
        own = rng.beta(*_beta(np.clip(shared, 1e-6, 1 - 1e-6), self.own), shape)
        independent = np.maximum(frames / (1 + 2 * self.correlation_s * RATE_HZ), 1.0)[..., None, :]
        trials = np.maximum(np.round(independent), 1).astype(int) * np.ones(shape, int)
        hits = rng.binomial(trials, np.clip(own, 0, 1)) / trials
        if self.failing:
            hits = np.where(rng.random(shape) < self.failing, 0.0, hits)
        return np.asarray(hits * frames[..., None, :])

    def studies(self, count: int, scenes: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Hits and frames (studies, scenes) of one detector, and the share that is expected."""
        frames = self.lengths((count, scenes), rng)
        return self.found(frames, np.ones((1, 1)), rng)[:, 0], frames, np.asarray(self.expected)


def _beta(level: FloatArray | float, share: float) -> tuple[FloatArray, FloatArray]:
    """Parameters of a beta distribution with this mean, and this share of the largest variance."""
    size = 1 / share - 1
    return np.asarray(level * size), np.asarray((1 - np.asarray(level)) * size)


MODELS = (
    Model("F1 .85, scenes differ", 0.85, 0.05, 0.02, 0.2, unequal=False),
    Model("F1 .85, unequal lengths, 1 s", 0.85, 0.05, 0.05, 1.0, unequal=True),
    Model("F1 .97, unequal lengths, 3 s", 0.97, 0.1, 0.05, 3.0, unequal=True),
    Model("F1 .6, strong interaction", 0.6, 0.2, 0.2, 1.0, unequal=True),
    Model("F1 .9, a tenth of the scenes fails", 0.9, 0.05, 0.02, 0.2, unequal=False, failing=0.1),
)


def equal_board(
    model: Model, detectors: int, shape: tuple[int, int], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Hits and frames (boards, detectors, scenes) of detectors of the same expected share.

    Parameters
    ----------
    model : Model
    detectors : int
    shape : (boards, scenes)
    rng : Generator
    """
    frames = model.lengths(shape, rng)
    num = model.found(frames, np.ones((detectors, 1)), rng)
    return num, np.broadcast_to(frames[:, None], num.shape)


def shifted(
    model: Model, gap: float, shape: tuple[int, int], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Hits and frames (boards, 2, scenes) of two detectors, the second of which finds less by ``gap`` on average.

    Parameters
    ----------
    model : Model
    gap : float
    shape : (boards, scenes)
    rng : Generator
    """
    frames = model.lengths(shape, rng)
    num = model.found(frames, np.array([[1.0], [1 - gap / model.expected]]), rng)
    return num, np.broadcast_to(frames[:, None], num.shape)


def correlated(
    studies: int, captures: int, length_s: float, correlation_s: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Hits and frames (studies, captures x 4 blocks) of recordings whose frames are correlated, and the true shares.

    A frame is found where a normal process with an exponential correlation lies below a level of the recording.

    Parameters
    ----------
    studies, captures : int
    length_s, correlation_s : float
    rng : Generator
    """
    from scipy.special import ndtr

    frames = int(length_s * RATE_HZ)
    level = rng.normal(1.0, 0.3, (studies, captures))
    keep = np.exp(-1 / (correlation_s * RATE_HZ))
    state = rng.normal(size=(studies, captures))
    hits = np.empty((frames, studies, captures))
    for frame in range(frames):
        hits[frame] = state < level
        state = keep * state + np.sqrt(1 - keep**2) * rng.normal(size=state.shape)
    num = np.stack([part.sum(axis=0) for part in np.array_split(hits, 4)], axis=-1).reshape(studies, -1)
    den = np.stack([np.full((studies, captures), len(part)) for part in np.array_split(hits, 4)], axis=-1)
    return num, den.reshape(studies, -1).astype(float), ndtr(level).mean(axis=1)
