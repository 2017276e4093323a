"""Words, numbers and tables for people, and JSON for programs."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import typer

from uwbbench.show.text.numbers import number, time_us

if TYPE_CHECKING:
    from uwbbench.api.metric import Metric
    from uwbbench.results import Report

NOT_A_TERMINAL_WIDTH = 1000
"""Columns of a table that goes into a file or a pipe: nothing is cut off there."""


def print_json(value: Any) -> None:
    """Print one JSON value and nothing else; undefined numbers must be None already."""
    typer.echo(json.dumps(value, indent=2, allow_nan=False))


def print_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table on stdout.

    Parameters
    ----------
    title : str
    columns : sequence of str
    rows : iterable of sequence of object
        As many cells as columns in each; shown as they are, whatever they hold.
    """
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
    from uwbbench.config.identity import marked

    label = "SIMULATED capture" if result["source"] == "simulated" else "capture"
    name = marked(result["detector"], results_file=result["results_file"] is not None)
    typer.echo(f"{name} on {label} '{result['capture']}', {result['frames']} frames")
    tables = [name for name in ("filtering", "mapping") if result[name] is not None]
    rows = [[title, *cells] for title, cells in _scores([result[name] for name in tables], result["scoring"])]
    title = f"scoring '{result['scoring']}', gate {result['gate_m']:g} m"
    print_table(title, ["", *(f"after {name}" for name in tables)], rows)
    if result["mapping"] is None:
        reasons = {
            "track": "the tracks have no positions",
            "segment": "segments have no positions",
            "presence": "presence has no positions",
            "pose": "the mapper does not look back",
            "map": "a map has one table",
        }
        why = reasons.get(result["scoring"], "the detector does not cluster positions")
        typer.echo(f"after mapping: n/a ({why})")
    times = result["latency_us"]
    if times is not None:
        shown = [
            f"{key.replace('_', ' ')} {number(times[key], 1, 1.0, 'us', 'too few calls')}"
            for key in _TIMES
            if key in times
        ]
        how = f"as the file reports it ({times['n']} frames)"
        if not times.get("as_reported"):
            how = f"from samples to rows, one frame a call ({times['n']} calls)"
        typer.echo(f"time a frame, {how}: {', '.join(shown)}")
    print_notes(result["notes"])


_TIMES = ("p50", "p90", "p95", "p99", "amortised", "deadline", "step_p50")


def _scores(blocks: Sequence[Mapping[str, Any]], scoring: str) -> Iterator[tuple[str, list[str]]]:
    """Title of each score, and its text in each table."""
    from uwbbench.measure.accuracy.metrics.choice import MetricChoice
    from uwbbench.measure.accuracy.scoring import column_of
    from uwbbench.show.text.quantity import Quantity

    for name, metric in MetricChoice((), [scoring]).items():
        key, by = column_of(name, metric.unit), Quantity.of(name, metric)
        if all(key in block for block in blocks):  # those of other packages are known to experiments only
            texts = [None if block[key] is None else by.text(block[key]) for block in blocks]
            yield (
                by.title,
                [text or f"n/a ({_why_undefined(metric, block)})" for text, block in zip(texts, blocks, strict=True)],
            )
    if not all("tp" in block for block in blocks):  # a run is judged as a whole
        return
    yield "recall by chance", [number(block["chance_recall"], 3, reason="not defined here") for block in blocks]
    for key, title in _COUNTS.items():
        yield title, [str(block[key]) for block in blocks]


_COUNTS = {"tp": "true positives", "fp": "false positives", "fn": "misses", "retained": "retained"}
_COUNTS |= {"unmatched": "unmatched"}


def _why_undefined(metric: type[Metric], block: Mapping[str, Any]) -> str:
    """Why a score is undefined, by the conventions of :mod:`uwbbench.measure.accuracy.metrics`."""
    if metric.needs_exhaustive_truth and not block["exhaustive"]:
        return "truth not exhaustive"
    if not block["frames"]:
        return "no frames"
    missing = {"nothing retained": block["retained"], "nothing to find": block["tp"] + block["fn"]}
    return " and ".join(reason for reason, count in missing.items() if not count) or "too few samples"


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
    from uwbbench.results.verdicts import BOUNDS
    from uwbbench.show.text.quantity import Quantity, undefined_titles
    from uwbbench.show.text.report import Tables
    from uwbbench.show.text.wording import set_aside_warning

    for sheet in (*Tables(report).published(), *Tables(report).limits()):
        print_table(sheet.title, sheet.columns, sheet.rows)
        for note in sheet.notes:
            typer.echo(f"  {note}")
        typer.echo()
    exhaustive = all(about["exhaustive"] for about, _ in report.estimates)
    groups: dict[tuple[str, tuple[str, ...]], list[list[str]]] = {}
    open_world: set[str] = set()
    bounded: set[str] = set()
    for about, estimates in report.estimates:
        if about["dataset"] in report.limits.datasets:  # test signals have the tables above, and no leader
            continue
        title = f"{about['dataset']}, {about['source'].upper()}"
        if not about["exhaustive"]:
            open_world.add(title)
        if about["bound"]:
            bounded.add(title)
        metrics = report.metrics.of(about["scoring"])
        main = metrics.ranking(exhaustive=exhaustive)  # the one that ranks comes first, and the time beside it
        brief = Quantity.of_all(metrics.brief).items()
        quantities = dict(sorted(brief, key=lambda item: item[0] != main))
        numbers = [number(estimates[name].value, by.digits, by.factor) for name, by in quantities.items()]
        numbers.insert(1, time_us(about, "p50_us"))
        numbers.append(number(about["chance_recall"], 3))
        label = report.label(about["detector"])
        heads = tuple(by.axis for by in quantities.values())
        groups.setdefault((title, heads), []).append([about["scoring"], about["table"], label, *numbers])
    for (title, heads), rows in groups.items():
        columns = ["scoring", "after", "detector", heads[0], "p50 (us)", *heads[1:], "chance recall"]
        shown = slice(None) if title in open_world else slice(-1)
        print_table(title, columns[shown], [row[shown] for row in rows])
        if any(not math.isnan(about["p50_us"]) for about, _ in report.estimates):
            typer.echo(f"  p50: median time of a frame, {report.timed}, on this machine only")
        if title in bounded:
            typer.echo(f"  {BOUNDS}")
        if title in open_world:
            missing = undefined_titles(report.metrics)
            typer.echo(f"  truth not exhaustive: no {missing}; errors are of matches; compare recall with chance")
        elif any("n/a" in row[shown] for row in rows):
            typer.echo("  n/a: undefined, as nothing was retained, nothing was to be found, or samples are too few")
    failed, unscored = len(report.failures), len(report.unscored)
    for entry in report.failures:
        what = " on ".join(name for name in (entry.detector, entry.capture or entry.dataset) if name)
        typer.echo(f"failed: {entry.kind}: {what}: {entry.reason}", err=True)
    for reason in dict.fromkeys(reason for _, _, reason in report.unscored):
        typer.echo(f"not scored: {reason}", err=True)
    print_notes([*map(set_aside_warning, report.set_aside), *report.notes])
    if failed or unscored:
        typer.echo(f"{failed} units failed, {unscored} could not be scored", err=True)
