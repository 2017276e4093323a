"""Numbers as people read them: fixed digits with unit and interval, and what is undefined said so."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

UNDEFINED = "n/a"


def number(value: object, digits: int, scale: float = 1.0, unit: str = "", reason: str = "") -> str:
    """Number with fixed digits; ``n/a`` where it is undefined.

    Parameters
    ----------
    value : float or None
    digits : int
        Behind the point.
    scale : float
        From the value's unit to the shown one.
    unit : str
        Shown unit.
    reason : str
        Why the number is undefined, if it is.

    Examples
    --------
    >>> number(0.1234, 1, 100.0, "cm"), number(None, 2), number(float("nan"), 2, reason="nothing retained")
    ('12.3 cm', 'n/a', 'n/a (nothing retained)')
    """
    if not isinstance(value, int | float) or not math.isfinite(value):
        return f"{UNDEFINED} ({reason})" if reason else UNDEFINED
    return f"{value * scale:.{digits}f} {unit}".rstrip()


def interval(value: object, low: object, high: object, digits: int, scale: float = 1.0) -> str:
    """Number with its interval in brackets, where there is one.

    Parameters
    ----------
    value, low, high : float or None
    digits : int
        Behind the point.
    scale : float
        From the value's unit to the shown one.

    Examples
    --------
    >>> interval(0.051, 0.049, 0.06, 1, 100.0), interval(0.051, None, None, 1, 100.0)
    ('5.1 [4.9, 6.0]', '5.1')
    """
    text, ends = number(value, digits, scale), between(low, high, digits, scale)
    return f"{text} {ends}" if ends and text != UNDEFINED else text


def time_us(row: Mapping[str, Any], key: str) -> str:
    """Microseconds of a leaderboard's row; of a results file they are as reported, not measured here.

    Examples
    --------
    >>> time_us({"p50_us": 41.7, "results_file": True}, "p50_us")
    '41.7 (as reported)'
    """
    text = significant(row[key], 3)
    return f"{text} (as reported)" if row["results_file"] and text != UNDEFINED else text


def between(low: object, high: object, digits: int, scale: float = 1.0) -> str:
    """Interval in brackets; empty where there is none, open where the data do not reach its upper end.

    Parameters
    ----------
    low, high : float or None
    digits : int
        Behind the point.
    scale : float
        From the unit of the ends to the shown one.
    """
    if high == math.inf:
        return f"[{number(low, digits, scale)}, ∞)"
    ends = number(low, digits, scale), number(high, digits, scale)
    return "" if UNDEFINED in ends else f"[{ends[0]}, {ends[1]}]"


def probability(share: float) -> str:
    """Share of random draws, never rounded to certainty.

    Examples
    --------
    >>> probability(0.998), probability(0.5), probability(float("nan"))
    ('>0.99', '0.50', 'n/a')
    """
    return ">0.99" if share > 0.99 else "<0.01" if share < 0.01 else number(share, 2)


def p_value(p: float) -> str:
    """A p-value, never rounded to 0.

    Examples
    --------
    >>> p_value(0.0002), p_value(0.0312)
    ('<0.001', '0.031')
    """
    return "<0.001" if p < 0.001 else number(p, 3)


def times(ratio: float) -> str:
    """A ratio as people say it, with two digits that count.

    Parameters
    ----------
    ratio : float

    Examples
    --------
    >>> times(33.78), times(1.234), times(0.0517), times(12600.0), times(float("nan"))
    ('34x', '1.2x', '0.052x', '12600x', 'n/a')
    """
    return f"{significant(ratio)}x" if math.isfinite(ratio) else UNDEFINED


def significant(value: float | None, digits: int = 2) -> str:
    """Number with so many digits that count, and none of its whole ones lost.

    Parameters
    ----------
    value : float or None
    digits : int
        Significant digits.

    Examples
    --------
    >>> significant(33.78), significant(0.0517), significant(5.28, 3), significant(242.4, 3), significant(20833.3, 3)
    ('34', '0.052', '5.28', '242', '20833')
    """
    if value is None or not math.isfinite(value):
        return UNDEFINED
    before = math.floor(math.log10(abs(value))) + 1 if value else 1
    return f"{value:.{max(digits - before, 0)}f}"


def rounded(value: float | None) -> float | None:
    """Number with five significant digits, which is more than any interval or picture bears; None where undefined.

    Examples
    --------
    >>> rounded(0.123456789), rounded(float("nan"))
    (0.12346, None)
    """
    return None if value is None or not math.isfinite(value) else float(f"{value:.5g}")
