"""Random patterns over the ground: the same wherever and whenever somebody passes, as interference at rest is."""

from __future__ import annotations

import zlib

import numpy as np

from uwbbench.api import ComplexArray, FloatArray, SceneObject, View, rotate_z

_WAVES = 16
LARGEST = float(np.sqrt(_WAVES))
"""Largest magnitude of a pattern, where all of its waves meet in phase."""


def speckle(body: SceneObject, view: View, part: str, length_m: float, seed: int = 0) -> ComplexArray:
    """Complex pattern (frames,) around an object, at the places of the receiver: mean 0, mean power 1.

    A sum of plane waves whose wave numbers are normally distributed, so that two places ``d`` apart are correlated by
    ``exp(-d^2 / (2 length^2))`` (Shinozuka and Deodatis, 1991, spectral representation). The waves are drawn from the
    object's name and the carrier frequency: the pattern turns with the object and is the same in all runs.

    Parameters
    ----------
    body : SceneObject
    view : View
        Frames and carrier frequency.
    part : str
        What the pattern is of: each part has its own.
    length_m : float
        Distance over which the pattern becomes another.
    seed : int
        Another pattern for the same part.
    """
    rng = drawn_for(body, view, part, seed)
    wave_number = rng.normal(size=(2, _WAVES)) / length_m
    phase = rng.uniform(0, 2 * np.pi, _WAVES)
    place_m = rotate_z(view.receiver_m - body.center_m, -body.yaw_rad)[:, :2]
    return np.asarray(np.exp(1j * (place_m @ wave_number + phase)).sum(axis=1) / np.sqrt(_WAVES))


def swing(body: SceneObject, view: View, part: str, length_m: float, seed: int = 0) -> FloatArray:
    """Real pattern (frames,) of mean 0 and variance 1, at most ``sqrt(2)`` of :data:`LARGEST`.

    Parameters
    ----------
    body, view, part, length_m, seed
        As of :func:`speckle`, of which it is the real part.
    """
    return np.asarray(np.sqrt(2) * speckle(body, view, part, length_m, seed).real)


def drawn_for(body: SceneObject, view: View, part: str, seed: int) -> np.random.Generator:
    """Random stream of one part of an object on one carrier, the same in all runs and scenes.

    Parameters
    ----------
    body : SceneObject
        Its name alone counts.
    view : View
        Its carrier frequency alone counts.
    part : str
    seed : int
        Another stream for the same part.
    """
    key = f"{body.name}/{part}/{view.radar.center_frequency_hz:.0f}"
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(key.encode()),))))
