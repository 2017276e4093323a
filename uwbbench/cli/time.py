"""The command that measures how fast detectors are: ``time``."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from uwbbench.api.errors import ConfigError
from uwbbench.cli import options, render
from uwbbench.show.text.numbers import number

if TYPE_CHECKING:
    from uwbbench.api.capture import Capture
    from uwbbench.config.source import CaptureRef
    from uwbbench.detect.pipeline import Pipeline
    from uwbbench.measure.latency import Latency

_OF_A_DATASET = re.compile(r"(?P<dataset>[\w.-]+)\[(?P<name>.+)\]")


def time(
    capture: Annotated[
        str,
        typer.Argument(
            metavar="CAPTURE", help="Capture file (.h5), or a dataset's capture: DATASET[NAME].", show_default=False
        ),
    ],
    detector: Annotated[
        list[str] | None,
        typer.Option("--detector", "-d", metavar="NAME|FILE", help="Detector by name or file; may be repeated."),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="All detectors by name that can work on the capture, in one table.")
    ] = False,
    reference: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="Detector that each takes turns with.", show_default="the reference"),
    ] = None,
    frames: Annotated[int, typer.Option(min=1, metavar="N", help="Frames timed at most.")] = 2000,
    blocks: Annotated[int, typer.Option(min=8, metavar="N", help="Alternating blocks at least.")] = 100,
    paced: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Also hand out frames at the radar's rate for so long.", min=0.01),
    ] = None,
    rate_hz: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Other rate for --paced.", show_default="the capture's", min=0.001),
    ] = None,
    receiver: options.Receiver = None,
    data_dir: options.DataDir = None,
    json: options.Json = False,
) -> None:
    """Measure how fast detectors answer, and how late.

    Each is timed in a process of its own, on one core with one thread, one frame a call, from raw samples in memory to
    rows as plain records. What travels between machines is the ratio to the reference, which takes turns with the
    detector on the same frames; all other times hold on this machine only.
    """
    import uwbbench
    from uwbbench.api import registry
    from uwbbench.measure.latency import measure
    from uwbbench.measure.latency.settings import LatencyModel

    if rate_hz is not None and paced is None:
        raise ConfigError("--rate-hz is the rate of --paced, which is not given")
    reference = reference or registry.default("detector.reference")
    ref, opened = _open(capture, receiver, data_dir)
    pipelines = [uwbbench.load_detector(name) for name in detector or ()]
    for pipeline in (*pipelines, uwbbench.load_detector(reference)):
        pipeline.open(opened)  # what cannot work on this capture is said before anything is timed
    pipelines += _others(opened, {pipeline.name for pipeline in pipelines}) if every else []
    if not pipelines:
        raise ConfigError("no detector: name one with --detector, or give --all")
    asked = {"reference": reference, "frames": frames, "blocks": blocks, "paced_s": paced, "rate_hz": rate_hz}
    settings = LatencyModel.model_validate(asked)
    latencies: list[tuple[str, Latency]] = []
    for pipeline in pipelines:
        typer.echo(f"timing {pipeline.name} ...", err=True)
        latencies.append((pipeline.name, measure(ref, pipeline.config, settings)))
    about = {**asked, "capture": opened.name, "source": opened.source, "frames": min(frames, len(opened))}
    if json:
        render.print_json({**about, "detectors": [_everything(*one) for one in latencies]})
    else:
        _print(about, latencies, brief=every)


def _others(capture: Capture, known: set[str]) -> list[Pipeline]:
    """Detectors by name, but those that are known already; those that cannot work on the capture are noted."""
    import uwbbench
    from uwbbench.api.errors import UwbbenchError
    from uwbbench.tools.warmup import installed_detectors

    able = []
    for name in installed_detectors():
        try:
            pipeline = uwbbench.load_detector(name)
            pipeline.open(capture)
        except UwbbenchError as error:
            render.print_notes([f"not timed: {error}"])
            continue
        if pipeline.name not in known:
            able.append(pipeline)
    return able


def _open(text: str, receiver: str | None, data_dir: Path | None) -> tuple[CaptureRef, Capture]:
    """Capture that the user names, opened here and as another process can open it."""
    import uwbbench
    from uwbbench.config.source import CaptureRef, data_roots

    named = None if Path(text).exists() else _OF_A_DATASET.fullmatch(text)
    if named is None:
        if data_dir is not None:
            raise ConfigError(f"--data-dir is where a dataset is searched; {text} is a capture file")
        opened = uwbbench.open_capture(text, receiver)
        chosen = opened.radar.receiver if len(opened.receivers) > 1 else None
        return CaptureRef.of_file(Path(text), chosen), opened
    if receiver is not None:
        raise ConfigError(f"--receiver is for a capture file; {text} names a capture of a dataset")
    ref = CaptureRef(named["dataset"], {}, tuple(map(str, data_roots(data_dir))), named["name"])
    return ref, ref.open()


def _everything(name: str, latency: Latency) -> dict[str, Any]:
    calls = {key: getattr(latency, key).round(3).tolist() for key in ("times_us", "step_us", "paced_times_us")}
    return {"detector": name, **latency.to_dict(), **calls}


def _print(about: dict[str, Any], latencies: Sequence[tuple[str, Latency]], *, brief: bool) -> None:
    """Ratios first, as they travel; then the times of this machine, and how far the measurement can be trusted."""
    label = "SIMULATED capture" if about["source"] == "simulated" else "capture"
    typer.echo(f"{label} '{about['capture']}', {about['frames']} frames, one frame a call")
    if brief:
        _print_brief(latencies)
        return
    names = [name for name, _ in latencies]
    all_latencies = [latency for _, latency in latencies]

    def table(title: str, lines: Sequence[tuple[str, Callable[[Latency], str]]]) -> None:
        rows = [(text, *(cell(latency) for latency in all_latencies)) for text, cell in lines]
        render.print_table(title, ("", *names), rows)

    reference = _reference(all_latencies[0])["reference"]
    table(f"time relative to {reference}, samples to rows, in alternating blocks", _RATIOS)
    machine = all_latencies[0].machine
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items())
    table(f"THIS MACHINE ONLY ({machine['cpu']}, {machine['cores']} cores; {versions})", _TIMES)
    table("age of the answers", _AGES)
    if about["paced_s"] is not None:
        paced = all_latencies[0].paced or {}
        table(f"at {paced['rate_hz']:g} Hz for {about['paced_s']:g} s, asleep in between, THIS MACHINE ONLY", _PACED)
    table("the measurement itself", _QUALITY)
    for name, latency in latencies:
        render.print_notes([f"{name}: {note}" for note in latency.notes])


def _print_brief(latencies: Sequence[tuple[str, Latency]]) -> None:
    """One row a detector: samples to rows, the step alone, the ratio and the age of the answers."""
    rows = []
    for name, one in latencies:
        step, age = one.step or {}, one.age
        times = [number(us, 1, reason="too few") for us in (one.p50_us, one.p99_us, step["p50_us"], step["p99_us"])]
        ages = ["n/a"] * 5
        if age is not None:
            ages = [number(age[f"p{q}_frames"], 0) for q in (50, 95)]
            ages += [number(age[f"p{q}_s"], 3, 1e3) for q in (50, 95)] + [number(age["end_share"], 1, 100.0)]
        rows.append((name, *times, _ratio(one, "ratio", "low", "high"), *ages))
    heads: tuple[str, ...] = ("rows p50 (us)", "rows p99 (us)", "step p50 (us)", "step p99 (us)")
    heads += (f"rows / {_reference(latencies[0][1])['reference']}", "age p50 (frames)", "p95 (frames)")
    heads += ("age p50 (ms)", "p95 (ms)", "at the end (%)")
    machine = latencies[0][1].machine
    title = f"samples to rows, step alone and age, THIS MACHINE ONLY ({machine['cpu']}, {machine['cores']} cores)"
    render.print_table(title, ("", *heads), rows)
    typer.echo("  age n/a: the detector found nothing; at the end: share of detections that only the flush gave")
    for name, latency in latencies:
        render.print_notes([f"{name}: {note}" for note in latency.notes])


def _reference(latency: Latency) -> dict[str, Any]:
    return latency.ratio_to_reference or {}


def _ratio(latency: Latency, name: str, low: str, high: str) -> str:
    ratio = _reference(latency)
    return f"{ratio[name]:.3g} [{ratio[low]:.3g}, {ratio[high]:.3g}]"


def _blocks(ratio: dict[str, Any]) -> str:
    return f"{ratio['blocks']} ({ratio['disturbed_blocks']})"


def _us(value: float | None, reason: str = "too few calls") -> str:
    return number(value, 2, 1.0, "us", reason)


def _kind(kind: dict[str, Any] | None) -> str:
    if kind is None:
        return "n/a (the detector does not report them)"
    if kind["n"] == 0:
        return "0 calls"
    tails = [f"p{q} {_us(kind[f'p{q}_us'])}" for q in (90, 95, 99) if kind[f"p{q}_us"] is not None]
    return ", ".join([f"{kind['n']} calls", f"p50 {_us(kind['p50_us'])}", *tails, f"max {_us(kind['max_us'])}"])


def _missed(counts: dict[str, Any]) -> str:
    """Missed deadlines with the upper bound of their share, and the longest burst where there is one."""
    share = f"{counts['missed']} of {counts['n']}, at most {counts['missed_share_high']:.2%}"
    return f"{share}, longest burst {counts['longest_burst']}" if counts["missed"] else share


def _share(us: float, share: float | None) -> str:
    return _us(us) if share is None else f"{_us(us)} ({share:.3%} of the frame period)"


def _bytes(value: float | None) -> str:
    return "n/a (the system reports none)" if value is None else f"{value / 1e3:+.1f} kB"


def _quality(latency: Latency, *names: str) -> str:
    values = [latency.quality.get(name) for name in names]
    return " / ".join("n/a" if value is None else f"{value:.4g}" for value in values)


def _in_pace(name: str) -> Callable[[Latency], str]:
    return lambda latency: _us((latency.paced or {})[name])


def _share_in_pace(q: int) -> Callable[[Latency], str]:
    return lambda latency: _share((latency.paced or {})[f"p{q}_us"], (latency.paced or {})[f"p{q}_period_share"])


def _late_starts(latency: Latency) -> str:
    paced = latency.paced or {}
    return f"{paced['late_starts']}, p99 {_us(paced['lateness_p99_us'])}, max {_us(paced['lateness_max_us'])}"


def _in_step(q: str) -> Callable[[Latency], str]:
    return lambda latency: _us((latency.step or {})[q])


def _aged(name: str, unit: str, digits: int, factor: float = 1.0) -> Callable[[Latency], str]:
    return lambda latency: number((latency.age or {}).get(name), digits, factor, unit, "no detections")


Lines = tuple[tuple[str, Callable[["Latency"], str]], ...]

_RATIOS: Lines = (
    ("typical block", lambda one: _ratio(one, "ratio", "low", "high")),
    ("all blocks together", lambda one: _ratio(one, "total_ratio", "total_low", "total_high")),
    ("blocks (core lost in)", lambda one: _blocks(_reference(one))),
)

_TIMES: Lines = (
    ("samples to rows, p50", lambda one: _us(one.p50_us)),
    ("  p90", lambda one: _us(one.p90_us)),
    ("  p95", lambda one: _us(one.p95_us)),
    ("  p99", lambda one: _us(one.p99_us)),
    ("  max", lambda one: _us(one.max_us)),
    ("step alone, p50", _in_step("p50_us")),
    ("  p90", _in_step("p90_us")),
    ("  p95", _in_step("p95_us")),
    ("  p99", _in_step("p99_us")),
    ("  max", _in_step("max_us")),
    ("clustering calls", lambda one: _kind(one.clustering)),
    ("plain calls", lambda one: _kind(one.plain)),
    ("amortised", lambda one: _us(one.amortised_us)),
    ("batch, a frame", lambda one: _us(one.throughput_us)),
    ("deadline", lambda one: _us(one.deadline_us)),
    ("missed deadlines", lambda one: _missed(vars(one))),
    ("start-up", lambda one: f"{one.startup_s:.2f} s"),
    ("peak memory", lambda one: f"{one.peak_memory_bytes / 1e6:.0f} MB"),
    ("objects kept of 1000 frames", lambda one: _bytes(one.memory_growth_bytes)),
    ("resident growth of 1000 frames", lambda one: _bytes(one.resident_growth_bytes)),
    (
        "instructions a frame",
        lambda one: (
            one.instructions_note if one.instructions_per_frame is None else f"{one.instructions_per_frame:.0f}"
        ),
    ),
)

_AGES: Lines = (
    ("p50", _aged("p50_frames", "frames", 0)),
    ("p95", _aged("p95_frames", "frames", 0)),
    ("p50, in time", _aged("p50_s", "ms", 3, 1e3)),
    ("p95, in time", _aged("p95_s", "ms", 3, 1e3)),
    ("only at the end", _aged("end_share", "% of the detections", 1, 100.0)),
    ("detections", _aged("n", "", 0)),
)

_PACED: Lines = (
    ("p50", _share_in_pace(50)),
    ("p99", _share_in_pace(99)),
    ("max", _in_pace("max_us")),
    ("missed deadlines", lambda one: _missed(one.paced or {})),
    ("started late by the harness", _late_starts),
)

_QUALITY: Lines = (
    ("calls", lambda one: str(one.n)),
    ("a detector that does nothing", lambda one: _us(one.overhead_us)),
    ("reading the clock", lambda one: _us(one.clock_us)),
    ("warm-up agreed", lambda one: "yes" if one.warmed else "no"),
    ("compiled while timed", lambda one: _quality(one, "compilations")),
    ("kept on one core", lambda one: "yes" if one.pinned else "no"),
    ("threads a library would use", lambda one: str(one.threads)),
    ("page faults, minor / major", lambda one: _quality(one, "minor_faults", "major_faults")),
    ("core lost, waited", lambda one: _quality(one, "involuntary_switches", "voluntary_switches")),
    ("load before / after", lambda one: _quality(one, "load_before", "load_after")),
    ("governor, turbo", lambda one: ", ".join(str(one.machine[key] or "unknown") for key in ("governor", "turbo"))),
)


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench time run.h5 --detector paper --reference paper-filtering --paced 60")(time)
