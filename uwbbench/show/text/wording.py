"""What metrics and tables are called where people read them, and in which unit."""

from __future__ import annotations

TITLES = {
    "precision": "precision",
    "recall": "recall",
    "f1": "F1",
    "mae": "MAE",
    "matched_mae": "MAE of matches",
    "p90": "P90",
    "p95": "P95",
    "sd": "SD",
    "false_alarms_per_minute": "false alarms",
}
"""Names of metrics; others are called as they are registered."""

TABLES = {"filtering": "after filtering (range)", "mapping": "after mapping (position)"}
"""Names of the paper's two tables."""


def scale(unit: str) -> tuple[str, int, float]:
    """How a metric's unit is shown: its name, digits, and the factor to it.

    Examples
    --------
    >>> scale("m"), scale("")
    ((' (cm)', 1, 100.0), ('', 3, 1.0))
    """
    if unit == "m":
        return " (cm)", 1, 100.0
    return (f" ({unit})", 2, 1.0) if unit else ("", 3, 1.0)
