"""What ``diff`` prints, in the order in which one asks: what went in, what came out, which frames."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from uwbbench.api.text import printable
from uwbbench.cli import render
from uwbbench.show.text.numbers import interval, number
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.sheet import shown

if TYPE_CHECKING:
    from uwbbench.results.comparison import Comparison

LONGEST_VALUE = 100


def print_comparison(found: Comparison, most: int) -> None:
    """Print a comparison for people."""
    typer.echo(f"A: {found.first.path}\nB: {found.second.path}\n")
    _changes(found)
    _scores(found)
    _times(found)
    _flips(found, most)
    render.print_notes(found.notes)


def _changes(found: Comparison) -> None:
    rows = [(one.kind, _value(one.where), _value(one.before), _value(one.after)) for one in found.changes]
    if rows:
        render.print_table("What went in", ("of", "what", "A", "B"), rows)
    else:
        typer.echo("What went in: the same configuration, code, data and machine")


def _value(value: Any) -> str:
    """Value on one line; a hash by its first digits."""
    if value is None:
        return "none"
    text = value if isinstance(value, str) else json.dumps(value)
    text = text[:12] if len(text) == 64 and set(text) <= set("0123456789abcdef") else text
    return printable(text, LONGEST_VALUE)


def _scores(found: Comparison) -> None:
    rows = []
    for one in found.changed_scores:
        dataset, source, scoring, table = one.board
        by, d = Quantity.of(one.metric, found.metrics[one.metric]), one.difference
        rows.append(
            (
                f"{shown(dataset)}, {source.upper()}",
                f"{scoring}, {table}",
                shown(one.detector),
                by.axis,
                number(one.before, by.digits, by.factor),
                number(one.after, by.digits, by.factor),
                interval(d.value, d.low, d.high, by.digits, by.factor),
                number(one.adjusted, 3),
                f"{one.captures} captures, {d.groups} groups",
            )
        )
    if rows:
        columns = ("dataset", "scoring", "detector", "metric", "A", "B", "B - A", "adjusted p", "n")
        render.print_table("What came out", columns, rows)
    else:
        typer.echo(f"What came out: no score differs ({len(found.scores)} compared)")


def _times(found: Comparison) -> None:
    rows = [
        (
            shown(one.dataset),
            shown(one.detector),
            *(interval(side.ratio, side.low, side.high, 2) for side in (one.before, one.after)),
            interval(one.factor, one.low, one.high, 2),
        )
        for one in found.times
    ]
    if rows:
        columns = ("dataset", "detector", "A", "B", "B / A")
        render.print_table("Time a frame, in times of the reference", columns, rows)
        typer.echo("  Intervals hold inside one run; runs of the same code have differed by 10 %.\n")


def _flips(found: Comparison, most: int) -> None:
    rows = [
        (shown(detector), before, after, str(count))
        for detector, counter in found.flip_counts.items()
        for (before, after), count in counter.most_common()
    ]
    title = f"Frames that flipped ({found.scoring} scoring, of {found.compared_frames} compared)"
    if not rows:
        typer.echo(f"{title}: none")
        return
    typer.echo(title)
    render.print_table("", ("detector", "A", "B", "frames"), rows)
    if most:
        columns = ("detector", "dataset", "capture", "frame", "time (s)", "A", "B", "error A (cm)", "error B (cm)")
        render.print_table("The worst first", columns, list(_worst(found, most)))


def _worst(found: Comparison, most: int) -> Iterator[tuple[str, ...]]:
    for one in found.worst[:most]:
        names = (shown(one.unit.detector), shown(one.unit.dataset), shown(one.unit.capture))
        errors = [number(value, 1, 100) for value in (one.error_before_m, one.error_after_m)]
        yield (*names, str(one.frame), f"{one.time_s:.2f}", one.before, one.after, *errors)


def draw_worst(found: Comparison, target: Path, data_dir: Path | None) -> None:
    """Draw the worst flipped frame into a file."""
    from uwbbench.config.source import data_roots
    from uwbbench.show.figures import style
    from uwbbench.show.figures.flip import draw_flip

    if not found.worst:
        typer.echo("note: no frame flipped, so there is no picture", err=True)
        return
    rule = next(rule for rule in found.first.rules if rule.scoring == found.scoring)
    drawn, missing = draw_flip(found.worst[0], rule.region, data_roots(data_dir))
    style.save(drawn, target)
    render.print_notes([missing] if missing else [])
    typer.echo(f"picture written to {target}", err=True)
