"""Detections in a notebook."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api.detections import COLUMNS, Detections
from uwbbench.show.notebook import elements
from uwbbench.show.text.numbers import number

FIRST_ROWS = 10
_SHOWN = {
    "_s": (" (ns)", 1e9, 2),
    "_m": (" (m)", 1.0, 3),
    "_rad": (" (deg)", 180 / math.pi, 1),
    "_db": (" (dB)", 1.0, 1),
}
"""How columns are shown, by the unit at the end of their names: heading, factor and digits."""


def detections(shown: Detections) -> str:
    """HTML of detections: columns with units, the first rows, frames processed, and notes."""
    occupied = len(np.intersect1d(shown.frame, shown.processed))
    facts = {
        "frames": f"{len(shown.processed)} processed, {len(shown.processed) - occupied} of them without a detection",
        "left behind": ", ".join(f"{step} {count}" for step, count in shown.chain.items()),
    }
    names = [name for name in COLUMNS if name in shown] + [name for name in shown.columns if name not in COLUMNS]
    heads = [_heading(name) for name in names]
    rows = [[_cell(name, shown[name][row]) for name in names] for row in range(min(FIRST_ROWS, len(shown)))]
    listed = elements.table(heads, rows, numbers=True)
    left = len(shown) - len(rows)
    more = [f"{left} more rows"] if left else []
    return elements.frame(
        "detections", len(shown), elements.facts(facts), listed, elements.notes([*more, *shown.notes])
    )


def _unit(name: str) -> tuple[str, str, float, int] | None:
    for suffix, (unit, factor, digits) in _SHOWN.items():
        if name.endswith(suffix):
            return name.removesuffix(suffix), unit, factor, digits
    return None


def _heading(name: str) -> str:
    """Column with the unit that it is shown in.

    Examples
    --------
    >>> _heading("delay_s"), _heading("tap")
    ('delay (ns)', 'tap')
    """
    unit = _unit(name)
    return name if unit is None else f"{unit[0]}{unit[1]}"


def _cell(name: str, value: float) -> str:
    if np.isnan(value):
        return "n/a"
    if isinstance(value, np.integer):
        return str(value)
    unit = _unit(name)
    return f"{value:.4g}" if unit is None else number(value, unit[3], unit[2])
