"""Numbers of captures that repeat one another, such as draws of one simulated scene: their mean, and how sure it is."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from uwbbench.measure.accuracy.intervals import student


def reach_of_mean(values: Sequence[float]) -> float:
    """Half of Student's interval of a mean: t times its standard error.

    It holds for values that are drawn alike, as runs of one scene are, and says nothing of other scenes.

    Parameters
    ----------
    values : sequence of float
        One of each capture.

    Returns
    -------
    float
        NaN for fewer than two values.

    Examples
    --------
    >>> round(reach_of_mean([9.0, 10.0, 11.0]), 3)
    2.484
    """
    if len(values) < 2:
        return math.nan
    return float(student(np.asarray(len(values) - 1.0)) * np.std(values, ddof=1) / math.sqrt(len(values)))
