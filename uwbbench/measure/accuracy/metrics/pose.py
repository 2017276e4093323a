"""How well a mapper knows where it is: metrics of the scoring ``pose``.

Conventions
-----------
* All are made of a :class:`~uwbbench.api.outcomes.PoseOutcome`; :mod:`uwbbench.measure.accuracy.judges.pose` says what
  is held against what. Each is a number of a run; of several runs their mean.
* ATE and RPE are those of Sturm et al. (IROS 2012), as root mean squares.
* NEES needs what the mapper says of its own errors; without it, it is undefined.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal, TypeVar

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.metric import Kind, Outcome
from uwbbench.api.outcomes import PoseOutcome
from uwbbench.measure.accuracy.metrics.run import RunMetric, mean, root_mean_square
from uwbbench.measure.accuracy.trajectories import squared_error_band

_Value = TypeVar("_Value", float, FloatArray)

_DEGREES = ("deg", math.degrees(1.0), 2)


class _PoseMetric(RunMetric):
    of: ClassVar[type[Outcome]] = PoseOutcome
    unit: ClassVar[str] = "m"


class AbsoluteTrajectoryError(_PoseMetric):
    """ATE: root mean square distance from the true positions, after the rigid motion that makes it smallest.

    Examples
    --------
    Of two runs, the mean:

    >>> AbsoluteTrajectoryError.value(np.array([0.04, 0.06]))
    0.05
    """

    title: ClassVar[str] = "ATE"
    brief: ClassVar[bool] = True
    headline: ClassVar[int | None] = 0
    order: ClassVar[int] = 2

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Root mean square."""
        return root_mean_square(_poses(outcome).aligned_m)


class MedianTrajectoryError(AbsoluteTrajectoryError):
    """Median over runs of the ATE: what a single run that fails does not move."""

    title: ClassVar[str] = "median ATE"
    kind: ClassVar[Kind] = "quantile"
    level: ClassVar[float] = 0.5
    default: ClassVar[bool] = False
    headline: ClassVar[int | None] = None
    order: ClassVar[int] = 3

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Median over runs."""
        return float(np.median(partial)) if len(partial) else math.nan


class StartFixedTrajectoryError(_PoseMetric):
    """The same with the first pose on its true one, and no alignment: errors grow from the start on."""

    title: ClassVar[str] = "ATE, start fixed"
    brief: ClassVar[bool] = True
    headline: ClassVar[int | None] = 2
    order: ClassVar[int] = 4

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Root mean square."""
        return root_mean_square(_poses(outcome).start_m)


class EndError(_PoseMetric):
    """Distance from the true position at the last pose, with the start fixed."""

    title: ClassVar[str] = "end error"
    brief: ClassVar[bool] = True
    order: ClassVar[int] = 6

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Distance at the end."""
        return float(_poses(outcome).start_m[-1])


class HeadingError(_PoseMetric):
    """Root mean square error of the heading, after the alignment of the positions."""

    title: ClassVar[str] = "heading error"
    unit: ClassVar[str] = "rad"
    shown_as: ClassVar[tuple[str, float, int] | None] = _DEGREES
    brief: ClassVar[bool] = True
    margin: ClassVar[float] = math.radians(0.5)
    order: ClassVar[int] = 8

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Root mean square."""
        return root_mean_square(_poses(outcome).heading_rad)


class RelativePoseError(_PoseMetric):
    """RPE: root mean square error of the motion over 1 m of true travel; drift, which no alignment hides."""

    title: ClassVar[str] = "RPE (1 m)"
    brief: ClassVar[bool] = True
    headline: ClassVar[int | None] = 1
    order: ClassVar[int] = 10

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Root mean square."""
        return root_mean_square(_poses(outcome).moved_m)


class RelativeHeadingError(_PoseMetric):
    """The same of the turn: root mean square error over 1 m of true travel."""

    title: ClassVar[str] = "RPE, turn (1 m)"
    unit: ClassVar[str] = "rad"
    shown_as: ClassVar[tuple[str, float, int] | None] = _DEGREES
    margin: ClassVar[float] = math.radians(0.5)
    order: ClassVar[int] = 12

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Root mean square."""
        return root_mean_square(_poses(outcome).turned_rad)


class Nees(_PoseMetric):
    """Normalised estimation error squared, mean of a run: 3 where a mapper knows its errors, more if it is too sure.

    Neither end is better. For a mapper that knows its errors the mean over so many runs lies, with 95 %, in the band of
    :func:`~uwbbench.measure.accuracy.trajectories.squared_error_band`.
    """

    title: ClassVar[str] = "NEES"
    unit: ClassVar[str] = "1"
    shown_as: ClassVar[tuple[str, float, int] | None] = ("", 1.0, 2)
    better: ClassVar[Literal["higher", "lower", "zero"]] = "zero"
    margin: ClassVar[float] = 0.5
    brief: ClassVar[bool] = True
    order: ClassVar[int] = 20

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Mean of the poses of which it is known."""
        nees = _poses(outcome).nees
        return mean(nees[np.isfinite(nees)])

    @classmethod
    def merit(cls, value: _Value) -> _Value:
        """Larger the nearer to 3."""
        return -abs(value - 3)


class NeesInside(_PoseMetric):
    """Share of the poses whose squared error lies in the 95 % band of chi-square.

    It is 0.95 of a mapper that knows its errors. One that is too sure leaves the band above, one that is not sure
    enough below.
    """

    title: ClassVar[str] = "NEES in band"
    unit: ClassVar[str] = ""
    kind: ClassVar[Kind] = "share"
    better: ClassVar[Literal["higher", "lower", "zero"]] = "higher"
    order: ClassVar[int] = 22

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Share of the poses of which it is known."""
        nees = _poses(outcome).nees
        low, high = squared_error_band()
        known = nees[np.isfinite(nees)]
        return mean((known >= low) & (known <= high))


class NearestRmse(_PoseMetric):
    """What the published script of LP_SLAM calls the RMSE: to the nearest true position, of any moment, and per axis.

    Never to be read in place of the ATE: it does not see errors along the path, and takes the nearest positions before
    it lays the trajectories over each other.
    """

    title: ClassVar[str] = "nearest RMSE"
    order: ClassVar[int] = 30

    @classmethod
    def number(cls, outcome: Outcome) -> float:
        """Root mean square over both axes."""
        return root_mean_square(_poses(outcome).nearest_m.ravel())


def _poses(outcome: Outcome) -> PoseOutcome:
    """Outcome of the scoring that these metrics are of."""
    if not isinstance(outcome, PoseOutcome):
        raise TypeError(f"a metric of poses takes a PoseOutcome, not {type(outcome).__name__}")
    return outcome


POSE_METRICS: dict[str, type[RunMetric]] = {
    "ate": AbsoluteTrajectoryError,
    "ate_start": StartFixedTrajectoryError,
    "end_error": EndError,
    "heading_error": HeadingError,
    "rpe": RelativePoseError,
    "rpe_turn": RelativeHeadingError,
    "nees": Nees,
    "nees_inside": NeesInside,
    "nearest_rmse": NearestRmse,
}
"""By registered name: what scores of poses hold."""
