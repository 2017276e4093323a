"""The command that makes weights: ``train``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from uwbbench.cli import options, render
from uwbbench.cli.progress import progress


def train(
    file: Annotated[str, typer.Argument(metavar="TRAINING", help="Training: a YAML file or a shipped name.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="Weights file to write (.safetensors).")],
    experiment: Annotated[
        str | None,
        typer.Option(
            metavar="EXPERIMENT", help="Refuse to learn from captures that this experiment scores.", show_default=False
        ),
    ] = None,
    data_dir: options.DataDir = None,
    settings: options.Settings = None,
    json: options.Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Train the step of a detector that learns.

    Writes what was learned as plain arrays, with the hash of every capture behind it, and a summary beside it that says
    what that is worth on captures that were not learned from. No recording, scene or room is on two sides.
    """
    from uwbbench.api.override import parse_settings
    from uwbbench.tools.train import checked_target, publish, read_training, sheets, to_dict
    from uwbbench.tools.train import train as run_training

    target = checked_target(out)
    training = read_training(file, parse_settings(settings or ()), data_dir, experiment)
    with progress(quiet, lines=True) as report_progress:
        trained = run_training(training, report_progress)
    summary = publish(trained, target)
    if json:
        render.print_json({**to_dict(trained), "weights": str(target), "summary": str(summary)})
        return
    for sheet in sheets(trained):
        render.print_table(sheet.title, sheet.columns, sheet.rows)
        for note in sheet.notes:
            typer.echo(f"* {note}")
        typer.echo()
    typer.echo(f"weights: {target}; summary: {summary}")


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench train configs/training/coupling-extra-trees.yaml -o mine.safetensors")(train)
