"""What ``diff`` prints, in the order in which one asks: what went in, what came out, which frames."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from uwbbench.api.text import counted, printable
from uwbbench.cli import render
from uwbbench.show.text.numbers import interval, number
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.sheet import shown

if TYPE_CHECKING:
    from uwbbench.results.comparison import Comparison

LONGEST_VALUE = 100


def print_comparison(comparison: Comparison, most: int) -> None:
    """Print a comparison for people."""
    typer.echo(f"A: {comparison.first.path}\nB: {comparison.second.path}\n")
    _changes(comparison)
    _scores(comparison)
    _times(comparison)
    _flips(comparison, most)
    _causes(comparison, most)
    render.print_notes(comparison.notes)


def _changes(comparison: Comparison) -> None:
    rows = [
        (change.kind, _value(change.where), _value(change.before), _value(change.after))
        for change in comparison.changes
    ]
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


def _scores(comparison: Comparison) -> None:
    rows = []
    for change in comparison.changed_scores:
        dataset, source, scoring, table = change.board
        by, d = Quantity.of(change.metric, comparison.metrics[change.metric]), change.difference
        rows.append(
            (
                f"{shown(dataset)}, {source.upper()}",
                f"{scoring}, {table}",
                comparison.label(change.detector),
                by.axis,
                number(change.before, by.digits, by.factor),
                number(change.after, by.digits, by.factor),
                interval(d.value, d.low, d.high, by.digits, by.factor),
                number(change.adjusted, 3),
                f"{counted(change.captures, 'capture')}, {counted(d.groups, by.evidence)}",
            )
        )
    if rows:
        columns = ("dataset", "scoring", "detector", "metric", "A", "B", "B - A", "adjusted p", "n")
        render.print_table("What came out", columns, rows)
    else:
        typer.echo(f"What came out: no score differs ({len(comparison.scores)} compared)")


def _times(comparison: Comparison) -> None:
    rows = [
        (
            shown(change.dataset),
            shown(change.detector),
            *(interval(side.ratio, side.low, side.high, 2) for side in (change.before, change.after)),
            interval(change.factor, change.low, change.high, 2),
        )
        for change in comparison.times
    ]
    if rows:
        columns = ("dataset", "detector", "A", "B", "B / A")
        render.print_table("Time a frame, in times of the reference", columns, rows)
        typer.echo("  Intervals hold inside one run; runs of the same code have differed by 10 %.\n")


def _flips(comparison: Comparison, most: int) -> None:
    rows = [
        (comparison.label(detector), before, after, str(count))
        for detector, counter in comparison.flip_counts.items()
        for (before, after), count in counter.most_common()
    ]
    title = f"Frames that flipped ({comparison.scoring} scoring, of {comparison.compared_frames} compared)"
    if not rows:
        typer.echo(f"{title}: none")
        return
    typer.echo(title)
    render.print_table("", ("detector", "A", "B", "frames"), rows)
    if most:
        columns = ("detector", "dataset", "capture", "frame", "time (s)", "A", "B", "error A (cm)", "error B (cm)")
        render.print_table("The worst first", columns, list(_worst(comparison, most)))


def _causes(comparison: Comparison, most: int) -> None:
    grown = [change for change in comparison.causes if change.growth > 0]
    rows = [
        (shown(one.detector), one.error, one.cause, str(one.before), str(one.after), f"{one.growth:+d}")
        for one in [*grown, *(change for change in comparison.causes if change.growth < 0)][: most or None]
    ]
    if rows:
        title = f"Causes of errors ({comparison.scoring} scoring), those that grew first"
        render.print_table(title, ("detector", "error", "cause", "A", "B", "B - A"), rows)


def _worst(comparison: Comparison, most: int) -> Iterator[tuple[str, ...]]:
    for flip in comparison.worst[:most]:
        unit = flip.unit
        names = (comparison.label(unit.detector), shown(unit.dataset), shown(unit.capture))
        errors = [number(value, 1, 100) for value in (flip.error_before_m, flip.error_after_m)]
        yield (*names, str(flip.frame), f"{flip.time_s:.2f}", flip.before, flip.after, *errors)


def draw_worst(comparison: Comparison, target: Path, data_dir: Path | None) -> None:
    """Draw the worst flipped frame into a file, and print where it is; without a flip, print that there is none.

    Parameters
    ----------
    comparison : Comparison
    target : Path
        Picture; its suffix decides the format.
    data_dir : Path or None
        Folder in which captures are looked for first, to draw their samples.

    Raises
    ------
    StoreError
        If the file cannot be written.
    UwbbenchError
        If matplotlib is not installed.
    """
    from uwbbench.config.source import data_roots
    from uwbbench.show.figures import style
    from uwbbench.show.figures.flip import draw_flip

    if not comparison.worst:
        typer.echo("note: no frame flipped, so there is no picture", err=True)
        return
    rule = next(rule for rule in comparison.first.rules if rule.scoring == comparison.scoring)
    drawn, missing = draw_flip(
        comparison.worst[0], rule.of(comparison.worst[0].unit.dataset).region, data_roots(data_dir)
    )
    style.save(drawn, target)
    render.print_notes([missing] if missing else [])
    typer.echo(f"picture written to {target}", err=True)
