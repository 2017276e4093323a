"""Commands for authors of plugins: ``new`` writes a package, ``check`` runs conformance checks on a plugin."""

from __future__ import annotations

import contextlib
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from uwbbench.cli import options, render
from uwbbench.cli.exit_codes import CHECK_FAILED

if TYPE_CHECKING:
    from collections.abc import Iterable

    from uwbbench.api.registry import AuthoredKind
    from uwbbench.tools.check import Conformance


class KindOption(StrEnum):
    """What can be made and checked."""

    STAGE = "stage"
    MAPPER = "mapper"
    DETECTOR = "detector"
    DATASET = "dataset"
    METRIC = "metric"


def new(
    kind: Annotated[KindOption, typer.Argument(help="What to make.", show_default=False)],
    name: Annotated[str, typer.Argument(help="Name to register, such as clutter.mine.", show_default=False)],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder that the package's own folder goes into.")
    ] = Path(),
) -> None:
    """Write a plugin package whose tests pass.

    It can be installed, and holds working code to start from. Nothing that exists is overwritten.
    """
    from uwbbench.tools.scaffold import write_package

    target = write_package(kind.value, name, output)
    typer.echo(f"{kind.value} '{name}' written to {target}; next:\n")
    typer.echo(f"    pip install --editable '{target}[test]'")
    typer.echo(f"    uwbbench check {name} --kind {kind.value}")
    typer.echo(f"    python -m pytest {target}")


def check(
    name: Annotated[
        str | None, typer.Argument(help="Stage, detector, dataset or metric; or a detector file.", show_default=False)
    ] = None,
    kind: Annotated[
        KindOption | None, typer.Option(help="Only this kind, where several bear the name.", show_default=False)
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="CHECK", help="Only this check; may be repeated.", show_default=False),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Examine it with this parameter; may be repeated."),
    ] = None,
    data_dir: options.DataDir = None,
    show_checks: Annotated[bool, typer.Option("--list", help="List the checks instead.")] = False,
    traceback: Annotated[bool, typer.Option("--traceback", help="Show where the plugin raised.")] = False,
    json: options.Json = False,
) -> None:
    """Check that a plugin does what its kind must do.

    Each failure is explained: what was expected, what was found, and where to read more. Exits with 1 if a check fails.
    """
    from uwbbench.api.override import parse_settings
    from uwbbench.api.registry import AUTHORED_KINDS
    from uwbbench.config.source import data_roots
    from uwbbench.tools.check import examine, kinds_of, subject_of

    kinds = (kind.value,) if kind else AUTHORED_KINDS if name is None else kinds_of(name)
    if show_checks:
        _list(kinds, json=json)
        return
    if name is None:
        raise typer.BadParameter("name a plugin to check, or ask for --list")
    params = parse_settings(settings or ())
    with contextlib.redirect_stdout(sys.stderr):  # what a plugin prints must not spoil the output
        outcomes = [examine(subject_of(one, name, params, data_roots(data_dir)), only or None) for one in kinds]
    if json:
        render.print_json([one.to_dict() for one in outcomes])
    else:
        for one in outcomes:
            _print(one, traceback=traceback)
    if not all(one.passed for one in outcomes):
        raise typer.Exit(CHECK_FAILED)


def _list(kinds: Iterable[AuthoredKind], *, json: bool) -> None:
    from uwbbench.tools.check import all_checks

    listed = {kind: [(one.name, one.asked, one.read_more) for one in all_checks(kind)] for kind in kinds}
    columns = ("check", "what and why", "read more")
    if json:
        render.print_json(
            {kind: [dict(zip(columns, row, strict=True)) for row in rows] for kind, rows in listed.items()}
        )
        return
    for kind, rows in listed.items():
        render.print_table(f"checks of a {kind}", columns[:2], [row[:2] for row in rows])


def _print(conformance: Conformance, *, traceback: bool) -> None:
    rows = [(one.check.name, one.status, one.detail or one.found) for one in conformance.results]
    render.print_table(f"{conformance.kind} {conformance.name}", ("check", "outcome", "detail"), rows)
    for one in conformance.results:
        if not one.passed:
            typer.echo(f"{one.explain()}\n")
            if traceback and one.trace:
                typer.echo(one.trace)
    counts = [f"{conformance.count(status)} {status}" for status in ("passed", "failed", "error", "not applicable")]
    typer.echo(f"{conformance.kind} '{conformance.name}': {', '.join(counts)}")


def register(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(epilog="Example: uwbbench new stage clutter.mine -o plugins")(new)
    app.command(epilog="Example: uwbbench check peaks; uwbbench check my-detector --only stream-equals-batch")(check)
