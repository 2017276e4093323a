"""Executing one accuracy unit, in whatever process: any exception becomes a failed entry."""

from __future__ import annotations

import os
import signal
import threading
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.detections import HANDED_OUT, Detections
from uwbbench.config.source import CaptureRef
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.run.folder.identity import accuracy_identity
from uwbbench.run.folder.journal import Entry, Status
from uwbbench.run.folder.scored import score_rows
from uwbbench.run.plan import Unit, reason_of


@dataclass(frozen=True)
class Job:
    """A unit with all that a worker process needs to know.

    Attributes
    ----------
    unit : Unit
    rules : tuple of ScoringRules
    session : str
        Distinct for each run: a worker that outlives a run must not use its captures for the next.
    parent : int
        The process that runs the experiment.
    """

    unit: Unit
    rules: tuple[ScoringRules, ...]
    session: str
    parent: int


@dataclass(frozen=True)
class Finished:
    """What a unit gave.

    Attributes
    ----------
    entry : Entry
    found, candidates : Detections or None
    header : CaptureHeader or None
    sha256 : str
        Of the capture's content.
    """

    entry: Entry
    found: Detections | None = None
    candidates: Detections | None = None
    header: CaptureHeader | None = None
    sha256: str = ""


_last: list[tuple[str, CaptureRef, Capture]] = []


def _opened(session: str, ref: CaptureRef) -> Capture:
    """Capture of a reference; the last one is kept, as the units of a capture follow each other."""
    if not (_last and _last[0][:2] == (session, ref)):
        _last[:] = [(session, ref, ref.open())]
    return _last[0][2]


def content_of(job: Job) -> str:
    """SHA-256 of a unit's capture; empty where it cannot be opened."""
    try:
        return _opened(job.session, job.unit.ref).sha256
    except Exception:  # noqa: BLE001 - the unit itself will fail in the same way, and say so
        return ""


def die_with(parent: int) -> None:
    """Make a worker leave the interrupt key to its parent, and end when the parent has ended, however it ended."""
    if os.getpid() == parent or threading.current_thread() is not threading.main_thread():
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    if not any(thread.name == "watch-parent" for thread in threading.enumerate()):
        threading.Thread(target=watch, name="watch-parent", daemon=True).start()


def run_unit(job: Job) -> Finished:
    """Detect and score on one capture with one thread."""
    from threadpoolctl import threadpool_limits

    die_with(job.parent)
    started = time.perf_counter()
    unit = job.unit
    try:
        with threadpool_limits(1):
            finished = _detected(job)
    except Exception as error:  # noqa: BLE001 - a plugin may raise anything; the other units still run
        return Finished(entry_of(unit, "failed", reason=reason_of(error), traceback=traceback.format_exc()))
    finished.entry.facts["elapsed_s"] = time.perf_counter() - started
    return finished


def _detected(job: Job) -> Finished:
    unit = job.unit
    capture = _opened(job.session, unit.ref)
    with_candidates = any(rule.scoring == "peak" for rule in job.rules)
    pipeline = Pipeline(unit.detector)
    detections = pipeline.run(capture, handed_out=True)
    candidates = detections.candidates if with_candidates else None
    header = capture.header
    facts = {
        "source": header.source,
        "frames": len(header),
        "processed": len(detections.processed),
        "detections": len(detections),
        "exhaustive": None if header.truth is None else header.truth.exhaustive,
        "materials": _materials(header),
        "channel": header.radar.channel,
        "notes": list(detections.notes),
        "chain": dict(detections.chain),
        "sha256": capture.sha256,
    }
    entry = entry_of(
        unit,
        "done",
        identity=accuracy_identity(pipeline.identity, capture.sha256, job.rules),
        capture_id=unit.capture_id,
        scores=score_rows(detections, header, job.rules),
        facts=facts,
    )
    return Finished(entry, _bare(detections), None if candidates is None else _bare(candidates), header, capture.sha256)


def entry_of(unit: Unit, status: Status, **values: Any) -> Entry:
    """Journal entry of a unit."""
    return Entry(
        unit=unit.id,
        kind=unit.kind,
        detector=unit.detector.name,
        dataset=unit.dataset,
        capture=unit.ref.name,
        status=status,
        **values,
    )


def _materials(header: CaptureHeader) -> list[str]:
    objects: Sequence[Any] = header.truth.objects if header.truth else ()
    return sorted({item.material for item in objects if not item.structure})


def _bare(detections: Detections) -> Detections:
    """Detections without the means to find candidates later, which would drag the capture between processes."""
    columns: dict[str, Any] = detections.columns
    bare = Detections(**columns, processed=detections.processed, notes=detections.notes, chain=detections.chain)
    answered = detections.answered
    return bare if answered is None else bare.with_hand_outs(columns[HANDED_OUT], answered)
