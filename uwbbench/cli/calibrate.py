"""The command that measures where a robot's delays begin, and what a detector is off by: ``calibrate``."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from uwbbench.api.errors import ConfigError
from uwbbench.cli import options, render

if TYPE_CHECKING:
    from uwbbench.api.capture import Capture
    from uwbbench.api.direct_path import PulseShape
    from uwbbench.measure.calibration import Calibration
    from uwbbench.measure.own_path import OwnPath


class By(StrEnum):
    """What the zero of delay is measured by."""

    TRUTH = "truth"
    ECHOES = "echoes"
    PULSE = "pulse"


class Shape(StrEnum):
    """Shape of a pulse that is known."""

    GAUSS = "gauss"
    RAISED_COSINE = "raised_cosine"


def calibrate(
    capture: options.CaptureFile,
    detector: Annotated[
        str | None,
        typer.Option("--detector", "-d", metavar="NAME|FILE", help="Detector by name, or a YAML file."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE.yaml", help="Detector file to write.", show_default=False),
    ] = None,
    by: Annotated[
        By,
        typer.Option(help="truth: of the capture; echoes: their pulse, no truth; pulse: a known one, an empty drive."),
    ] = By.TRUTH,
    pulse: Annotated[Shape | None, typer.Option(help="Shape of the known pulse.", show_default=False)] = None,
    width_ns: Annotated[
        float | None, typer.Option(metavar="NS", help="Its full width at half height.", show_default=False)
    ] = None,
    receiver: options.Receiver = None,
    settings: options.Settings = None,
    json: options.Json = False,
) -> None:
    """Write a detector corrected for its own offsets.

    Receiver by receiver. The offsets of range and azimuth are measured on a capture whose truth is known; that of range
    also on any drive, by the pulse of echoes that move, or on an empty one, by a pulse that is known. Without a
    detector, print what the drive shows of the robot itself: direct path, noise, ringing, scatter of the crest, and the
    zero of delay.
    """
    import uwbbench
    from uwbbench.api.capture_file import list_receivers

    if (detector is None) != (output is None):
        raise ConfigError("give a detector to calibrate and a file to write (--detector, --output), or neither")
    names = (receiver,) if receiver is not None else list_receivers(capture)
    captures = [uwbbench.open_capture(capture, name) for name in names]
    shape = _pulse(by, pulse, width_ns, captures[0])
    if detector is None or output is None:
        from uwbbench.measure.own_path import own_paths

        if settings:
            raise ConfigError("--set changes a detector: give one with --detector")
        _show([path for opened in captures for path in own_paths(opened, shape)], captures[0], json=json)
        return
    options.format_of(output, ".yaml", ".yml")
    from uwbbench.api.override import parse_settings
    from uwbbench.measure.calibration import calibrate as by_truth
    from uwbbench.measure.own_path import calibrate_zero

    changes = parse_settings(settings or ())
    pipeline = uwbbench.load_detector(detector, changes=changes)
    measured = {
        opened.radar.receiver: by_truth(pipeline, opened) if by is By.TRUTH else calibrate_zero(pipeline, opened, shape)
        for opened in captures
    }
    _write(output, detector, pipeline.name, changes, measured, captures, by)
    if json:
        render.print_json({name: _facts(one) for name, one in measured.items()})


def _pulse(by: By, shape: Shape | None, width_ns: float | None, capture: Capture) -> PulseShape | None:
    """Pulse that is known; None where another witness is asked."""
    from uwbbench.api.direct_path import stated_pulse

    if by is By.PULSE and shape is None:
        raise ConfigError("--by pulse needs the pulse: --pulse gauss --width-ns 3.2, or --pulse raised_cosine")
    if by is not By.PULSE and shape is not None:
        raise ConfigError("--pulse states a pulse, which --by pulse alone asks for")
    if shape is None:
        if width_ns is not None:
            raise ConfigError("--width-ns belongs to --pulse")
        return None
    if width_ns is None and shape is Shape.GAUSS:
        raise ConfigError("--pulse gauss needs its width: --width-ns 3.2")
    if width_ns is not None and not (math.isfinite(width_ns) and width_ns > 0):
        raise ConfigError(f"--width-ns must be positive, not {width_ns:g}")
    return stated_pulse(shape.value, 1 / capture.radar.bandwidth_hz if width_ns is None else width_ns * 1e-9)


def _write(
    output: Path,
    detector: str,
    name: str,
    changes: Mapping[str, Any],
    measured: Mapping[str, Calibration],
    captures: Sequence[Capture],
    by: By,
) -> None:
    """Write the detector, and say on stderr what was measured."""
    import yaml

    from uwbbench.measure.calibration import settings_by_receiver
    from uwbbench.run.folder.files import write_text

    label = "SIMULATED capture" if captures[0].source == "simulated" else "capture"
    origin = []
    for opened in captures:
        one = measured[opened.radar.receiver]
        unit = {By.TRUTH: "detections", By.ECHOES: "frames, by echoes", By.PULSE: "frames, by a known pulse"}[by]
        at = f", receiver {opened.radar.receiver}" if len(captures) > 1 else ""
        origin.append(f"measured on {label} '{opened.name}'{at} from {one.n} {unit}: {_offsets(one)}")
    head = {
        "schema": 1,
        "extends": _seen_from(output.parent, detector),
        "name": f"{name}-calibrated",
        "set": {**changes, **settings_by_receiver(measured)},
    }
    comments = "".join(f"# {line}\n" for line in origin)
    write_text(output, f"{comments}{yaml.safe_dump(head, sort_keys=False, allow_unicode=True)}")
    for line in origin[:-1]:
        typer.echo(line, err=True)
    typer.echo(f"{origin[-1]}; detector '{name}-calibrated' written to {output}", err=True)


def _offsets(one: Calibration) -> str:
    """Offsets of one receiver, how sure they are, and what scatter they leave."""
    offsets = f"range offset {one.range_bias_m:+.4f} m"
    if math.isfinite(one.range_sd_m):
        offsets += f" (standard deviation {one.range_sd_m:.4f} m)"
    if one.azimuth_bias_rad is not None:
        offsets += f", azimuth offset {math.degrees(one.azimuth_bias_rad):+.2f} degrees"
        offsets += "" if one.takes_azimuth else " (which no step takes)"
    left = "of the crest" if one.zeros_s else "of ranges"
    return f"{offsets}, scatter {left} {one.range_scatter_m:.4f} m"


def _facts(one: Calibration) -> dict[str, Any]:
    """Calibration of one receiver for programs."""
    facts = {
        "range_bias_m": one.range_bias_m,
        "range_sd_m": one.range_sd_m,
        "range_scatter_m": one.range_scatter_m,
        "azimuth_bias_rad": one.azimuth_bias_rad,
        "n": one.n,
        "zeros_s": dict(one.zeros_s),
    }
    return {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in facts.items()}


def _show(paths: Sequence[OwnPath], capture: Capture, *, json: bool) -> None:
    """Print what a drive shows of a robot."""
    from uwbbench.show.text.numbers import number

    if json:
        render.print_json([_about(path) for path in paths])
        return
    rows = [
        (
            path.receiver,
            path.response,
            str(path.frames),
            number(path.snr_db, 1),
            number(path.ringing_db, 1),
            number(path.crest_sd_m, 2, 100),
            str(path.echoes),
            number(path.pulse_width_s, 2, 1e9),
            number(path.zero_m, 2, 100),
            number(path.zero_sd_m, 2, 100),
        )
        for path in paths
    ]
    label = "SIMULATED capture" if capture.source == "simulated" else "capture"
    columns = ["receiver", "response", "frames", "SNR (dB)", "ringing (dB)", "crest scatter (cm)", "echoes"]
    columns += ["pulse (ns)", "zero (cm)", "sd (cm)"]
    render.print_table(f"The robot itself on {label} '{capture.name}'", columns, rows)
    typer.echo("  zero: where the direct path lies behind its crest, of range; ringing: highest 5 ns behind it and on")
    for path in paths:
        if path.doubt:
            typer.echo(f"  {path.receiver}, {path.response}: no zero to rely on: {path.doubt}")


def _about(path: OwnPath) -> dict[str, Any]:
    """One response's direct path for programs."""
    values: dict[str, Any] = {
        "receiver": path.receiver,
        "response": path.response,
        "frames": path.frames,
        "snr_db": path.snr_db,
        "ringing_db": path.ringing_db,
        "crest_sd_m": path.crest_sd_m,
        "echoes": path.echoes,
        "pulse_width_s": path.pulse_width_s,
        "zero_m": path.zero_m,
        "zero_sd_m": path.zero_sd_m,
        "misfit": math.nan if path.located is None else path.located.misfit,
    }
    values = {name: None if isinstance(v, float) and not math.isfinite(v) else v for name, v in values.items()}
    template = {"real": path.template.real.tolist(), "imag": path.template.imag.tolist(), "crest_tap": path.crest}
    return {**values, "doubt": path.doubt, "template": template}


def _seen_from(folder: Path, detector: str) -> str:
    """Detector as a file in another folder must name it."""
    is_name = not detector.endswith((".yaml", ".yml"))
    return detector if is_name else os.path.relpath(detector, folder)


def register(app: typer.Typer) -> None:
    """Add this command."""
    app.command(epilog="Example: uwbbench calibrate run.h5 --detector paper -o calibrated.yaml")(calibrate)
