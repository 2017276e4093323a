"""Commands that run one detector on one capture: ``score``, ``detect``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from uwbbench.api.errors import ConfigError, ScoringError
from uwbbench.cli import options, render

if TYPE_CHECKING:
    from uwbbench.api.capture import Capture
    from uwbbench.api.detections import Detections
    from uwbbench.detect.pipeline import Pipeline


def score(
    capture: options.CaptureFile,
    detector: Annotated[
        str | None,
        typer.Option("--detector", "-d", metavar="NAME|FILE", help="Detector by name, or a YAML file."),
    ] = None,
    results: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="What any program has found: .csv or .parquet.", show_default=False),
    ] = None,
    scoring: Annotated[options.Scoring, typer.Option(help="How detections are counted.")] = options.Scoring.FRAME,
    gate_m: Annotated[float, typer.Option(metavar="METRES", help="Largest error of a true detection.")] = 0.20,
    receiver: options.Receiver = None,
    settings: options.Settings = None,
    latency: Annotated[bool, typer.Option("--latency/--no-latency", help="Measure the time a frame takes.")] = True,
    json: options.Json = False,
) -> None:
    """Score a detector, or a results file, on a capture with truth.

    A detector is timed, too; any program may have written the results file.
    """
    import uwbbench
    from uwbbench.measure.accuracy.scoring import ScoringRules
    from uwbbench.run.folder.identity import plain
    from uwbbench.run.leaks import refuse_trained_on

    ScoringRules(scoring.value, gate_m)  # refuses a wrong gate before the detector has run
    if (detector is None) == (results is None):
        raise ConfigError("give either --detector, to run one, or --results, to read what another program has found")
    if results is not None and settings:
        raise ConfigError("--set changes a detector, and --results reads what one has found: give one of them")
    opened = uwbbench.open_capture(capture, receiver)
    if opened.truth is None:
        raise ScoringError(f"{capture}: the capture has no ground truth; it can be detected on, but not scored")
    if detector is not None:
        pipeline = _loaded(detector, settings)
        refuse_trained_on([pipeline.config], [(opened.name, opened)])
        detections = pipeline.run(
            opened, candidates=scoring is options.Scoring.PEAK, handed_out=scoring is options.Scoring.LATEST
        )
        name, why = pipeline.name, "are invalid (a sample is not finite)"
        times = _latency_us(capture, opened, pipeline) if latency and len(opened) else None
    elif results is not None:
        detections, times = _read(results, opened, latency=latency)
        name, why = results.stem, "are invalid, or not listed as processed"
    invalid = len(opened) - len(detections.processed)
    notes = [f"{invalid} of {len(opened)} frames {why}: not scored"] if invalid else []
    tables = uwbbench.score(detections, opened, scoring=scoring.value, gate_m=gate_m).to_dict()
    result = {
        "detector": name,
        "capture": opened.name,
        "frames": len(opened),
        "filtering": tables["filtering"],
        "mapping": tables["mapping"],
        "latency_us": times,
        "scoring": tables["scoring"],
        "gate_m": tables["gate_m"],
        "receiver": opened.radar.receiver,
        "source": opened.source,
        "results_file": None if results is None else str(results),
        "invalid_frames": invalid,
        "notes": [*notes, *detections.notes],
    }
    if json:
        render.print_json(plain(result))
    else:
        render.print_scores(result)


def _latency_us(path: Path, opened: Capture, pipeline: Pipeline) -> dict[str, Any]:
    """Times in microseconds, measured in a fresh process, the number of calls behind them, and the age of answers."""
    from uwbbench.config.source import CaptureRef
    from uwbbench.measure.latency import measure
    from uwbbench.measure.latency.settings import LatencyModel

    receiver = opened.radar.receiver if len(opened.receivers) > 1 else None
    measured = measure(
        CaptureRef.of_file(path, receiver), pipeline.config, LatencyModel.model_validate({"reference": None})
    ).to_dict()
    times = {key.removesuffix("_us"): value for key, value in measured.items() if key.endswith("_us")}
    step = {f"step_{name.removesuffix('_us')}": value for name, value in (measured["step"] or {}).items()}
    return {"n": measured["n"], **times, **step, "age": measured["age"]}


def _read(path: Path, opened: Capture, *, latency: bool) -> tuple[Detections, dict[str, Any] | None]:
    """Detections of a results file, and its times in microseconds, if it reports them and they are asked for."""
    from uwbbench.detect.results_file import read_results
    from uwbbench.run.folder.reported import reported_times

    stored = read_results(path, opened)
    if not latency or stored.times_us is None or not len(stored.times_us):
        return stored.detections, None
    times = {key.removesuffix("_us"): value for key, value in reported_times(stored.times_us).items()}
    return stored.detections, {**times, "as_reported": True}


def _loaded(detector: str, settings: list[str] | None) -> Pipeline:
    import uwbbench
    from uwbbench.api.override import parse_settings

    return uwbbench.load_detector(detector, changes=parse_settings(settings or ()))


def _open(path: Path, receiver: str | None, detector: str, settings: list[str] | None) -> tuple[Capture, Pipeline]:
    import uwbbench

    pipeline = _loaded(detector, settings)
    return uwbbench.open_capture(path, receiver), pipeline


def detect(
    capture: options.CaptureFile,
    detector: options.Detector,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Table to write: .csv or .parquet.")],
    receiver: options.Receiver = None,
    settings: options.Settings = None,
) -> None:
    """Write what a detector finds on a capture. No ground truth is needed."""
    from uwbbench.run.folder.files import replacing

    suffix = options.format_of(output, ".csv", ".parquet")
    opened, pipeline = _open(capture, receiver, detector, settings)
    detections = pipeline.run(opened)
    table = detections.to_pandas().sort_values("frame", kind="stable")  # clustering hands some out later than others
    with replacing(output) as partial:
        if suffix == ".csv":
            table.to_csv(partial, index=False)
        else:
            table.to_parquet(partial, index=False)
    label = "SIMULATED capture" if opened.source == "simulated" else "capture"
    counts = f"{len(detections)} detections in {len(detections.processed)} of {len(opened)} frames"
    typer.echo(f"{pipeline.name} on {label} '{opened.name}': {counts}, written to {output}", err=True)
    render.print_notes(detections.notes)


def register(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(epilog="Example: uwbbench score run.h5 --detector paper --scoring object --json")(score)
    app.command(epilog="Example: uwbbench detect run.h5 --detector cfar-os -o found.csv")(detect)
