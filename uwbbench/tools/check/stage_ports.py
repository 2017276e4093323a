"""Checks of what a stage declares: the ports that it uses, makes and changes, and how it treats rows."""

from __future__ import annotations

import typing

import numpy as np

from uwbbench.api.block import Block
from uwbbench.api.case import NotApplicable, last_line
from uwbbench.api.stage import Filter
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.stage_subject import PARTS, StageSubject, lacking
from uwbbench.tools.check.values import Values, difference, of_blocks

NEEDS = ("sts", "truth", "first_path", "background")
_STAGE = "uwbbench.api.stage.Stage"


@check(_STAGE)
def ports_are_sets_of_names(subject: StageSubject) -> str:
    """Ports are frozen sets of text, made with ``ports``, and what is needed of a capture is among four names."""
    for attribute in ("consumes", "produces", "removes", "needs"):
        value = getattr(subject.cls, attribute)
        if not isinstance(value, frozenset) or not all(isinstance(port, str) for port in value):
            raise Nonconformity(f"{attribute} = ports('...')", repr(value))
    unknown = sorted(subject.cls.needs - set(NEEDS))
    if unknown:
        raise Nonconformity(f"needs among {', '.join(NEEDS)}", ", ".join(unknown))
    return f"{', '.join(sorted(subject.cls.consumes)) or 'nothing'} -> {', '.join(sorted(subject.cls.produces))}"


@check(_STAGE)
def methods_take_what_is_given(subject: StageSubject) -> None:
    """``step`` returns a block, and ``flush`` a block or None: the next stage is handed it."""
    stage = subject.opened()
    yielded = stage.step(subject.block)
    if not isinstance(yielded, Block):
        raise Nonconformity("a Block from step", type(yielded).__name__)
    # Seen as a value of any type: what a plugin returns is not what its annotation says.
    tail = typing.cast(object, stage.flush())
    if tail is not None and not isinstance(tail, Block):
        raise Nonconformity("a Block or None from flush", type(tail).__name__)


@check(_STAGE)
def produces_what_it_declares(subject: StageSubject) -> None:
    """Every port that is declared as produced is there afterwards: later stages rely on it."""
    missing = sorted(subject.cls.produces - subject.usual.keys())
    if missing:
        raise Nonconformity(f"all of {', '.join(sorted(subject.cls.produces))}", f"no {', '.join(missing)}")


@check(_STAGE)
def declares_what_it_makes(subject: StageSubject) -> None:
    """Every part or column that is added is declared: a stage that wants it is otherwise refused."""
    before, after = of_blocks([subject.block]), subject.usual
    added = sorted(after.keys() - before.keys() - subject.cls.produces - {"frame index", "detections"})
    if added:
        raise Nonconformity(f"produces = ports(..., {', '.join(map(repr, added))})", f"{', '.join(added)} undeclared")


@check(_STAGE)
def declares_what_it_changes(subject: StageSubject) -> None:
    """Every part or column that is changed is declared as produced; rows may be dropped, by a filter."""
    before, after = of_blocks([subject.block]), subject.usual
    if difference({"rows": before["detections"]}, {"rows": after["detections"]}):
        kept = {"frame index", "frames", *PARTS}  # rows were dropped or made: their columns cannot be compared
        before = {name: values for name, values in before.items() if name in kept}
    for name in before.keys() & after.keys() - subject.cls.produces - subject.cls.removes - {"frame index"}:
        deviation = difference({name: before[name]}, {name: after[name]})
        if deviation:
            raise Nonconformity(f"'{name}' as it was, or declared in produces", deviation)


@check(_STAGE)
def uses_only_what_it_declares(subject: StageSubject) -> str:
    """Nothing is used that is not declared: without it, in another detector, the stage would break or find nothing.

    A part that is taken where it is there, and does not spoil a value where it is not, is reported and allowed.
    """
    full = subject.full_block
    usual = _answer(subject, full)
    optional = []
    for port in _undeclared(subject, full):
        try:
            answer = _answer(subject, lacking(full, port))
        except Exception as error:
            observed = f"without it: {last_line(error)}"
            raise Nonconformity(f"no use of {port}, or its declaration", observed) from error
        deviation = difference(usual, answer)
        if deviation and port == "frames":
            raise Nonconformity(
                "no use of samples, or consumes = ports('frames', ...)", f"other samples give {deviation}"
            )
        lost = _lost(usual, answer)
        if lost:
            raise Nonconformity(f"no use of {port}, or its declaration", f"without it {lost}")
        optional += [port] if deviation else []
    return f"optional: {', '.join(optional)}" if optional else ""


def _undeclared(subject: StageSubject, full: Block) -> list[str]:
    """What the full block has and the stage does not declare."""
    there = [*PARTS, *full.detections.columns, "detections", "frames"]
    ports = [port for port in dict.fromkeys(there) if port != "frame" and port not in subject.cls.consumes]
    reported = [("STS responses", "sts"), ("reported first path", "first_path")]
    return ports + [label for label, need in reported if need not in subject.cls.needs]


def _answer(subject: StageSubject, block: Block) -> Values:
    """What the stage answers for, behind a block."""
    return {name: values for name, values in subject.run(block).items() if name in subject.adds}


def _lost(usual: Values, found: Values) -> str:
    """What was a number and is none any more, in words."""
    for name, values in usual.items():
        if name not in found or len(found[name]) != len(values):
            left = len(found[name]) if name in found else 0
            return f"{left} values of {name} are left of {len(values)}"
        gone = np.isfinite(values) & ~np.isfinite(found[name])
        if gone.any():
            return f"{int(gone.sum())} of {values.size} values of {name} are no number"
    return ""


@check(_STAGE)
def frames_stay_in_order(subject: StageSubject) -> None:
    """All frames come out once and in order, and every detection belongs to one of them."""
    index = subject.usual["frame index"]
    expected = np.arange(len(subject.capture))
    if "frames" not in subject.cls.removes and not np.array_equal(index, expected):
        raise Nonconformity(f"frames 0 to {expected[-1]}, each once", f"{len(index)} frames")
    strange = ~np.isin(subject.usual["detections"], expected)
    if strange.any():
        raise Nonconformity("detections of these frames", f"{int(strange.sum())} of others")


@check(_STAGE)
def rowwise_is_true(subject: StageSubject) -> None:
    """With ``rowwise`` each row's columns depend on that row and its frame alone: half of the rows give the same."""
    cls = subject.cls
    if not cls.rowwise or issubclass(cls, Filter):
        raise NotApplicable("the stage does not claim it" if not cls.rowwise else "a filter adds no columns")
    half = np.arange(0, len(subject.block.detections), 2)
    values = subject.run(subject.block.replace(detections=subject.block.detections.take(half)))
    expected = {name: subject.usual[name][half] for name in cls.produces if name in subject.usual}
    deviation = difference(expected, {name: values[name] for name in expected})
    if deviation:
        raise Nonconformity("the same values for each row, or rowwise = False", deviation)


@check("uwbbench.api.stage.Filter")
def filters_reject_nan(subject: StageSubject) -> None:
    """A filter keeps no row whose values are NaN: write the condition that accepts, as NaN fails every comparison."""
    if not issubclass(subject.cls, Filter):
        raise NotApplicable("the stage is no filter")
    columns = subject.cls.consumes & subject.block.detections.columns.keys()
    if not columns:
        raise NotApplicable("the filter looks at no column")
    blank = {name: np.full(len(subject.block.detections), np.nan) for name in columns}
    left = len(subject.run(subject.block.with_columns(**blank))["detections"])
    if left:
        raise Nonconformity("no row kept", f"{left} of {len(subject.block.detections)} rows of NaN kept")


@check("uwbbench.api.stage.Filter.keep")
def filters_give_a_mask(subject: StageSubject) -> None:
    """``keep`` gives one boolean for each row: numbers would be taken for row indices."""
    if not issubclass(subject.cls, Filter):
        raise NotApplicable("the stage is no filter")
    mask = subject.opened().keep(subject.block)  # type: ignore[attr-defined]
    expected = f"a bool array of shape ({len(subject.block.detections)},)"
    if not isinstance(mask, np.ndarray) or mask.dtype != bool or mask.shape != (len(subject.block.detections),):
        observed = f"{mask.dtype} of shape {mask.shape}" if isinstance(mask, np.ndarray) else type(mask).__name__
        raise Nonconformity(expected, observed)


@check(_STAGE)
def finds_something(subject: StageSubject) -> str:
    """A stage that makes detections finds some in the usual capture, whose echo is 27 dB above the noise."""
    if "detections" not in subject.cls.produces:
        raise NotApplicable("the stage makes no detections")
    if subject.cls.fidelity == "reference":
        raise NotApplicable("a reference need not look")
    count = len(subject.usual["detections"])
    if not count:
        raise Nonconformity("a detection or more", f"none in {len(subject.capture)} frames")
    return f"{count} in {len(subject.capture)} frames"


CHECKS = (
    ports_are_sets_of_names,
    methods_take_what_is_given,
    produces_what_it_declares,
    declares_what_it_makes,
    declares_what_it_changes,
    uses_only_what_it_declares,
    frames_stay_in_order,
    rowwise_is_true,
    filters_reject_nan,
    filters_give_a_mask,
    finds_something,
)
