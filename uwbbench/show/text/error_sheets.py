"""Tables about errors: where they come from and what each cause costs, and detectors without their thresholds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np

from uwbbench.measure.accuracy.intervals import INNER_UNITS, Interval
from uwbbench.results.error_causes import ErrorCauses
from uwbbench.results.ranked_curves import FEW_ALARMS, CurveKey, RankedCurve
from uwbbench.show.text.numbers import interval, number, significant
from uwbbench.show.text.sheet import Sheet, shown
from uwbbench.show.text.wording import TABLES

MOST_CAUSES = 4
"""Causes of each detector that have a row; the others share one."""


def main_causes(causes: Sequence[ErrorCauses]) -> list[ErrorCauses]:
    """Those of one board of each dataset: after filtering, by ``object`` if the run has it, else by its first scoring.

    Parameters
    ----------
    causes : sequence of ErrorCauses
        Of all boards.
    """
    chosen: dict[tuple[str, str], str] = {}
    for one in causes:
        dataset, source, scoring, _ = one.board
        if scoring == "object" or (dataset, source) not in chosen:
            chosen[dataset, source] = scoring
    return [one for one in causes if one.board[3] == "filtering" and chosen[one.board[:2]] == one.board[2]]


def cause_sheets(causes: Sequence[ErrorCauses]) -> Iterator[Sheet]:
    """One table for each board: what each cause of errors costs each detector, the dearest first.

    Parameters
    ----------
    causes : sequence of ErrorCauses
        Those of a board one after the other.
    """
    columns = ("detector", "F1", "error", "cause", "count", "share of these errors (%)", "F1 without it", "gain")
    for board, members in groupby(causes, key=lambda one: one.board):
        dataset, source, scoring, table = board
        detectors = list(members)
        rows = [row for one in detectors for row in _cause_rows(one)]
        notes = [
            "F1 without a cause: its misses found, its false detections gone, all else as it is. Gains do not add up.",
        ]
        notes += [
            f"{shown(one.detector)}: causes of {one.unknown} of {one.unknown + one.captures} captures are not stored"
            for one in detectors
            if one.unknown
        ]
        aside = {f"{count} {what}" for one in detectors for what, count in one.set_aside.items() if count}
        if aside:
            notes.append(f"Not asked for, so no misses: {', '.join(sorted(aside))} (obstacles, frames added up).")
        yield Sheet(
            f"{shown(dataset)}, {source.upper()}: causes of errors, {scoring} scoring, {TABLES[table]}",
            columns,
            tuple(rows),
            tuple(notes),
        )


def _cause_rows(one: ErrorCauses) -> Iterator[tuple[str, ...]]:
    name, f1, totals = shown(one.detector), number(one.f1, 3), {"missed": one.fn, "false": one.fp}
    costs = one.costs
    for cost in costs[:MOST_CAUSES]:
        share = number(cost.count / totals[cost.error], 0, 100)
        gain = "n/a" if math.isnan(cost.gain) else f"+{cost.gain:.3f}"
        yield name, f1, cost.error, cost.cause, str(cost.count), share, number(cost.f1, 3), gain
    rest = costs[MOST_CAUSES:]
    if rest:
        causes = "1 other" if len(rest) == 1 else f"{len(rest)} others"
        yield name, f1, "both", causes, str(sum(cost.count for cost in rest)), "n/a", "n/a", "n/a"
    if not costs:
        yield name, f1, "none", "none", "0", "n/a", f1, "n/a"


def curve_sheets(curves: Mapping[CurveKey, RankedCurve]) -> Iterator[Sheet]:
    """One table for each dataset: average precision of each detector, the largest first, and where its setting lies."""
    columns: tuple[str, ...] = (
        "detector",
        "average precision",
        f"recall at {FEW_ALARMS:g} false alarms/min",
        "recall as set",
    )
    columns += ("precision as set", "false alarms as set (1/min)", "ordered by", "captures")
    for (dataset, source), keys in groupby(curves, key=lambda key: key[:2]):
        members = [(key[2], curves[key]) for key in keys]
        members.sort(key=lambda item: -float(np.nan_to_num(item[1].average_precision.value, nan=-1.0)))
        rows: list[tuple[str, ...]] = []
        for detector, curve in members:
            setting = curve.setting
            rows.append(
                (
                    shown(detector),
                    _text(curve.average_precision),
                    number(curve.few_alarms_recall, 3),
                    _text(setting["recall"]),
                    _text(setting["precision"]),
                    significant(float(setting["false_alarms_per_minute"].value), 3),
                    curve.order or "no candidate",
                    str(curve.captures),
                )
            )
        few = min(curve.scenes for _, curve in members)
        notes = [
            "Candidates are the peaks before the filters, judged by object at every threshold of the column that "
            "orders them; recall is of all visible obstacles.",
        ]
        if few < INNER_UNITS:
            notes.append(
                f"Fewer than {INNER_UNITS} scenes: no interval of average precision, and outer ones of shares."
            )
        if any(not curve.exhaustive for _, curve in members):
            notes.append("The truth does not name all that is visible: precision and false alarms are undefined.")
        yield Sheet(f"{shown(dataset)}, {source.upper()}: without thresholds", columns, tuple(rows), tuple(notes))


def _text(one: Interval) -> str:
    return interval(float(one.value), float(one.low), float(one.high), 3)
