"""Mean of a count over captures that repeat one another, and how sure it is."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from uwbbench.measure.accuracy.intervals import Interval, student


def mean_count(counts: Sequence[float]) -> Interval:
    """Mean of counts with Student's interval, which does not fall below 0.

    Parameters
    ----------
    counts : sequence of float
        One of each capture.

    Returns
    -------
    Interval
        Its outer ends, for which a count would need a bound, are NaN, and so are all ends of fewer than two counts.

    Examples
    --------
    >>> tuple(float(part) for part in mean_count([9.0, 11.0]))[:3]
    (10.0, 0.0, 22.706204736174698)
    """
    value, none = np.asarray(np.mean(counts) if len(counts) else math.nan), np.asarray(math.nan)
    if len(counts) < 2:
        return Interval(value, none, none, none, none)
    reach = student(np.asarray(len(counts) - 1.0)) * np.std(counts, ddof=1) / math.sqrt(len(counts))
    return Interval(value, np.maximum(value - reach, 0.0), value + reach, none, none)
