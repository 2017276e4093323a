"""The command that chooses thresholds: ``tune``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from uwbbench.cli import options, render
from uwbbench.cli.progress import progress

if TYPE_CHECKING:
    from uwbbench.tools.tune import TuneOutcome


def tune(
    file: Annotated[str, typer.Argument(metavar="TUNE", help="Tuning: a YAML file or a shipped name.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="DIR", help="New folder; tunings/NAME-TIME if left out.", show_default=False
        ),
    ] = None,
    experiment: Annotated[
        str | None,
        typer.Option(
            metavar="EXPERIMENT", help="Refuse to tune on captures that this experiment scores.", show_default=False
        ),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the stable zone: .png, .svg or .pdf.", show_default=False),
    ] = None,
    data_dir: options.DataDir = None,
    settings: options.Settings = None,
    json: options.Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on the terminal.")] = False,
) -> None:
    """Tune a detector's thresholds.

    The highest F1 wins, then the lowest RMSE, for each material, channel and overall, and captures held out show what
    that is worth. Leaves a folder with a detector for each, the scores of all sets, and how far the thresholds may be
    off (the stable zone).
    """
    from uwbbench.api.override import parse_settings
    from uwbbench.tools.tune import new_folder, publish, read_tuning, to_dict
    from uwbbench.tools.tune import tune as run_tuning

    if figure is not None:
        options.format_of(figure, ".png", ".svg", ".pdf")
    tuning = read_tuning(file, parse_settings(settings or ()), data_dir, experiment)
    if figure is not None:
        _require_grid(tuning.sweep is not None)
    folder = new_folder(tuning.name, out)
    with progress(quiet) as report_progress:
        outcome = run_tuning(tuning, report_progress)
    files = publish(outcome, folder)
    if figure is not None:
        _draw(outcome, figure)
    if json:
        render.print_json({**to_dict(outcome), "folder": str(folder), "detectors": [str(path) for path in files]})
        return
    _print(outcome)
    typer.echo(f"tuned detectors, all sets and manifest: {folder}")


def _require_grid(is_grid: bool) -> None:
    from uwbbench.api.errors import ConfigError

    if not is_grid:
        raise ConfigError("--figure draws the stable zone of a grid; a search has none")
    from uwbbench.show.figures.style import styled

    with styled():  # refuses now, not after the work, where matplotlib is missing
        pass


def _draw(outcome: TuneOutcome, figure: Path) -> None:
    from uwbbench.show.figures import style
    from uwbbench.tools.tune.figure import draw_stable_zone

    style.save(draw_stable_zone(outcome), figure)
    typer.echo(f"stable zone drawn in {figure}", err=True)


def _print(outcome: TuneOutcome) -> None:
    from uwbbench.tools.tune import sheets

    for sheet in sheets(outcome):
        render.print_table(sheet.title, sheet.columns, sheet.rows)
        for note in sheet.notes:
            typer.echo(f"* {note}")
        typer.echo()


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench tune configs/tuning/plates.yaml -o tuned --figure tuned.png")(tune)
