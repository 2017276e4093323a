"""The command that lets changes in or not: ``gate``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from uwbbench.api.errors import StoreError
from uwbbench.api.text import one_line
from uwbbench.cli import options, render

if TYPE_CHECKING:
    from uwbbench.tools.gate import GateResult

STEP_SUMMARY = "GITHUB_STEP_SUMMARY"


def gate(
    file: Annotated[str, typer.Argument(metavar="GATE", help="Gate: a YAML file or a shipped name.")],
    data_dir: options.DataDir = None,
    settings: options.Settings = None,
    junit: Annotated[
        Path | None, typer.Option(metavar="FILE.xml", help="Write JUnit XML here.", show_default=False)
    ] = None,
    summary: Annotated[
        Path | None,
        typer.Option(metavar="FILE.md", help=f"Append Markdown here; else to ${STEP_SUMMARY}.", show_default=False),
    ] = None,
    json: options.Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Check a detector against limits, for CI.

    Speed against a base, missed deadlines, and accuracy. Exit codes: 0 pass; 1 regression; 2 inconclusive, or the file
    is wrong; 3 invalid: nothing could be measured, or the base differs from itself.
    """
    from uwbbench.api.override import parse_settings
    from uwbbench.run.folder.files import write_text
    from uwbbench.tools.gate import publish, read_gate, run_gate

    checked = read_gate(file, parse_settings(settings or ()), data_dir)
    summary = summary or (Path(os.environ[STEP_SUMMARY]) if os.environ.get(STEP_SUMMARY) else None)
    for target in (junit, summary):
        if target is not None and not target.absolute().parent.is_dir():
            raise StoreError(f"{target}: no folder to write it into")  # before the work, not after it
    result = run_gate(checked, (lambda _: None) if quiet else (lambda text: typer.echo(text, err=True)))
    if junit is not None:
        write_text(junit, publish.junit(result))
    if summary is not None:
        _append(summary, publish.markdown(result))
    if json:
        render.print_json(result.to_dict())
    else:
        _print(result)
    if result.verdict.exit_code:
        raise typer.Exit(result.verdict.exit_code)


def _append(path: Path, text: str) -> None:
    """Add to a file that other steps write to as well."""
    from uwbbench.run.folder.files import disk_errors

    with disk_errors(path, "written"), path.open("a", encoding="utf-8", errors="backslashreplace") as file:
        file.write(text)


def _print(result: GateResult) -> None:
    from uwbbench.tools.gate.publish import COLUMNS, rows

    render.print_table(f"gate {one_line(result.gate)}", COLUMNS, rows(result))
    render.print_facts({"head": one_line(result.head), "base": one_line(result.base)})
    typer.echo(f"{result.verdict.value.upper()} (exit code {result.verdict.exit_code})")


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench gate configs/gates/demo.yaml --junit gate.xml")(gate)
