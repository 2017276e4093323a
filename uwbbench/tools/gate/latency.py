"""Relative latency: head against base on the same frames, in one job, by the rule of :mod:`uwbbench.tools.gate.rule`.

Times are from raw samples to rows as plain records, on both sides: workers that time anything else speak another
version of the protocol, and are refused. Absolute times do not travel between machines, not even between two hours of
one: nothing is compared with a stored time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from uwbbench.config.source import CaptureRef
from uwbbench.measure.latency.player import turn_frames
from uwbbench.measure.latency.ratio import Ratio, alternate, log_ratios
from uwbbench.tools.gate.check import Aspect, Check, GateVerdict
from uwbbench.tools.gate.config import Gate, LatencyGateModel, Side
from uwbbench.tools.gate.link import SetUpError, Worker, join, worker_of
from uwbbench.tools.gate.rule import Sampler, canary, compared

MINIMUM_FRAMES = 100
"""With fewer frames the processor learns them by heart, and their times say little of new ones."""

Progress = Callable[[str], None]


def latency_checks(
    gate: Gate, base: Side, settings: LatencyGateModel, label: str, ref: CaptureRef, progress: Progress
) -> list[Check]:
    """Base against base, then base against head, on one capture.

    Parameters
    ----------
    gate : Gate
    base : Side
    settings : LatencyGateModel
    label : str
        Name of the capture, for people.
    ref : CaptureRef
    progress : callable
        Called with what is being done.

    Returns
    -------
    list of Check
        The canary, and the comparison.

    Raises
    ------
    SetUpError
        If one of the sides cannot be measured.
    """
    if base.python != gate.head.python:
        return _separately(gate, base, settings, label, ref, progress)
    with worker_of(base, gate.model.timeout_s) as worker:
        return checks_within(worker, base, gate.head, settings, label, ref, progress)


def checks_within(
    worker: Worker, base: Side, head: Side, settings: LatencyGateModel, label: str, ref: CaptureRef, progress: Progress
) -> list[Check]:
    """The same for two detectors of one environment, in a process that is there already.

    Parameters
    ----------
    worker : Worker
        In the environment of both.
    base, head : Side
    settings : LatencyGateModel
    label : str
        Name of the capture, for people.
    ref : CaptureRef
    progress : callable
        Called with what is being done.

    Returns
    -------
    list of Check
        The canary, and the comparison; one check alone where there are too few frames.

    Raises
    ------
    SetUpError
        If one of the sides cannot be measured.
    """
    joined = {
        player: join(worker, player, side, ref, settings.frames, settings.warmup_windows)
        for player, side in (("base", base), ("base again", base), ("head", head))
    }
    label = _labelled(label, joined["base"])
    few = _too_few(label, joined["base"])
    if few:
        return few
    size = turn_frames([found["call_s"] for found in joined.values()], joined["base"]["frames"])
    again, other = (partial(_blocks, worker, player, size) for player in ("base again", "head"))
    return _judged(label, settings, again, other, settings.blocks, "blocks", progress)


def _separately(
    gate: Gate, base: Side, settings: LatencyGateModel, label: str, ref: CaptureRef, progress: Progress
) -> list[Check]:
    """The same for two environments, in fresh pairs of processes."""
    with worker_of(gate.head, gate.model.timeout_s) as there, worker_of(base, gate.model.timeout_s) as here:
        joined = _both_joined((here, there), (base, gate.head), settings, ref)
        label = _labelled(label, joined[0])
        few = _too_few(label, joined[0])
        if few:
            return few
    pairs = partial(_pairs, gate, settings, ref)
    return _judged(
        label,
        settings,
        partial(pairs, base, base),
        partial(pairs, base, gate.head),
        settings.processes,
        "processes",
        progress,
    )


def _pairs(
    gate: Gate, settings: LatencyGateModel, ref: CaptureRef, first: Side, second: Side, count: int
) -> Sequence[float]:
    return [_pair(gate, settings, ref, first, second) for _ in range(count)]


def _pair(gate: Gate, settings: LatencyGateModel, ref: CaptureRef, first: Side, second: Side) -> float:
    """Median log ratio of the blocks of two fresh processes that take turns."""
    with worker_of(first, gate.model.timeout_s) as one, worker_of(second, gate.model.timeout_s) as other:
        joined = _both_joined((one, other), (first, second), settings, ref)
        size = turn_frames([found["call_s"] for found in joined], joined[0]["frames"])
        times_s = alternate([partial(_turn, worker, size) for worker in (one, other)], settings.blocks)
        return float(np.median(log_ratios(times_s[:, 1], times_s[:, 0])))


def _both_joined(
    workers: tuple[Worker, Worker], sides: tuple[Side, Side], settings: LatencyGateModel, ref: CaptureRef
) -> list[dict[str, Any]]:
    joined = [
        join(worker, "only", side, ref, settings.frames, settings.warmup_windows)
        for worker, side in zip(workers, sides, strict=True)
    ]
    if joined[0]["content"] != joined[1]["content"]:
        raise SetUpError(
            f"the two environments read different samples of capture '{ref.name}': another file, or another version "
            "of what simulates or reads it; give both the same capture file"
        )
    return joined


def _turn(worker: Worker, size: int) -> float:
    return float(worker.ask("turn", player="only", size=size)["spent_s"])


def _blocks(worker: Worker, player: str, size: int, count: int) -> Sequence[float]:
    answer = worker.ask("blocks", base="base", head=player, size=size, count=count)
    return list(answer["log_ratios"])


def _labelled(label: str, joined: dict[str, Any]) -> str:
    return f"{label}, SIMULATED" if joined["source"] == "simulated" else label


def _too_few(label: str, joined: dict[str, Any]) -> list[Check]:
    if joined["frames"] >= MINIMUM_FRAMES:
        return []
    return [
        Check(
            kind="latency",
            name=f"latency on {label}",
            verdict=GateVerdict.INCONCLUSIVE,
            reason=f"{joined['frames']} frames are too few; at least {MINIMUM_FRAMES} are needed",
            advice="time a longer capture, or raise latency.frames",
        )
    ]


def _judged(
    label: str,
    settings: LatencyGateModel,
    again: Sampler,
    head: Sampler,
    minimum: int,
    counted: str,
    progress: Progress,
) -> list[Check]:
    limits: dict[str, Any] = {
        "minimum": minimum,
        "patience": settings.patience,
        "limit": settings.maximum_ratio,
    }
    progress(f"base against base on {label}")
    ratio, verdict = canary(again, **limits)
    first = _check("canary", f"base against base on {label}", ratio, verdict, counted, settings)
    if verdict is not GateVerdict.PASS:
        unmeasured = Check(
            kind="latency",
            name=f"head against base on {label}",
            verdict=verdict,
            limit=settings.maximum_ratio,
            reason="not measured: base against base has not passed",
        )
        return [first, unmeasured]
    progress(f"head against base on {label}")
    ratio, verdict = compared(head, **limits)
    return [first, _check("latency", f"head against base on {label}", ratio, verdict, counted, settings)]


_SAID = {
    ("canary", GateVerdict.INVALID): ("the same detector differs from itself", "look for other load on the machine"),
    ("canary", GateVerdict.INCONCLUSIVE): ("times scatter too widely", "run again on a quieter machine"),
    ("latency", GateVerdict.REGRESSION): ("the head is slower", "profile it, or allow more with latency.maximum_ratio"),
    ("latency", GateVerdict.INCONCLUSIVE): (
        "the interval is too wide",
        "raise latency.patience, or quieten the machine",
    ),
}


def _check(
    kind: Aspect, name: str, ratio: Ratio, verdict: GateVerdict, counted: str, settings: LatencyGateModel
) -> Check:
    reason, advice = _SAID.get((kind, verdict), ("", ""))
    return Check(
        kind=kind,
        name=name,
        verdict=verdict,
        quantity="time ratio",
        value=ratio.value,
        low=ratio.low,
        high=ratio.high,
        n=ratio.n,
        counted=counted,
        limit=settings.maximum_ratio,
        reason=reason,
        advice=advice,
    )
