"""Curves that show a whole distribution: errors, and times of calls.

Conventions
-----------
* A curve is thinned to the quantiles that a chart can show; the ends are kept.
* Errors are the absolute ones of all retained detections, as in the leaderboard; times those of single calls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.metric import Outcome
from uwbbench.measure.accuracy.metrics.error import MeanAbsoluteError, Percentile90, Percentile95

MOST_POINTS = 120
SPREAD, SMALLEST_M = 10.0, 1e-3
"""Ratio of the 95th percentiles from which errors get a logarithmic axis, and the smallest error on that."""


@dataclass(frozen=True)
class ErrorCurve:
    """Share of detections whose absolute error stays below a value.

    Attributes
    ----------
    error_m, share : (points,) array
    n : int
        Errors.
    p50_m, p90_m, p95_m : float
        NaN where there are too few errors.
    """

    error_m: FloatArray
    share: FloatArray
    n: int
    p50_m: float
    p90_m: float
    p95_m: float


def error_curve(outcomes: Sequence[Outcome], most: int = MOST_POINTS) -> ErrorCurve | None:
    """Curve of all errors together; None where there is none.

    Parameters
    ----------
    outcomes : sequence of Outcome
    most : int
        Points at most.
    """
    parts = [np.abs(MeanAbsoluteError.partial(outcome)) for outcome in outcomes]
    error_m = np.sort(np.concatenate(parts)) if parts else np.empty(0)
    if not len(error_m):
        return None
    rank = np.unique(np.linspace(0, len(error_m) - 1, min(most, len(error_m))).astype(np.int64))
    return ErrorCurve(
        error_m=error_m[rank],
        share=(rank + 1) / len(error_m),
        n=len(error_m),
        p50_m=float(np.median(error_m)),
        p90_m=Percentile90.value(error_m),
        p95_m=Percentile95.value(error_m),
    )


def tail_curve(times_us: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times (points,) and the share of calls that took at least as long, dense where calls are slow.

    Examples
    --------
    >>> times_us, share = tail_curve(np.array([3.0, 1.0, 2.0, 4.0]))
    >>> times_us.tolist(), share.tolist()
    ([1.0, 2.0, 3.0, 4.0], [1.0, 0.75, 0.5, 0.25])
    """
    slowest = np.sort(times_us)[::-1]
    if not len(slowest):
        return slowest, slowest
    rank = np.unique(np.geomspace(1, len(slowest), MOST_POINTS).round().astype(np.int64))[::-1]
    return slowest[rank - 1], rank / len(slowest)


def error_axis(curves: Sequence[ErrorCurve]) -> tuple[float, float, bool]:
    """Where an axis of errors starts and ends, in metres, and whether it must be logarithmic.

    It shows every curve up to its 95th percentile; where these are more than ten times apart, a linear axis would
    squeeze the better curves against its zero.
    """
    ends = [float(np.quantile(curve.error_m, 0.95)) for curve in curves]
    far, near = max(ends, default=1.0), max(min(ends, default=1.0), SMALLEST_M)
    end = max(1.5 * far, SMALLEST_M)
    if far <= SPREAD * near:
        return 0.0, end, False
    return max(min(float(curve.error_m[0]) for curve in curves), SMALLEST_M), end, True
