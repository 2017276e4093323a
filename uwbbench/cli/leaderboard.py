"""Commands about several runs, and about whether a run can be believed: ``leaderboard``, ``verify``, ``diff``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from uwbbench.cli import options, render
from uwbbench.cli.exit_codes import CHECK_FAILED

RunPaths = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.", show_default=False)]


def leaderboard(
    runs: RunPaths,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="Site: a new folder, or one that this command made.",
            show_default=False,
        ),
    ] = None,
    json: options.Json = False,
) -> None:
    """Combine runs of several machines: a table, or a site.

    Every run is verified first; if something in one does not hold, nothing is written and the exit code is 1. Runs are
    compared where experiment, content of captures and scoring rules agree; times only as ratios to the common
    reference detector.
    """
    from uwbbench.results.leaderboard import Unverified
    from uwbbench.tools.leaderboard import leaderboard as combine

    try:
        combined = combine(runs, output, progress=_progress)
    except Unverified as error:
        if json:
            render.print_json({"problems": error.problems})
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(CHECK_FAILED) from error
    if output is not None:
        typer.echo(
            f"site written to {output}: {len(combined.files)} files, start with {output / 'index.html'}", err=True
        )
    if json:
        render.print_json(combined.to_dict())
        return
    if output is None:
        content = combined.content
        for section in content.sections:
            board = content.board(section.main)
            title = f"{content.names.suite(section.suite)}: {section.title}, {board.title}"
            render.print_table(title, board.columns, [[_joined(cell) for cell in row] for row in board.rows])
            for note in (content.sentence(section), *board.notes):
                typer.echo(f"  {note}")
            typer.echo()


def _progress(text: str) -> None:
    """Say on a terminal what is being done, as large runs take a while."""
    if sys.stderr.isatty():
        typer.echo(text, err=True)


def _joined(cell: object) -> str:
    return " ".join(part for part in (getattr(cell, "text", ""), getattr(cell, "small", "")) if part)


def verify(
    runs: RunPaths,
    rerun: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Run N units of each again, drawn at random, and compare what they find.",
            show_default=False,
        ),
    ] = None,
    data_dir: options.DataDir = None,
    json: options.Json = False,
) -> None:
    """Check that run folders are consistent.

    With --rerun also that detectors find what is stored. Consistent means: files have the hashes noted when the run
    ended, and identities, scores and counts follow from the manifest and from the stored detections. That damage and
    edits are found does not say where detections come from: who seals other detections is found by --rerun alone. Exits
    with 1 and a list if something does not hold, with 2 where a folder is no run folder.
    """
    from dataclasses import asdict

    from uwbbench.config.source import data_roots
    from uwbbench.run.folder import RunFolder
    from uwbbench.run.folder.verify import verify as check

    folders = [RunFolder(path) for path in runs]
    facts: dict[str, dict[str, Any]] = {}
    for folder in folders:
        _progress(f"verifying {folder.path}")
        verification = check(folder)
        of_run = {key: getattr(verification, key) for key in ("passed", "checked", "problems", "notes")}
        if rerun is not None and verification.passed:
            from uwbbench.run.rerun import rerun as run_again

            _progress(f"running {rerun} units of {folder.path} again")
            repeated = run_again(folder, rerun, data_roots(data_dir))
            of_run |= {"rerun": asdict(repeated), "passed": not repeated.problems}
        facts[str(folder.path)] = of_run
    if json:
        render.print_json(facts)
    else:
        for path, of_run in facts.items():
            _print_verification(path, of_run)
    if not all(of_run["passed"] for of_run in facts.values()):
        raise typer.Exit(CHECK_FAILED)


def _print_verification(path: str, of_run: dict[str, Any]) -> None:
    repeated = of_run.get("rerun")
    counts = ", ".join(f"{count} {what}" for what, count in of_run["checked"].items())
    consistent = not of_run["problems"]
    typer.echo(f"{path}: {'consistent' if consistent else 'DOES NOT HOLD'} ({counts})")
    for problem in of_run["problems"]:
        typer.echo(f"  {problem}")
    if repeated is not None:
        same = f"{repeated['identical']} identical, {repeated['equal']} equal up to rounding"
        verdict = "DOES NOT HOLD" if repeated["problems"] else "repeated"
        typer.echo(f"{path}: {verdict} ({len(repeated['units'])} units run again: {same})")
        for problem in repeated["problems"]:
            typer.echo(f"  {problem}")
    elif consistent:
        typer.echo("  its numbers follow from its detections; where these come from, --rerun N shows")
    render.print_notes(of_run["notes"])


def diff(
    first: Annotated[Path, typer.Argument(metavar="A", help="Run folder: before.", show_default=False)],
    second: Annotated[Path, typer.Argument(metavar="B", help="Run folder: after.", show_default=False)],
    scoring: Annotated[
        options.Scoring | None,
        typer.Option(help="By which frames are compared; A's first if left out.", show_default=False),
    ] = None,
    frames: Annotated[int, typer.Option(min=0, metavar="N", help="Flipped frames to list.")] = 20,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Picture of the worst flipped frame (.png, .svg, .pdf).", show_default=False),
    ] = None,
    data_dir: options.DataDir = None,
    exit_code: Annotated[bool, typer.Option("--exit-code", help="Exit with 1 where anything differs.")] = False,
    json: options.Json = False,
) -> None:
    """Compare two runs: what went in, then scores, then frames.

    What went in is configuration, code, data and machine. Both are judged by the rules of A, on the captures of equal
    content that both have. Differences are B minus A with paired intervals. No detector is run. Measured times and the
    machine never repeat: they are no difference for --exit-code.
    """
    from uwbbench.cli import differences
    from uwbbench.results.comparison import compare
    from uwbbench.run.folder import RunFolder
    from uwbbench.run.folder.identity import plain

    if figure is not None:
        options.format_of(figure, ".png", ".svg", ".pdf")
    comparison = compare(
        RunFolder(first), RunFolder(second), None if scoring is None else scoring.value, max(frames, 1)
    )
    if json:
        render.print_json(plain(comparison.to_dict()))
    else:
        differences.print_comparison(comparison, frames)
    if figure is not None:
        differences.draw_worst(comparison, figure, data_dir)
    if exit_code and comparison.differs:
        raise typer.Exit(CHECK_FAILED)


def register(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(epilog="Example: uwbbench diff before after --figure worst.png")(diff)
    app.command(epilog="Example: uwbbench leaderboard runs/* -o site")(leaderboard)
    app.command(epilog="Example: uwbbench verify demo --rerun 5")(verify)
