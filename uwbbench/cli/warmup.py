"""The command that compiles ahead: ``warmup``."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated

import typer

from uwbbench.cli import options, render

if TYPE_CHECKING:
    from uwbbench.tools.warmup import Warmed

UNITS_FAILED = 3


def warmup(
    detector: Annotated[
        list[str] | None,
        typer.Option(
            "--detector",
            "-d",
            metavar="NAME|FILE",
            help="Only this detector; may be repeated.",
            show_default="all that are installed",
        ),
    ] = None,
    json: options.Json = False,
) -> None:
    """Compile ahead what detectors need.

    So that no run has to wait for it. Every detector runs on small synthetic captures of all kinds. The machine code is
    kept beside the installed files where these can be written, else in the user's cache, or in the folder that
    UWBBENCH_CACHE_DIR names; it fits the processor that it was made on. These files are executed: name no folder that
    others can write to. Exits with 3 if a detector fails.
    """
    from uwbbench.detect.pipeline import load_detector
    from uwbbench.tools.warmup import installed_detectors, warm_up

    for name in detector or ():
        load_detector(name)  # a mistake ends the command before anything runs
    names = list(dict.fromkeys(detector)) if detector else installed_detectors()
    done = []
    for number, one in enumerate(warm_up(names), start=1):
        done.append(one)
        typer.echo(f"[{number}/{len(names)}] {_line(one)}", err=json or one.failure is not None)
    failed = sum(one.failure is not None for one in done)
    if json:
        render.print_json({"failed": failed, "detectors": [dataclasses.asdict(one) for one in done]})
    else:
        compiled, loaded = sum(one.compiled for one in done), sum(one.loaded for one in done)
        seconds = sum(one.seconds for one in done)
        typer.echo(f"{len(done)} detectors in {seconds:.1f} s: {compiled} functions compiled, {loaded} loaded")
    if failed:
        raise typer.Exit(UNITS_FAILED)


def _line(warmed: Warmed) -> str:
    if warmed.failure is not None:
        return f"{warmed.detector}: failed: {warmed.failure}"
    counts = (
        f"{warmed.compiled} compiled, {warmed.loaded} loaded"
        if warmed.compiled or warmed.loaded
        else "nothing more to compile"
    )
    return f"{warmed.detector}: {warmed.seconds:.1f} s, {counts}"


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench warmup --detector paper. In a Dockerfile: RUN uwbbench warmup")(warmup)
