"""Command ``plot``: pictures of captures, detectors and runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from uwbbench.api.errors import ConfigError
from uwbbench.cli import options

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from uwbbench.show.figures.draw import Choices

KINDS_HELP = "Kind: cir, radargram, properties, pipeline, cdf, map or trajectory."


def plot(
    kind: Annotated[str, typer.Argument(metavar="KIND", help=KINDS_HELP, show_default=False)],
    source: Annotated[
        Path, typer.Argument(metavar="CAPTURE|RUN", help="Capture file (.h5) or run folder.", show_default=False)
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Picture: .png, .svg or .pdf. NAME-KIND.png if left out."),
    ] = None,
    detector: Annotated[
        str | None,
        typer.Option("--detector", "-d", metavar="NAME|FILE", help="Detector to run, or one of the run's."),
    ] = None,
    capture: Annotated[str | None, typer.Option(metavar="NAME", help="One of the run's captures.")] = None,
    dataset: Annotated[str | None, typer.Option(metavar="NAME", help="One of the run's datasets.")] = None,
    receiver: options.Receiver = None,
    frame: Annotated[int | None, typer.Option(min=0, metavar="N", help="Frame, for cir.")] = None,
    scoring: Annotated[options.Scoring | None, typer.Option(help="How detections are counted, for cdf.")] = None,
    gate_m: Annotated[
        float | None, typer.Option(metavar="METRES", help="Largest error of a true detection, for cdf and properties.")
    ] = None,
    table: Annotated[
        options.Table | None, typer.Option(help="Which errors, for cdf; or which poses of a mapper, for the others.")
    ] = None,
    aligned: Annotated[
        bool | None,
        typer.Option("--aligned", help="Lay poses and map over the truth as fits best, not by their start."),
    ] = None,
    settings: options.Settings = None,
) -> None:
    """Draw a picture for print. A capture is drawn with a detector that runs on it; from a run folder nothing is run.

    cir: one frame with first path, noise floor, and peaks with prominence, width and fate. radargram: time and range,
    with truth and detections. properties: peak prominence and width against distance, by material. pipeline: from all
    peaks through the filters to clusters, from above. cdf: distribution of the absolute errors. map: clustered points,
    or what a mapper has mapped, with true outlines and robot path. trajectory: paths of mappers, and errors over time.
    """
    from uwbbench.run.folder import RunFolder
    from uwbbench.show.figures import style
    from uwbbench.show.figures.draw import Choices, check_kind, draw_run

    choices = Choices(
        frame, None if scoring is None else scoring.value, gate_m, None if table is None else table.value, aligned
    )
    check_kind(kind, choices)
    target = output or Path(f"{source.resolve().stem}-{kind}.png")
    options.format_of(target, ".png", ".svg", ".pdf")
    with style.styled():  # refuses before a detector has run, where matplotlib is missing
        pass
    if source.is_dir():
        _refuse({"--receiver": receiver, "--set": settings}, f"is for a capture file; {source} is a run folder")
        drawn = draw_run(kind, RunFolder(source), choices, detector, capture, dataset)
    else:
        _refuse({"--capture": capture, "--dataset": dataset}, f"chooses from a run folder; {source} is none")
        drawn = _of_capture(kind, source, choices, detector, receiver, settings)
    style.save(drawn, target)
    typer.echo(f"{kind} written to {target}", err=True)


def _refuse(given: dict[str, object], reason: str) -> None:
    """Refuse options that would change nothing."""
    for option, value in given.items():
        if value is not None:
            raise ConfigError(f"{option} {reason}")


def _of_capture(
    kind: str,
    source: Path,
    choices: Choices,
    detector: str | None,
    receiver: str | None,
    settings: list[str] | None,
) -> Figure:
    import uwbbench
    from uwbbench.api.override import parse_settings
    from uwbbench.show.figures.draw import draw_capture

    changes = parse_settings(settings or ())
    if changes and detector is None:
        raise ConfigError("--set changes a detector: give one with --detector")
    pipeline = None if detector is None else uwbbench.load_detector(detector, changes=changes)
    return draw_capture(kind, uwbbench.open_capture(source, receiver), pipeline, choices)


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench plot radargram run.h5 --detector paper -o radargram.pdf")(plot)
