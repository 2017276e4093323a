"""The page "Which detector should I use?": what a run of a suite says to each question, in words and numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np
import pandas as pd
from tables import Board

from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.results.slices import ALL, Slice, slices
from uwbbench.tools.leaderboard import Leaderboard

DISTANCES_M = (0.5, 1.0, 2.0, 3.5)
BUDGETS = (3.0, 10.0, 100.0)
"""Times of a frame, in times of the reference."""

SITUATIONS = {
    "By material": (
        ("a metal object", "metal"),
        ("a concrete object", "concrete"),
        ("a plywood object", "plywood"),
    ),
    "One or many objects": (
        ("one metal object", "metal"),
        ("rooms and a corridor, with several objects, walls and ghosts", "rooms"),
    ),
    "Still or moving": (
        ("a robot that approaches", "metal"),
        ("a robot that stands still", "standing still"),
    ),
    "When it gets difficult": (
        ("from 0.1 m", "near field"),
        ("weak echoes: 15 dB below the twin's", "weak echoes"),
        ("interference in a fifth of the frames", "interference"),
    ),
}


def advice_text(board: Board, combined: Leaderboard) -> str:
    """The block of the page."""
    lines = [
        f"From suite `{board.name}`, version {board.version[:12]}: all of it is **simulated**, and a detector that is "
        "good here need not be good on your robot. A line names every detector that may be the best one there: the "
        "captures do not tell them apart. Brackets are 95 % intervals over captures.",
        "",
    ]
    for title, rows in SITUATIONS.items():
        there = [(said, dataset) for said, dataset in rows if dataset in board.datasets]
        if there:
            lines += [
                f"## {title}",
                "",
                "| your case | take one of | F1 of the first | the next |",
                "| --- | --- | --- | --- |",
            ]
            lines += [
                f"| {said} | {' | '.join(_advice(board.of(dataset), board.detectors))} |" for said, dataset in there
            ]
            lines.append("")
    lines += ["## By distance", "", *_by_distance(board, combined), ""]
    lines += ["## By budget", "", *_by_budget(board), ""]
    lines += ["## All detectors of the suite", "", *_all(board)]
    return "\n".join(lines)


def _advice(of: pd.DataFrame, detectors: list[str]) -> tuple[str, str, str]:
    """Detectors that may be first, F1 of the first of them, and the best of those that are worse."""
    ranked = of.loc[[name for name in detectors if name in of.index]].sort_values("f1", ascending=False)
    top, rest = ranked[ranked["low"] == 1], ranked[ranked["low"] > 1]
    first = _with_interval(top.iloc[0])
    behind = f"`{rest.index[0]}` {rest.iloc[0]['f1']:.2f}" if len(rest) else "none is worse"
    return ", ".join(f"`{name}`" for name in top.index), first, behind


def _with_interval(row: pd.Series) -> str:
    return f"{row['f1']:.2f} [{row['f1_low']:.2f}, {row['f1_high']:.2f}]"


def _by_distance(board: Board, combined: Leaderboard) -> Iterator[str]:
    """Recall by range, as the false detections of a frame belong to no distance; of approaches, by material."""
    datasets = [name for name in ("metal", "concrete", "plywood") if name in board.datasets]
    recall = MetricChoice({"rank": "recall", "table": ["recall"]})
    members = [
        one
        for run in combined.content.runs
        for one in run.scored
        if one.dataset in datasets and one.table == "filtering" and one.detector in board.detectors
    ]
    known: dict[object, dict[str, object]] = defaultdict(dict)
    cuts = [
        one
        for one in slices(members, recall, np.array(DISTANCES_M), {"confidence": 0.95}, known)
        if (one.channel, one.material) == (ALL, ALL) and one.span != ALL
    ]
    yield "Share of the frames in which the object was found, whatever else was; the best three of each distance."
    yield ""
    spans = sorted({one.span for one in cuts}, key=lambda span: float(span.split()[0]))
    yield f"| object | {' | '.join(spans)} |"
    yield f"| --- |{' --- |' * len(spans)}"
    for dataset in datasets:
        cells = [_best(one for one in cuts if one.board[0] == dataset and one.span == span) for span in spans]
        yield f"| {dataset} | {' | '.join(cells)} |"


def _best(cuts: Iterable[Slice]) -> str:
    values = sorted(((one.estimates["recall"].value, one.detector) for one in cuts), reverse=True)[:3]
    return ", ".join(f"`{name}` {value:.2f}" for value, name in values)


def _by_budget(board: Board) -> Iterator[str]:
    """The best F1 for so much time."""
    yield (
        "Time of a frame from samples to rows, in times of `paper-filtering`, measured in turns on one machine. "
        "`uwbbench time` measures it on yours."
    )
    yield ""
    yield f"| at most | {' | '.join(board.timed)} |"
    yield f"| --- |{' --- |' * len(board.timed)}"
    for budget in BUDGETS:
        cells = []
        for dataset in board.timed:
            of = board.of(dataset)
            within = of[(of["time_ratio"] <= budget) & of.index.isin(board.detectors)].sort_values(
                "f1", ascending=False
            )
            rows = [
                f"`{name}` {row['f1']:.2f} ({row['time_ratio']:.3g} times)" for name, row in within.head(2).iterrows()
            ]
            cells.append(", ".join(rows) or "none")
        yield f"| {budget:g} times | {' | '.join(cells)} |"


def _all(board: Board) -> Iterator[str]:
    """F1 with its interval on every dataset; false alarms where there is nothing to be found."""
    heads = [f"{name}, false alarms a minute" if board.is_noise(name) else name for name in board.datasets]
    yield f"| detector | {' | '.join(heads)} |"
    yield f"| --- |{' --- |' * len(heads)}"
    for name in [*board.detectors, *board.references]:
        cells = [_cell(board, dataset, name) for dataset in board.datasets]
        yield f"| `{name}` | {' | '.join(cells)} |"


def _cell(board: Board, dataset: str, name: str) -> str:
    row = board.of(dataset).loc[name]
    if board.is_noise(dataset):
        return f"{row['false_alarms_per_minute']:.3g}"
    return "–" if np.isnan(row["f1"]) else _with_interval(row)
