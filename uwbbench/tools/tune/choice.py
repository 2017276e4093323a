"""Which of the sets that were tried is taken, and how much that matters: the stable zone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import BoolArray, IntArray
from uwbbench.api.errors import ScoringError
from uwbbench.tools.tune.sweep.scores import SetScores


def best_of(scores: SetScores, tie: float, shape: tuple[int, ...]) -> int:
    """Set of the highest F1 and then the lowest root mean square error, as arXiv 2512.01018 chooses.

    Parameters
    ----------
    scores : SetScores
    tie : float
        Loss of F1 up to which the error decides.
    shape : tuple of int
        Of the grid of sets.

    Returns
    -------
    int
        Of sets that are equal in both, the one in their middle: thresholds beside a cliff are a poor choice.

    Raises
    ------
    ScoringError
        If no set has an F1.
    """
    f1 = scores.f1
    if np.isnan(f1).all():
        raise ScoringError("no set has an F1: there is nothing to be found on the tuning captures, and nothing found")
    near = np.flatnonzero(f1 >= np.nanmax(f1) - tie)
    rmse_m = np.where(np.isnan(scores.rmse_m[near]), np.inf, scores.rmse_m[near])
    equal = near[rmse_m == rmse_m.min()]
    places = np.stack(np.unravel_index(equal, shape), axis=1)
    distance = np.abs(places - np.median(places, axis=0)).sum(axis=1)
    return int(equal[np.argmin(distance)])


@dataclass(frozen=True)
class StableZone:
    """Threshold sets within a little of the best F1: how well a choice must be met.

    Attributes
    ----------
    within : float
        Loss of F1 that the zone allows.
    inside : (sets,) bool array
    share : float
        Share of the grid.
    regions : int
        Parts that do not touch each other, by steps along one axis.
    spans : dict of str to (low, high)
        Smallest and largest threshold inside by path; None where no limit is inside.
    """

    within: float
    inside: BoolArray
    share: float
    regions: int
    spans: dict[str, tuple[float | None, float | None]]


def stable_zone(
    scores: SetScores, within: float, axes: Mapping[str, Sequence[float | None]], order: Sequence[IntArray]
) -> StableZone:
    """Stable zone of a grid.

    Parameters
    ----------
    scores : SetScores
        Of all sets of the grid, the last axis varying fastest.
    within : float
        Loss of F1 that the zone allows.
    axes : mapping of str to sequence of float or None
        Thresholds of each axis by its path.
    order : sequence of (thresholds,) int array
        Places of each axis' thresholds from loose to strict: neighbours in this order touch.
    """
    from scipy import ndimage

    shape = tuple(len(thresholds) for thresholds in axes.values())
    f1 = scores.f1
    inside = f1 >= np.nanmax(f1) - within
    grid = inside.reshape(shape)
    for axis, places in enumerate(order):
        grid = np.take(grid, places, axis)
    _, regions = ndimage.label(grid)
    spans: dict[str, tuple[float | None, float | None]] = {}
    for axis, (path, thresholds) in enumerate(axes.items()):
        others = tuple(other for other in range(len(shape)) if other != axis)
        met = [thresholds[place] for place in np.flatnonzero(inside.reshape(shape).any(axis=others)).tolist()]
        numbers = [value for value in met if value is not None]
        spans[path] = (None, None) if len(numbers) < len(met) else (min(numbers), max(numbers))
    return StableZone(within, inside, float(inside.mean()), int(regions), spans)
