"""The command that calibrates scenes: ``fit-scene``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from uwbbench.cli import options, render
from uwbbench.cli.exit_codes import CHECK_FAILED
from uwbbench.cli.progress import progress


def fit_scene(
    file: Annotated[str, typer.Argument(metavar="FIT", help="Fit: a YAML file or a shipped name.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="New folder for the calibrated files.")],
    settings: options.Settings = None,
    json: options.Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Fit scenes and their robot to known figures of a detector.

    Searches the free parameters on some random draws, writes the calibrated scenes, and shows every target beside what
    these files give on draws that the search did not see. Exit code 1 if a target is out of reach.
    """
    from uwbbench.api.override import parse_settings
    from uwbbench.tools.fit import fit, message, read_fit, sheets, to_dict, write_outcome
    from uwbbench.tools.tune import new_folder

    plan = read_fit(file, parse_settings(settings or ()))
    folder = new_folder(plan.name, out)
    with progress(quiet, lines=True) as report_progress:
        outcome = write_outcome(fit(plan, report_progress), folder, report_progress)
    if json:
        render.print_json({**to_dict(outcome), "folder": str(folder)})
    else:
        for sheet in sheets(outcome):
            render.print_table(sheet.title, sheet.columns, sheet.rows)
            for note in sheet.notes:
                typer.echo(f"* {note}")
            typer.echo()
        typer.echo(f"calibrated files, residuals and all trials: {folder}")
    if not outcome.passed:
        typer.echo(message(outcome), err=True)
        raise typer.Exit(CHECK_FAILED)


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench fit-scene configs/fits/plates.yaml -o fitted")(fit_scene)
