"""Commands about whole experiments: ``run``, ``report``, ``rescore``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from uwbbench.api.errors import ConfigError
from uwbbench.cli import options, render
from uwbbench.cli.exit_codes import INTERRUPTED, UNITS_FAILED
from uwbbench.show import written
from uwbbench.show.written import Format

if TYPE_CHECKING:
    from uwbbench.run import Progress
    from uwbbench.run.experiment import Experiment
    from uwbbench.run.folder import RunFolder

RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.", show_default=False)]


def run(
    experiment: Annotated[str, typer.Argument(metavar="EXPERIMENT", help="Experiment: a YAML file or a shipped name.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="New run folder; runs/NAME-TIME if left out.", show_default=False),
    ] = None,
    data_dir: options.DataDir = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Processes; all cores if left out.", show_default=False)
    ] = None,
    resume: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Run folder to continue instead.", show_default=False)
    ] = None,
    detector: Annotated[
        list[str] | None,
        typer.Option(
            "--detector",
            "-d",
            metavar="NAME|FILE",
            help="Detector to run instead of those of the experiment; may be repeated.",
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="The smaller version of it, for a first look.")] = False,
    seeds: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw its captures from these secret seeds: its private half."),
    ] = None,
    isolation: Annotated[
        bool,
        typer.Option(
            "--isolation/--no-isolation",
            help="Each detector in processes of its own, with limits. Without, for a debugger: a detector can then "
            "change what others find, and end or hang the run.",
        ),
    ] = True,
    settings: options.Settings = None,
    json: options.Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on the terminal.")] = False,
) -> None:
    """Run an experiment: every detector on every capture.

    Prints a leaderboard and leaves a run folder. A detector or capture that fails is a row with its reason; the exit
    code is then 3. A suite, whose captures are frozen, stops at a capture that was changed.
    """
    from uwbbench.api.locate import is_path
    from uwbbench.api.override import parse_settings
    from uwbbench.run import Interrupted, run_experiment
    from uwbbench.run.experiment import read_experiment

    if out is not None and resume is not None:
        raise ConfigError("--out makes a new run folder and --resume continues one; give one of them")
    changes = parse_settings(settings or ())
    if detector:
        changes["detectors"] = [str(Path(name).resolve()) if is_path(name) else name for name in detector]
    plan = read_experiment(experiment, changes, data_dir, quick=quick, seeds=seeds)
    _say_left_out(plan)
    try:
        with _progress_bar(quiet) as advance:
            folder = run_experiment(
                plan, resume or out, jobs=jobs, resume=resume is not None, isolated=isolation, progress=advance
            )
    except Interrupted as stop:
        typer.echo(str(stop), err=True)
        raise typer.Exit(INTERRUPTED) from stop
    for label, reason in folder.manifest["skipped"].items():
        typer.echo(f"skipped: {label} (optional): {reason}", err=True)
    _conclude(folder, data_dir, json=json)
    if any(entry.status == "failed" for entry in folder.entries()):
        raise typer.Exit(UNITS_FAILED)


def _say_left_out(plan: Experiment) -> None:
    """Say which datasets a private half lacks."""
    for label in plan.left_out:
        typer.echo(f"left out: {label}, which cannot be drawn from seeds", err=True)


@contextmanager
def _progress_bar(quiet: bool) -> Iterator[Callable[[Progress], None] | None]:
    """Progress on stderr where that is a terminal, else nothing."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.description}"))
    with Bar(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("starting", total=None)
        failures = 0

        def advance(progress: Progress) -> None:
            nonlocal failures
            failures += progress.entry.status == "failed"
            failed = f"{failures} failed, " if failures else ""
            now = escape(f"{progress.entry.kind}: {progress.entry.detector} on {progress.entry.capture}")
            bar.update(task, completed=progress.done, total=progress.total, description=f"{failed}{now}")

        yield advance


def report(
    run: RunPath,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE|DIR", help="Where to write; the suffix decides the format."),
    ] = None,
    form: Annotated[
        Format | None, typer.Option("--format", help="Format; csv writes a folder of tables.", show_default=False)
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write every chart as PNG, SVG and Vega-Lite.", show_default=False),
    ] = None,
    data_dir: options.DataDir = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is no report.")] = False,
    json: options.Json = False,
) -> None:
    """Print the tables of a run, or write its report.

    As a page (.html), Markdown, CSV, LaTeX or JSON. No detector is run.

    The page is one file that opens offline. Captures that are at hand are opened again to draw their samples.
    """
    from uwbbench.config.source import data_roots
    from uwbbench.results import Report, read_safely
    from uwbbench.run.folder import RunFolder
    from uwbbench.show.text import formats

    chosen = _format_of(output, form, json=json)
    roots = data_roots(data_dir)
    with read_safely(run):
        run_report = Report(RunFolder(run))
        if chosen is None and figures is None:
            render.print_report(run_report)
        if figures is not None:
            drawn = written.write_figures(run_report, figures, roots, force=force)
            typer.echo(f"{len(drawn)} figures written to {figures}", err=True)
        if chosen is not None and output is not None:
            written.write(run_report, output, chosen, roots, force=force)
            typer.echo(f"report written to {output}", err=True)
        elif chosen is Format.JSON:
            render.print_json(formats.as_json(run_report))
        elif chosen is not None:
            typer.echo(written.as_text(run_report, chosen, roots), nl=False)


def _format_of(output: Path | None, form: Format | None, *, json: bool) -> Format | None:
    """Format that the options ask for; None where the tables are to be printed."""
    if json and (output is not None or form not in (None, Format.JSON)):
        raise ConfigError("--json prints JSON; to write a file give -o with a suffix, or --format")
    if json:
        return Format.JSON
    if form is None and output is not None:
        form = written.format_of(output)
    if output is None and form in (Format.HTML, Format.CSV):
        raise ConfigError(
            f"--format {form.value} writes {'a file' if form is Format.HTML else 'a folder'}: name it by -o"
        )
    return form


def rescore(
    run: RunPath,
    scoring: Annotated[
        list[options.Scoring] | None,
        typer.Option(help="Scoring; may be repeated. As before if left out.", show_default=False),
    ] = None,
    gate_m: Annotated[
        float | None,
        typer.Option(metavar="METRES", help="Largest error of a true detection. As before if left out."),
    ] = None,
    surface: Annotated[
        options.Surface | None,
        typer.Option(help="What errors of positions are distances to. As before if left out.", show_default=False),
    ] = None,
    json: options.Json = False,
) -> None:
    """Score a run again by other rules. Nothing is run: the stored detections are judged anew."""
    from dataclasses import replace

    from uwbbench.run import rescore as score_again
    from uwbbench.run.folder import RunFolder

    folder = RunFolder(run)
    before = folder.rules
    chosen = scoring or [options.Scoring(rule.scoring) for rule in before]
    changed = before[0] if gate_m is None else replace(before[0], gate_m=gate_m)
    changed = changed if surface is None else replace(changed, surface=surface.value)
    where = {} if scoring else {rule.scoring: rule.only for rule in before}
    rules = [replace(changed, scoring=one.value, only=where.get(one.value)) for one in dict.fromkeys(chosen)]
    score_again(folder, rules)
    _conclude(folder, None, json=json)


def _conclude(folder: RunFolder, data_dir: Path | None, *, json: bool) -> None:
    """Write the report into the run folder, as Markdown and as a page, and show its leaderboard."""
    from uwbbench.config.source import data_roots
    from uwbbench.results import Report, read_safely
    from uwbbench.show.text import formats

    with read_safely(folder.path):
        run_report = Report(folder)
        if json:
            render.print_json(formats.as_json(run_report))
        else:
            render.print_leaderboard(run_report)
        path, missing = written.write_into_run(run_report, data_roots(data_dir))
        render.print_notes([missing] if missing else [])
        if json:
            return
    typer.echo(f"run folder: {folder.path} (all tables: {path}, or 'uwbbench report {folder.path}')")


def register(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(epilog="Example: uwbbench run configs/experiments/demo.yaml --out demo")(run)
    app.command(epilog="Example: uwbbench report demo -o demo.html")(report)
    app.command(epilog="Example: uwbbench rescore demo --scoring object --gate-m 0.1")(rescore)
