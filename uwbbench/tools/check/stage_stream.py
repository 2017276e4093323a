"""Checks of a stage as a stream: the same for any cut, after a new start, and beside another instance."""

from __future__ import annotations

import numpy as np

from uwbbench.api import registry
from uwbbench.api.case import NotApplicable
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.inputs import CALLS, CUTS, call_s, cut, pieces
from uwbbench.tools.check.stage_subject import StageSubject
from uwbbench.tools.check.values import Values, of_blocks, same

_STAGE = "uwbbench.api.stage.Stage"


@check(_STAGE)
def stream_equals_batch(subject: StageSubject) -> str:
    """Any cut into blocks gives the same bits: keep what lies between blocks on the instance, and start it in open."""
    for name, cuts in CUTS.items():
        same(subject.usual, subject.run(subject.block, cuts), f"in {name} what the whole block gives")
    return f"{len(CUTS)} cuts"


@check("uwbbench.api.stage.Stage.open")
def open_starts_anew(subject: StageSubject) -> None:
    """An instance that is opened again gives what a fresh one gives: ``open`` resets all state."""
    stage = subject.opened()
    subject.run(subject.block, stage=stage)
    subject.reopen(stage)
    same(subject.usual, subject.run(subject.block, stage=stage), "after open what a fresh instance gives")


@check("uwbbench.api.stage.Stage.show_background")
def background_may_come_in_blocks(subject: StageSubject) -> str:
    """The background, which is shown block by block, gives the same bits however it is cut."""
    if "background" not in subject.needs:
        raise NotApplicable("the stage needs no background")
    for name, cuts in CUTS.items():
        stage = subject.opened()
        subject.reopen(stage, cuts=cuts)
        same(subject.usual, subject.run(subject.block, stage=stage), f"with it in {name} what it gives as a whole")
    return f"{len(CUTS)} cuts"


@check("uwbbench.api.stage.Stage.open")
def instances_share_nothing(subject: StageSubject) -> None:
    """Two instances that are stepped by turns give what each alone gives: no state on the class or the module."""
    blocks = pieces(subject.block, CUTS["blocks of 7"])
    one, other = subject.opened(), subject.opened()
    yielded = []
    for block in blocks:
        yielded.append(one.step(block))
        other.step(cut(block, 0, len(block.frames) // 2))
    tail = one.flush()
    found: Values = of_blocks([*yielded, *([] if tail is None else [tail])])
    same(subject.usual, found, "beside another instance the same result")


@check("uwbbench.api.stage.Stage.note")
def notes_come_from_note(subject: StageSubject) -> str:
    """Notes are given by ``note``, each once, the same for any cut, and are gone after ``open``."""
    stage = subject.opened()
    subject.run(subject.block, stage=stage)
    notes = list(stage.notes)
    if not all(isinstance(note, str) for note in notes) or len(set(notes)) < len(notes):
        raise Nonconformity("texts, each once", repr(notes))
    subject.reopen(stage)
    at_start = list(stage.notes)
    subject.run(subject.block, CUTS["single frames"], stage=stage)
    if stage.notes != notes:
        raise Nonconformity(f"the same notes for single frames: {notes}", str(stage.notes))
    if at_start != subject.opened().notes:
        raise Nonconformity("no notes of the stream before", str(at_start))
    return f"{len(notes)} notes"


@check("uwbbench.measure.latency")
def one_frame_is_in_time(subject: StageSubject) -> str:
    """A call for one frame takes less than the radar's frame period, or the stage cannot keep up.

    The number is rough; ``uwbbench time`` measures properly.
    """
    blocks = pieces(subject.block, CUTS["single frames"])[:CALLS]
    own_s, period_s = call_s(subject.opened().step, blocks), 1 / subject.capture.radar.frame_rate_hz
    observed = f"{own_s * 1e6:.0f} us a call"
    if "stage.idle" in registry.entries("defaults"):
        nothing = StageSubject(registry.default("stage.idle")).opened()
        observed += f", {own_s / call_s(nothing.step, blocks):.1f} times doing nothing"
    if own_s > period_s:
        raise Nonconformity(f"a call for one frame within {period_s * 1e3:.1f} ms", observed)
    return observed


@check(_STAGE)
def no_rows_are_fine(subject: StageSubject) -> None:
    """Frames without any detection come through: most frames of an empty room hold none."""
    if "detections" not in subject.cls.consumes:
        raise NotApplicable("the stage consumes no detections")
    nothing = subject.block.detections.take(np.empty(0, np.int64))
    values = subject.run(subject.block.replace(detections=nothing), CUTS["blocks of 7"])
    if len(values["detections"]):
        raise Nonconformity("no detections", f"{len(values['detections'])}")
    missing = sorted(subject.cls.produces - values.keys())
    if missing:
        raise Nonconformity("the declared columns, empty", f"no {', '.join(missing)}")


@check(_STAGE)
def no_frames_are_fine(subject: StageSubject) -> None:
    """A block without frames comes through, as does a stream without blocks: a capture may be empty."""
    empty = cut(subject.block, 0, 0)
    values = subject.run(empty)
    if len(values["detections"]) or len(values["frame index"]):
        raise Nonconformity("nothing", f"{len(values['detections'])} detections in {len(values['frame index'])} frames")
    subject.opened().flush()


CHECKS = (
    stream_equals_batch,
    open_starts_anew,
    background_may_come_in_blocks,
    instances_share_nothing,
    no_frames_are_fine,
    no_rows_are_fine,
    notes_come_from_note,
    one_frame_is_in_time,
)
