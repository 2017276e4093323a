"""What a run says about physical limits, as tables of text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from uwbbench.results.limits import BLIND_UP_TO_M, CLEAR_M, GATE_M, Limits
from uwbbench.show.text.numbers import interval, number
from uwbbench.show.text.sheet import Sheet, shown

if TYPE_CHECKING:
    import pandas as pd

_TITLE = "Limits, SIMULATED test signals"


def limits_sheets(limits: Limits) -> Iterator[Sheet]:
    """Tables of a run over test signals; none for any other run."""
    if not limits.accuracy.empty:
        yield _accuracy(limits.accuracy)
        yield _detection(limits.detection)
        yield _blind_zone(limits.blind_zone)
    if not limits.resolution.empty:
        yield _resolution(limits.resolution)
    if not limits.false_alarms.empty:
        yield _false_alarms(limits.false_alarms)


def _grid(table: pd.DataFrame, rows: list[str], column: str, cell: Any) -> list[tuple[str, ...]]:
    """Texts of a table whose values of ``column`` are side by side, in the order they first appear."""
    grid: dict[tuple[Any, ...], dict[Any, str]] = {}
    for row in table.to_dict("records"):
        grid.setdefault(tuple(row[name] for name in rows), {})[row[column]] = cell(row)
    across = list(dict.fromkeys(table[column]))
    return [(*map(_plain, key), *(cells.get(value, "n/a") for value in across)) for key, cells in grid.items()]


def _plain(value: object) -> str:
    return shown(value) if isinstance(value, str) else f"{value:g}"


def _accuracy(table: pd.DataFrame) -> Sheet:
    ratios = list(dict.fromkeys(table["snr_db"]))
    bounds = dict(zip(table["snr_db"], table["bound_m"], strict=True))

    def cell(row: dict[str, Any]) -> str:
        if not row["ratio"] > 0:
            return "n/a"
        return f"{number(row['rmse_m'], 2, 100)} ({number(row['ratio'], 2)}x, Pd {number(row['share'], 3)})"

    first = ("Cramer-Rao bound", *(number(bounds[snr_db], 2, 100) for snr_db in ratios))
    clear = f"{CLEAR_M[0]:g} to {CLEAR_M[1]:g} m"
    return Sheet(
        f"{_TITLE}: range error against the Cramer-Rao bound (cm RMS)",
        ("detector", *(f"{snr_db:g} dB" for snr_db in ratios)),
        (first, *_grid(table, ["detector"], "snr_db", cell)),
        (
            f"One echo at {clear}; error of the nearest detection within {100 * GATE_M:g} cm, its ratio to the bound, "
            "and how often there is one (Pd).",
            "Detections on whole taps cannot be better than 4.3 cm, whatever the signal-to-noise ratio.",
            "Where Pd is below 1 the found echoes are the lucky ones, and their error may fall below the bound.",
        ),
    )


def _detection(table: pd.DataFrame) -> Sheet:
    named = table.assign(span=[f"{a:g}-{b:g} m" for a, b in zip(table["near_m"], table["far_m"], strict=True)])
    columns = ("detector", "SNR (dB)", *dict.fromkeys(named["span"]))
    rows = _grid(named, ["detector", "snr_db"], "span", _share)
    note = (
        f"Echoes with a detection within {100 * GATE_M:g} cm; exact 95 % intervals. SNR does not fall with range here."
    )
    return Sheet(f"{_TITLE}: probability of detection by range", columns, tuple(rows), (note,))


def _share(row: dict[str, Any]) -> str:
    return interval(row["share"], row["low"], row["high"], 3)


def _blind_zone(table: pd.DataFrame) -> Sheet:
    ratios = dict.fromkeys(table["snr_db"])

    def cell(row: dict[str, Any]) -> str:
        return number(row["radius_m"], 1)

    return Sheet(
        f"{_TITLE}: blind-zone radius (m)",
        ("detector", *(f"{snr_db:g} dB" for snr_db in ratios)),
        tuple(_grid(table, ["detector"], "snr_db", cell)),
        (
            f"Up to there echoes are found less than half as often as at {CLEAR_M[0]:g} to {CLEAR_M[1]:g} m (n/a: not "
            f"found there either, or blind up to {BLIND_UP_TO_M:g} m). No ringing here, which would widen it.",
        ),
    )


def _resolution(table: pd.DataFrame) -> Sheet:
    columns = ("detector", "SNR (dB)", *(f"{ns:g} ns" for ns in dict.fromkeys(table["separation_ns"])))
    rows = _grid(table, ["detector", "snr_db"], "separation_ns", _share)
    notes = (
        "Two equal echoes of random phase, both found, each nearer than half their distance; 1 ns is 15 cm of range.",
        "A detector that keeps one detection of a frame resolves nothing.",
    )
    return Sheet(f"{_TITLE}: resolution of two echoes", columns, tuple(rows), notes)


def _false_alarms(table: pd.DataFrame) -> Sheet:
    rows = []
    for row in table.to_dict("records"):
        measured = f"{row['share']:.2e} [{row['low']:.2e}, {row['high']:.2e}]"
        asked = f"{row['requested']:.2e}" if row["requested"] > 0 else "n/a"
        ratio = number(row["share"] / row["requested"], 2)
        rows.append(
            (shown(row["detector"]), measured, asked, ratio, row["condition"], str(row["alarms"]), str(row["n"]))
        )
    columns = ("detector", "measured a cell", "requested", "ratio", "cells, noise model", "alarms", "cells")
    notes = (
        "Detections a tap of noise alone. Only CFAR stages ask for a rate, and they mean it for 'all' cells over their "
        "threshold and, unless set otherwise, for independent noise; this noise is correlated.",
        "95 % intervals over frames: alarms in cells of one frame come together.",
    )
    return Sheet(f"{_TITLE}: false alarms", columns, tuple(rows), notes)
