"""Words, numbers and tables for people, and JSON for programs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import typer

from uwbbench.show.text.numbers import number

if TYPE_CHECKING:
    from uwbbench.results import Report

NOT_A_TERMINAL_WIDTH = 1000
"""Columns of a table that goes into a file or a pipe: nothing is cut off there."""


def print_json(value: Any) -> None:
    """Print one JSON value and nothing else; undefined numbers must be None already."""
    typer.echo(json.dumps(value, indent=2, allow_nan=False))


def print_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table on stdout; cells are shown as they are, whatever they hold."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(title), title_justify="left", title_style="bold", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in columns:
        table.add_column(escape(name), overflow="fold")
    for row in rows:
        table.add_row(*(escape(str(cell)) for cell in row))
    Console(file=sys.stdout, highlight=False, width=None if sys.stdout.isatty() else NOT_A_TERMINAL_WIDTH).print(table)


def print_facts(facts: Mapping[str, object]) -> None:
    """Print ``name: value`` lines, aligned, leaving out what is empty."""
    shown = {name: str(value) for name, value in facts.items() if value not in (None, "", (), [])}
    width = max(map(len, shown), default=0) + 2
    for name, value in shown.items():
        typer.echo(f"{name + ':':<{width}}{value}")


def print_notes(notes: Sequence[str]) -> None:
    """Print on stderr what a reader of the results must know."""
    for note in notes:
        typer.echo(f"note: {note}", err=True)


def print_scores(result: Mapping[str, Any]) -> None:
    """Print what ``score --json`` prints, for people: the two tables as columns, and the times."""
    label = "SIMULATED capture" if result["source"] == "simulated" else "capture"
    typer.echo(f"{result['detector']} on {label} '{result['capture']}', {result['frames']} frames")
    tables = [name for name in ("filtering", "mapping") if result[name] is not None]
    rows = [[text, *(_score(result[name], key, unit) for name in tables)] for key, text, unit in _SCORES]
    title = f"scoring '{result['scoring']}', gate {result['gate_m']:g} m"
    print_table(title, ["", *(f"after {name}" for name in tables)], rows)
    if result["mapping"] is None:
        typer.echo("after mapping: n/a (the detector does not cluster positions)")
    times = result["latency_us"]
    if times is not None:
        shown = [f"{key} {number(times[key], 1, 1.0, 'us', 'too few calls')}" for key in _TIMES]
        typer.echo(f"time a frame, one frame a call ({times['n']} calls): {', '.join(shown)}")
    print_notes(result["notes"])


_TIMES = ("p50", "p90", "p95", "p99", "amortised", "deadline")


_SCORES = (
    ("precision", "precision", ""),
    ("recall", "recall", ""),
    ("f1", "F1", ""),
    ("mae_m", "MAE", "cm"),
    ("p90_m", "P90", "cm"),
    ("p95_m", "P95", "cm"),
    ("sd_m", "SD", "cm"),
    ("matched_mae_m", "MAE of true positives", "cm"),
    ("chance_recall", "recall by chance", ""),
    ("false_alarms_per_minute", "false alarms a minute", ""),
    ("tp", "true positives", None),
    ("fp", "false positives", None),
    ("fn", "misses", None),
    ("retained", "retained", None),
    ("unmatched", "unmatched", None),
)


def _score(block: Mapping[str, Any], key: str, unit: str | None) -> str:
    if unit is None:
        return str(block[key])
    digits, scale = (1, 100.0) if unit == "cm" else (3, 1.0)
    return number(block[key], digits, scale, unit, _why_undefined(block, key))


def _why_undefined(block: Mapping[str, Any], key: str) -> str:
    """Why a score is undefined, by the conventions of :mod:`uwbbench.measure.accuracy.metrics`."""
    if not block["exhaustive"] and key in ("precision", "f1", "false_alarms_per_minute"):
        return "truth not exhaustive"
    if key == "chance_recall":
        return "not defined here"
    if key == "recall":
        return "nothing to find"
    if key in ("p90_m", "p95_m") and block["retained"]:
        return "too few samples"
    return "no frames" if not block["frames"] else "nothing retained"


def print_report(report: Report) -> None:
    """Print all tables of a run, each with what a reader must know."""
    from uwbbench.show.text.report import sheets

    for sheet in sheets(report):
        print_table(sheet.title, sheet.columns, sheet.rows)
        for note in sheet.notes:
            typer.echo(f"  {note}")
        typer.echo()
    print_notes(report.notes)


def print_leaderboard(report: Report) -> None:
    """Print how the detectors did on each dataset, best first, and what did not work."""
    groups: dict[str, list[list[str]]] = {}
    open_world: set[str] = set()
    for about, found in report.estimates:
        title = f"{about['dataset']}, {about['source'].upper()}"
        if not about["exhaustive"]:
            open_world.add(title)
        numbers = [number(found[name].value, digits, scale) for name, _, scale, digits in _LEADERBOARD]
        others = [number(about["p50_us"], 0), number(about["chance_recall"], 3)]
        groups.setdefault(title, []).append([about["scoring"], about["table"], about["detector"], *numbers, *others])
    columns = ["scoring", "after", "detector", *(title for _, title, _, _ in _LEADERBOARD), "p50 (us)", "chance recall"]
    for title, rows in groups.items():
        shown = slice(None) if title in open_world else slice(-1)
        print_table(title, columns[shown], [row[shown] for row in rows])
        if title in open_world:
            typer.echo("  truth not exhaustive: no precision and F1; errors are of matches; compare recall with chance")
        elif any("n/a" in row[shown] for row in rows):
            typer.echo("  n/a: undefined, as nothing was retained, nothing was to be found, or samples are too few")
    failed, unscored = len(report.failures), len(report.unscored)
    for entry in report.failures:
        what = " on ".join(name for name in (entry.detector, entry.capture or entry.dataset) if name)
        typer.echo(f"failed: {entry.kind}: {what}: {entry.reason}", err=True)
    for reason in dict.fromkeys(reason for _, _, reason in report.unscored):
        typer.echo(f"not scored: {reason}", err=True)
    print_notes(report.notes)
    if failed or unscored:
        typer.echo(f"{failed} units failed, {unscored} could not be scored", err=True)


_LEADERBOARD = (
    ("precision", "precision", 1, 3),
    ("recall", "recall", 1, 3),
    ("f1", "F1", 1, 3),
    ("mae", "MAE (cm)", 100, 1),
    ("p90", "P90 (cm)", 100, 1),
    ("p95", "P95 (cm)", 100, 1),
    ("sd", "SD (cm)", 100, 1),
)
