"""The parts of one accuracy unit: its capture is opened, the detector finds, what it found is scored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from uwbbench.api.arrays import FloatArray
from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.detections import HANDED_OUT, Detections
from uwbbench.api.drive import Drive
from uwbbench.api.errors import PluginError
from uwbbench.config.detector import DetectorConfig
from uwbbench.config.identity import RESULTS_FILE
from uwbbench.config.source import CaptureRef, RunRef
from uwbbench.detect.mapping import MappingPipeline
from uwbbench.detect.pipeline import Pipeline
from uwbbench.detect.results_file import ResultsFile
from uwbbench.detect.results_folder import ResultsFolder
from uwbbench.measure.accuracy.ranked import RankedCounts, ranked
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.run.crew.handed import hand_over, taken
from uwbbench.run.crew.messages import unpacked
from uwbbench.run.folder.identity import accuracy_identity
from uwbbench.run.folder.journal import Entry, Status
from uwbbench.run.folder.reported import REPORTED_FACT, RESULTS_FACT, reported_times
from uwbbench.run.folder.scored import scorable, score_rows, with_causes
from uwbbench.run.plan import Unit
from uwbbench.run.suite import ChangedCapture, Frozen


@dataclass(frozen=True)
class Job:
    """A unit with all that a worker needs to know.

    Attributes
    ----------
    unit : Unit
    rules : tuple of ScoringRules
    session : str
        Distinct for each run: a process that outlives a run must not use its captures for the next.
    identity : str
        Of the detector; empty where another program has found what there is.
    frozen : Frozen or None
        What the capture is held against.
    """

    unit: Unit
    rules: tuple[ScoringRules, ...]
    session: str
    identity: str = ""
    frozen: Frozen | None = None


@dataclass(frozen=True)
class Opened:
    """What is known of a capture once it is open.

    Attributes
    ----------
    frames : int
    sha256 : str
        Of its content.
    file : Path or None
        Where it lies for other processes; None where they open it themselves.
    changed : str
        Why it is not the capture that the suite was frozen with; empty if it is.
    """

    frames: int = 0
    sha256: str = ""
    file: Path | None = None
    changed: str = ""


@dataclass(frozen=True)
class Found:
    """What a detector found on a capture.

    Attributes
    ----------
    detections : Detections
    candidates : Detections or None
        Every peak before the filters.
    """

    detections: Detections
    candidates: Detections | None


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
    curve : RankedCounts or None
        What the candidates would give at every threshold.
    times_us : (processed frames,) array or None
        Time of each frame as another program reports it.
    """

    entry: Entry
    found: Detections | None = None
    candidates: Detections | None = None
    header: CaptureHeader | None = None
    sha256: str = ""
    curve: RankedCounts | None = None
    times_us: FloatArray | None = None


_last: list[tuple[str, CaptureRef | RunRef, Capture | Drive]] = []


def _at_hand(job: Job, file: Path | None = None) -> Capture | Drive:
    """Capture or run of a unit; the last one is kept, as the units of a capture follow each other.

    Parameters
    ----------
    job : Job
    file : Path, optional
        Where another process has put it.
    """
    ref = job.unit.ref
    if not (_last and _last[0][:2] == (job.session, ref)):
        _last.clear()
        _last.append((job.session, ref, ref.open() if file is None else taken(file)))
    return _last[0][2]


def opened(job: Job, file: Path | None = None) -> Opened:
    """Open the capture of a unit, and keep it at hand for :func:`judged`.

    Parameters
    ----------
    job : Job
    file : Path, optional
        Where to put it for other processes, if they would take as long to make it.
    """
    capture = _at_hand(job)
    if job.frozen is not None and isinstance(capture, Capture):
        try:
            job.frozen.check(job.unit.dataset, job.unit.ref.name, capture)
        except ChangedCapture as error:
            return Opened(changed=str(error))
    handed = file is not None and hand_over(capture, file)
    return Opened(len(capture), capture.sha256, file if handed else None)


_pipelines: dict[tuple[str, str], Pipeline | MappingPipeline] = {}


def _checked(session: str, detector: DetectorConfig) -> Pipeline | MappingPipeline:
    """Pipeline of a detector; kept as long as the run lasts."""
    known = _pipelines.get((session, detector.name))
    if known is None:
        for old in [key for key in _pipelines if key[0] != session]:
            del _pipelines[old]
        known = Pipeline(detector) if detector.mapper is None else MappingPipeline(detector)
        _pipelines[session, detector.name] = known
    return known


def found(job: Job, file: Path | None = None) -> Found:
    """What the detector of a unit finds on its capture, with one thread.

    Parameters
    ----------
    job : Job
    file : Path, optional
        Where the capture lies, if :func:`opened` has put it there.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        capture = _at_hand(job, file)
        detections = _detected(_checked(job.session, job.unit.detector), capture)
        candidates = detections.candidates
    return Found(_bare(detections), None if candidates is None else _bare(candidates))


def judged(job: Job, message: bytes | None) -> Finished:
    """Score what a detector has found, in a process that has not run it.

    Parameters
    ----------
    job : Job
    message : bytes or None
        A :class:`Found` as the detector's process has packed it; None for what another program has found.
    """
    unit, capture = job.unit, _at_hand(job)
    stored, results, identity = None, dict[str, Any](), job.identity
    if message is None:
        stored, results = _read(unit, capture)
        answer, identity = Found(stored.detections, None), ResultsFolder(unit.detector).identity(stored.sha256)
    else:
        answer = unpacked(message)
        if not isinstance(answer, Found):
            raise PluginError("the detector's process gave something else than detections")
    detections, header = answer.detections, capture.header
    if answer.candidates is not None:
        detections = detections.annotated(candidates=answer.candidates)
    rows, curve = score_rows(detections, header, job.rules), None
    if scorable(rows):
        scene = Scene.of(detections, header)
        rows = with_causes(rows, detections, scene, job.rules)
        curve = ranked(detections, scene, job.rules[0], unit.detector.score)
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
        **results,
    }
    entry = entry_of(
        unit,
        "done",
        identity=accuracy_identity(identity, capture.sha256, job.rules),
        capture_id=unit.capture_id,
        scores=rows,
        facts=facts,
    )
    keeps = any(rule.scoring in ("peak", "presence") for rule in job.rules)
    return Finished(
        entry=entry,
        found=_bare(detections),
        candidates=answer.candidates if keeps else None,
        header=header,
        sha256=capture.sha256,
        curve=curve,
        times_us=None if stored is None else stored.times_us,
    )


def _detected(pipeline: Pipeline | MappingPipeline, capture: Capture | Drive) -> Detections:
    """What a detector finds on a capture, or a mapper's on a run."""
    if isinstance(pipeline, MappingPipeline):
        assert isinstance(capture, Drive)  # noqa: S101 - planned so
        return pipeline.run(capture, handed_out=True)
    assert isinstance(capture, Capture)  # noqa: S101
    # Kernels count nothing that they drop, so a second pass tells; plain stages do so in the first.
    return pipeline.run(capture, candidates=not pipeline.open(capture).fused, handed_out=True)


def _read(unit: Unit, capture: Capture | Drive) -> tuple[ResultsFile, dict[str, Any]]:
    """What another program has found, and facts about its file; its times are summed up as reported."""
    folder = ResultsFolder(unit.detector)
    stored = folder.read(unit.dataset, unit.ref.name, capture)
    path = folder.file_of(unit.dataset, unit.ref.name)
    facts: dict[str, Any] = {RESULTS_FACT: {"file": str(path.relative_to(folder.folder)), "sha256": stored.sha256}}
    if stored.times_us is not None and len(stored.times_us):
        facts[REPORTED_FACT] = reported_times(stored.times_us)
    about = "times as it reports them" if REPORTED_FACT in facts else "no time"
    note = f"{RESULTS_FILE}: read, not run; {about}, and no hard cases"
    annotated = stored.detections.annotated(notes=[note, *stored.detections.notes])
    return replace(stored, detections=annotated), facts


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
    bare = bare.annotated(mapped=detections.mapped)
    answered = detections.answered
    return bare if answered is None else bare.with_hand_outs(columns[HANDED_OUT], answered)
