"""When a radar starts to move, by its own scans and by the record of its motion.

The two have no common clock. Where both show the onset of motion it ties them together, without a look at where any
reflector is seen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import FloatArray

STILL_M = 0.002
"""Whoever is within this distance of his place stands: noise of the trackers and drift of the radar stay below it."""
MOVED_M = 0.005
"""Whoever is farther from his place has moved; at a carrier of 4 GHz a radar can tell distances up to about 1 cm."""
REST_S = 1.0
"""Both records start at rest, for at least this long."""


def onset_s(time_s: FloatArray, moved_m: FloatArray) -> float | None:
    """When a record leaves its place for good: the first sample behind :data:`STILL_M` on the way to :data:`MOVED_M`.

    Parameters
    ----------
    time_s, moved_m : (n,) arrays
        Distance from the place at the start; NaN where it is not known.

    Returns
    -------
    float or None
        None if it never leaves, or has left within the :data:`REST_S` at the start.
    """
    with np.errstate(invalid="ignore"):
        left, still = moved_m > MOVED_M, moved_m <= STILL_M
    if not left.any():
        return None
    before = np.flatnonzero(still[: np.argmax(left)])
    if not len(before) or time_s[before[-1]] < time_s[0] + REST_S:
        return None
    return float(time_s[before[-1] + 1])


def moved_by_poses_m(time_s: FloatArray, position_m: FloatArray) -> FloatArray:
    """Distance (n,) of positions (n, 3) from where they are during the first :data:`REST_S`."""
    place = np.nanmedian(position_m[time_s < time_s[0] + REST_S], axis=0)
    return np.asarray(np.linalg.norm(position_m - place, axis=1))


def span_s(time_s: FloatArray, position_m: FloatArray) -> tuple[float, float]:
    """First and last moment of the motion of a body at positions (n, 3); the whole record's where it never rests."""
    back_s, back_m = -time_s[::-1], position_m[::-1]
    first = onset_s(time_s, moved_by_poses_m(time_s, position_m))
    last = onset_s(back_s, moved_by_poses_m(back_s, back_m))
    return float(time_s[0]) if first is None else first, float(time_s[-1]) if last is None else -last


def moved_by_scans_m(time_s: FloatArray, samples: NDArray[np.float32], wavelength_m: float) -> FloatArray:
    """Distance (n,) of a radar from where it is during the first :data:`REST_S`, by the change of its scans.

    A radar that moves by a small distance s turns the phase of an echo from a direction at the angle a to the motion by
    ``4 pi s cos(a) / wavelength``. Echoes from all round, the root mean square of whose ``cos(a)`` is ``1 / sqrt 2``,
    then change by ``|x - x0| / |x0| = 4 pi s / (sqrt 2 wavelength)``. From an eighth of the wavelength on that no
    longer grows.

    Parameters
    ----------
    time_s : (n,) array
    samples : (n, bins) array
        Real RF.
    wavelength_m : float
        Of the carrier.
    """
    place = samples[time_s < time_s[0] + REST_S].mean(axis=0, dtype=np.float64)
    change = np.linalg.norm(samples - place, axis=1)
    level = np.linalg.norm(place)
    return np.asarray(change * (np.sqrt(2) * wavelength_m / (4 * np.pi * level) if level > 0 else np.nan))
