"""Command ``export``: trajectories and maps of a run as files for other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from uwbbench.cli import options


class Kind(StrEnum):
    """What can be exported."""

    TRAJECTORY = "trajectory"
    TRUTH = "truth"
    MAP = "map"


_SUFFIXES = {Kind.TRAJECTORY: (".tum",), Kind.TRUTH: (".tum",), Kind.MAP: (".ply", ".csv")}


def export(
    kind: Annotated[Kind, typer.Argument(help="What to write.", show_default=False)],
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.", show_default=False)],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="A .tum, .ply or .csv file to write.")],
    detector: Annotated[str | None, typer.Option("--detector", "-d", metavar="NAME", help="One of the run's.")] = None,
    capture: Annotated[str | None, typer.Option(metavar="NAME", help="One of the run's drives.")] = None,
    dataset: Annotated[str | None, typer.Option(metavar="NAME", help="One of the run's datasets.")] = None,
    table: Annotated[
        options.Table, typer.Option(help="Poses as they were handed out on the way, or as they were known at the end.")
    ] = options.Table.FILTERING,
) -> None:
    """Write a trajectory or a map of a run for other programs. Nothing is run.

    trajectory: the poses of a detector with a mapper, as TUM file (.tum). truth: the true poses at the same steps, to
    hold the others against. map: what the mapper has mapped, as points and edges (.ply) or as a table (.csv).
    """
    from uwbbench.detect.tum import tum_text
    from uwbbench.results.drives import poses_of, true_poses
    from uwbbench.run.folder import RunFolder
    from uwbbench.run.folder.files import write_text
    from uwbbench.show import map_files
    from uwbbench.show.figures.source import from_run, mapped_of, one_of

    suffix = options.format_of(output, *_SUFFIXES[kind])
    result = one_of(from_run(RunFolder(run), detector, capture, dataset), str(run))
    mapped, header = mapped_of(result), result.header
    if kind is Kind.MAP:
        text = map_files.ply(mapped.map) if suffix == ".ply" else map_files.table(mapped.map)
    else:
        poses = poses_of(mapped, table.value, result.detector)
        of_steps = poses.pose if kind is Kind.TRAJECTORY else true_poses(header)[poses.index]
        text = tum_text(header.trajectory.timestamp_s[poses.index], of_steps)
    write_text(output, text)
    label = "SIMULATED run" if header.source == "simulated" else "run"
    typer.echo(f"{kind.value} of {result.detector} on {label} '{header.name}' written to {output}", err=True)


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench export trajectory RUN --detector map-occupancy -o run.tum")(export)
