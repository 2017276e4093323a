"""Checks of a detector file: what it says of itself, and how it runs as a batch and as a stream."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import registry
from uwbbench.api.capture import Capture
from uwbbench.api.case import NotApplicable
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ConfigError
from uwbbench.api.registry import AuthoredKind
from uwbbench.detect.pipeline import Pipeline, detector_from_yaml, load_detector
from uwbbench.measure.robustness.scene import chosen, on_radar
from uwbbench.measure.robustness.subject import Subject as HardSubject
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.inputs import CALLS, CUTS, call_s, usual_capture
from uwbbench.tools.check.subject import Subject
from uwbbench.tools.check.values import Values, of_detections, same

_FILE, _PIPELINE = "uwbbench.config.detector", "uwbbench.detect.pipeline.Pipeline"
_IDLE = "schema: 1\nname: idle\npipeline:\n  - {{use: {}}}\n"


class DetectorSubject(Subject):
    """One detector; the parameters given are values to change in it, by path."""

    kind: ClassVar[AuthoredKind] = "detector"

    def __init__(self, name: str, params: Mapping[str, Any] | None = None, roots: tuple[Path, ...] = ()) -> None:
        super().__init__(name, params, roots)
        self.pipeline: Pipeline = load_detector(name, changes=self.given)

    @property
    def capture(self) -> Capture:
        """The usual capture."""
        return usual_capture()

    @cached_property
    def hardened(self) -> HardSubject:
        """The detector as hard cases want it; its undisturbed run is shared by them."""
        subject = HardSubject(self.pipeline)
        self.pipeline.open(subject.capture)  # a detector that refuses the capture says why
        return subject

    @cached_property
    def found(self) -> Detections:
        """Detections on the usual capture."""
        return self.pipeline.run(self.capture)

    def result(self) -> Values:
        """Detections and processed frames of a fresh run."""
        return values_of(self.pipeline.run(self.capture))

    def input_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of the usual capture."""
        parts = {**vars(self.capture), **vars(self.capture.trajectory)}
        return {name: value for name, value in parts.items() if isinstance(value, np.ndarray)}


def values_of(found: Detections) -> Values:
    """Columns of detections, and the frames that were processed."""
    return {**of_detections(found), "processed": found.processed}


def streamed(pipeline: Pipeline, capture: Capture, cuts: Sequence[int]) -> tuple[Detections, tuple[str, ...]]:
    """Detections and notes of a capture handed over in pieces.

    Parameters
    ----------
    pipeline : Pipeline
    capture : Capture
    cuts : sequence of int
        Frames, ascending, before which the capture is cut; a number that occurs twice makes an empty piece.

    Returns
    -------
    detections : Detections
        Of all pieces and the flush.
    notes : tuple of str
    """
    stream = pipeline.open(capture)
    parts = [stream.step(capture.frames(start, stop)) for start, stop in pairwise([0, *cuts, len(capture)])]
    return Detections.join([*parts, stream.flush()]), stream.notes


@check(_FILE)
def file_says_what_it_is(subject: DetectorSubject) -> str:
    """The file has a description and a citation (or ``none``), and the name it is registered by."""
    config = subject.pipeline.config
    missing = [key for key in ("description", "citation") if not getattr(config, key).strip()]
    if missing:
        raise Nonconformity("description and citation", f"no {' and no '.join(missing)}")
    if not subject.name.endswith((".yaml", ".yml")) and config.name != subject.name:
        raise Nonconformity(f"name: {subject.name}", f"name: {config.name}")
    return config.fidelity


@check(_PIPELINE)
def identity_is_stable(subject: DetectorSubject) -> str:
    """Loading the file twice gives one identity, and its settings are plain JSON: runs are resumed by them."""
    again = load_detector(subject.name, changes=subject.given)
    if again.identity != subject.pipeline.identity:
        raise Nonconformity(f"identity {subject.pipeline.identity[:12]} again", again.identity[:12])
    json.dumps(subject.pipeline.config.to_dict(), allow_nan=False)
    return again.identity[:12]


@check(_PIPELINE)
def detections_have_a_range(subject: DetectorSubject) -> str:
    """There is a column ``range_m``, finite or NaN: what has no range cannot be scored."""
    detections = subject.found
    if "range_m" not in detections:
        raise Nonconformity(
            "a column range_m; put the stage 'range' at the end", f"columns {', '.join(detections.columns)}"
        )
    infinite = [name for name, values in detections.columns.items() if np.isinf(values).any()]
    if infinite:
        raise Nonconformity("no infinite value", f"some in {', '.join(infinite)}")
    return f"{len(detections)} detections in {len(detections.processed)} frames"


@check(_PIPELINE)
def every_valid_frame_is_processed(subject: DetectorSubject) -> None:
    """All valid frames count as looked at and no invalid one does, and detections lie in the former."""
    valid = np.flatnonzero(subject.capture.frames().valid)
    detections = subject.found
    if not np.array_equal(detections.processed, valid):
        raise Nonconformity(f"{len(valid)} processed frames", f"{len(detections.processed)}, or others")
    strange = ~np.isin(detections.frame, valid)
    if strange.any():
        raise Nonconformity("detections in valid frames", f"{int(strange.sum())} in others")


@check(_PIPELINE)
def stream_equals_batch(subject: DetectorSubject) -> str:
    """Any cut into blocks gives the same bits and notes as the whole capture at once."""
    for name, cuts in CUTS.items():
        found, notes = streamed(subject.pipeline, subject.capture, cuts)
        same(subject.usual, values_of(found), f"in {name} what the whole capture gives")
        if notes != subject.found.notes:
            raise Nonconformity(f"in {name} the notes {subject.found.notes}", str(notes))
    return f"{len(CUTS)} cuts"


@check(_PIPELINE)
def streams_share_nothing(subject: DetectorSubject) -> None:
    """Two streams that are stepped by turns give what each alone gives."""
    capture, one, other = (
        subject.capture,
        subject.pipeline.open(subject.capture),
        subject.pipeline.open(subject.capture),
    )
    parts = []
    for start, stop in pairwise([0, *CUTS["blocks of 7"], len(capture)]):
        parts.append(one.step(capture.frames(start, stop)))
        other.step(capture.frames(start, start + 2))
    same(subject.usual, values_of(Detections.join([*parts, one.flush()])), "beside another stream the same result")


def _on(subject: DetectorSubject, capture: Capture) -> str:
    """Say how the detector takes to a capture: it runs alike in pieces, or refuses with a message for users."""
    try:
        detections = subject.pipeline.run(capture)
    except ConfigError as error:
        if "\n" in str(error):
            raise Nonconformity("one message", f"{str(error).count(chr(10)) + 1} lines") from error
        return f"refused: {error}"
    pieces, _ = streamed(subject.pipeline, capture, CUTS["uneven blocks"])
    same(values_of(detections), values_of(pieces), "in uneven blocks what the whole capture gives")
    return f"{len(detections)} detections" + (f"; {'; '.join(detections.notes)}" if detections.notes else "")


@check("uwbbench.config.detector.StepModel")
def captures_without_sts_are_fine(subject: DetectorSubject) -> str:
    """Without STS the detector runs or says in one message why not; ``optional: true`` leaves steps out."""
    return _on(subject, usual_capture(sts=False))


@check("uwbbench.api.stage.Stage.show_background")
def captures_without_background_are_fine(subject: DetectorSubject) -> str:
    """Without a background the detector runs or says in one message why not; ``optional: true`` leaves steps out."""
    return _on(subject, usual_capture(background=False))


@check("uwbbench.api.stage.Stage")
def captures_without_truth_are_fine(subject: DetectorSubject) -> str:
    """Without ground truth a detector that is not a reference finds the same: no real radar has it."""
    answer = _on(subject, usual_capture(truth=False))
    if answer.startswith("refused") and subject.pipeline.config.fidelity != "reference":
        raise Nonconformity("a detector that runs without ground truth, or fidelity: reference", answer)
    return answer


@check(_PIPELINE)
def empty_captures_are_fine(subject: DetectorSubject) -> None:
    """A capture without frames gives an empty table with the usual columns, and one of one frame comes through."""
    nothing = subject.pipeline.run(chosen(subject.capture, np.empty(0, np.int64)))
    if len(nothing) or len(nothing.processed):
        raise Nonconformity("nothing", f"{len(nothing)} detections in {len(nothing.processed)} frames")
    missing = sorted(subject.found.columns.keys() - nothing.columns.keys())
    if missing:
        raise Nonconformity("the usual columns", f"no {', '.join(missing)}")
    subject.pipeline.run(chosen(subject.capture, np.array([20])))


@check(_PIPELINE)
def candidates_change_nothing(subject: DetectorSubject) -> str:
    """Asking for the peaks before the filters gives the same detections, and these are among those peaks.

    Tracks are not: there, only the same tracks are asked for.
    """
    audited = subject.pipeline.run(subject.capture, candidates=True)
    plain = subject.pipeline.run(subject.capture, fused=False)  # as an audit runs, stage by stage
    same(values_of(plain), values_of(audited), "the same detections beside their candidates")
    candidates = audited.candidates
    if candidates is None:
        raise NotApplicable("the detector cannot say")
    retained = int(np.sum(candidates["retained"] == 1)) if "retained" in candidates else 0
    if retained != len(audited) and "track" not in audited:
        raise Nonconformity(f"{len(audited)} retained candidates", str(retained))
    return f"{len(candidates)} candidates"


@check("uwbbench.api.kernel.Kernel")
def fused_equals_plain(subject: DetectorSubject) -> str:
    """Where a kernel does the work of several stages it finds the same rows, with values within 1e-9, in any thread."""
    if not subject.pipeline.open(subject.capture).fused:
        raise NotApplicable("no kernel takes over any of its stages")
    same(subject.usual, values_of(subject.pipeline.run(subject.capture, threads=2)), "in two threads the same result")
    plain = subject.pipeline.run(subject.capture, fused=False)
    expected, worst = "the rows of the plain stages", 0.0
    same(of_frames(plain), of_frames(subject.found), expected)
    for name, values in plain.columns.items():
        column = subject.found[name]
        if not np.array_equal(np.isnan(values), np.isnan(column)):
            raise Nonconformity(f"{name} where the plain stages have it", "NaN in other rows")
        worst = max(worst, float(np.nanmax(np.abs(column - values), initial=0.0)))
        if not np.allclose(column, values, rtol=1e-9, atol=1e-9, equal_nan=True):
            raise Nonconformity(f"{name} within 1e-9 of the plain stages", f"off by up to {worst:.2g}")
    return f"{len(plain)} rows, values within {worst:.2g}"


def of_frames(found: Detections) -> Values:
    """Frames that were processed, and the frame of each detection."""
    return {"detections": found.frame, "processed": found.processed}


@check("uwbbench.measure.latency")
def one_frame_is_in_time(subject: DetectorSubject) -> str:
    """A call for one frame takes less than the radar's frame period; ``uwbbench time`` measures properly."""
    capture, idle = subject.capture, detector_from_yaml(_IDLE.format(registry.default("stage.idle")))
    own_s, idle_s = (
        call_s(pipeline.open(capture).step, [capture.frames(row, row + 1) for row in range(CALLS)])
        for pipeline in (subject.pipeline, idle)
    )
    period_s = 1 / capture.radar.frame_rate_hz
    if own_s > period_s:
        raise Nonconformity(f"a call for one frame within {period_s * 1e3:.1f} ms", f"{own_s * 1e3:.1f} ms")
    return f"{own_s * 1e6:.0f} us a call, {own_s / idle_s:.1f} times a detector that does nothing"


@check(_FILE)
def other_channels_are_fine(subject: DetectorSubject) -> str:
    """A radar without a channel runs or is refused in one message: values by channel need an ``other``."""
    usual = subject.capture
    radar = dataclasses.replace(usual.radar, channel=None)
    return _on(subject, on_radar(usual, radar))


CHECKS = (
    file_says_what_it_is,
    identity_is_stable,
    detections_have_a_range,
    every_valid_frame_is_processed,
    stream_equals_batch,
    streams_share_nothing,
    captures_without_sts_are_fine,
    captures_without_background_are_fine,
    captures_without_truth_are_fine,
    other_channels_are_fine,
    empty_captures_are_fine,
    candidates_change_nothing,
    fused_equals_plain,
    one_frame_is_in_time,
)
