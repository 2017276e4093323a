"""Command ``simulate``: a scene becomes a capture file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from uwbbench.api.errors import ConfigError
from uwbbench.cli import options, render


def simulate(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="Scene YAML, or the name of a shipped scene.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.h5", help="Capture file to write.")],
    settings: options.Settings = None,
    run: Annotated[int, typer.Option(metavar="N", min=1, help="Number of the run; each has its own noise.")] = 1,
    background: Annotated[
        bool, typer.Option("--background", help="With a background: the run without its objects, noise drawn anew.")
    ] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Threads; the result does not depend on it.")] = 1,
    json: options.Json = False,
) -> None:
    """Simulate a scene into a capture file."""
    from uwbbench.api import registry
    from uwbbench.api.capture_writing import write_capture
    from uwbbench.api.locate import find_config
    from uwbbench.api.override import parse_settings
    from uwbbench.config.source import open_dataset

    options.format_of(output, ".h5")
    path = find_config("scenes", scene).resolve()
    params = {"scenes": [str(path)], "set": parse_settings(settings or ()), "runs": run, "background": background}
    dataset: Any = open_dataset(registry.default("dataset.scenes"), params, [path.parent])
    names = [name for name in dataset.runs() if name.endswith(f"/{run}")]
    if len(names) > 1:
        shown = ", ".join(name.split("/")[1] for name in names[:6])
        raise ConfigError(f"{path}: varies into {len(names)} captures ({shown}, ...); fix what 'vary' lists with --set")
    simulation = dataset.simulate(names[0], threads=jobs)
    write_capture(output, *(replace(capture, name=names[0]) for capture in simulation.captures))
    record = {"output": str(output), "source": "simulated", **simulation.record()}
    if json:
        render.print_json(record)
        return
    for receiver, terms in record["receivers"].items():
        rows = [[term["name"], *_facts(term)] for term in terms]
        columns = ("term", "kept", "reason", "bound over noise", "pulses", "time")
        render.print_table(f"receiver {receiver}", columns, rows)
    first = simulation.captures[0]
    size = f"{len(first)} frames of {first.radar.taps} taps{', with background' if background else ''}"
    typer.echo(f"simulated capture '{names[0]}', {size}, written to {output}")


def _facts(term: dict[str, Any]) -> list[str]:
    level = "n/a" if term["level_db"] is None else f"{term['level_db']:+.1f} dB"
    return [
        "yes" if term["kept"] else "no",
        term["reason"],
        level,
        str(term["pulses"]),
        f"{term['seconds'] * 1e3:.1f} ms",
    ]


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench simulate configs/scenes/plate.yaml -o plate.h5")(simulate)
