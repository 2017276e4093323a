"""Carrying out a plan: accuracy in parallel, latency one by one, every finished unit on disk at once."""

from __future__ import annotations

import dataclasses
import re
import time
import traceback
import uuid
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from uwbbench.api.errors import StoreError, UwbbenchError
from uwbbench.api.interruption import by_plugin, listening
from uwbbench.config.detector import DetectorConfig, is_bound, read_detector
from uwbbench.config.identity import detector_identity
from uwbbench.config.seeds import HIDDEN
from uwbbench.detect.pipeline import Pipeline
from uwbbench.detect.results_folder import ResultsFolder
from uwbbench.measure.accuracy.rules import rules_on
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.measure.latency.machine import machine, usable_cores
from uwbbench.run import environment
from uwbbench.run.accuracy import PATIENCE_S, AccuracyPass, contents
from uwbbench.run.crew import Hands, Raised, Task, crew_of, prepare, unpacked
from uwbbench.run.experiment import Experiment
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.identity import accuracy_identity, canonical, latency_identity, plain, stability_name
from uwbbench.run.folder.journal import Entry
from uwbbench.run.folder.reported import REPORTED_FACT
from uwbbench.run.folder.scored import rules_of, table_of, with_metrics
from uwbbench.run.hard_cases import examined
from uwbbench.run.hard_cases import failed as unexamined
from uwbbench.run.hard_cases import identity_of as identity_of_cases
from uwbbench.run.leaks import refuse_trained_on
from uwbbench.run.limits import Allowance
from uwbbench.run.plan import Plan, Unit, plan, reason_of
from uwbbench.run.unit import Finished, Job, entry_of


class Interrupted(UwbbenchError):
    """A run was stopped by the user; all finished units are stored.

    Parameters
    ----------
    folder : Path
        Its run folder.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(f"interrupted; what was finished is in {folder}; continue with --resume {folder}")
        self.folder = folder


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Attributes
    ----------
    done, total : int
        Units, those of an earlier session included.
    entry : Entry
        The unit that has just finished.
    """

    done: int
    total: int
    entry: Entry


def run_experiment(
    experiment: Experiment,
    out: Path | None = None,
    *,
    jobs: int | None = None,
    resume: bool = False,
    isolated: bool = True,
    progress: Callable[[Progress], None] | None = None,
) -> RunFolder:
    """Run an experiment into a run folder.

    A unit (one detector on one capture) that fails is an entry with its reason; the others run all the same.

    Parameters
    ----------
    experiment : Experiment
    out : Path, optional
        New or empty folder; by default ``runs/NAME-TIME``. With ``resume``, the folder to continue.
    jobs : int, optional
        Processes of the accuracy pass; all usable cores by default. Latency is always measured alone.
    resume : bool
        Continue: units whose detector, sources, capture content and scoring are unchanged are not repeated. Failed
        ones are.
    isolated : bool
        Run each detector in processes of its own, and score elsewhere. Without, everything runs in this process, where
        a debugger is: a detector can then change what others find, end the run or hang it, and no limit is kept.
    progress : callable, optional
        Called with a :class:`Progress` after each unit.

    Returns
    -------
    RunFolder

    Raises
    ------
    ConfigError
        If a detector was trained on captures of the experiment.
    StoreError
        If results cannot be written, or the folder holds another experiment.
    Interrupted
        If the user interrupts; nothing finished is lost.
    """
    workers = usable_cores() if jobs is None else max(1, jobs)
    if isolated:
        prepare()  # while the plan is made
    todo = plan(experiment)
    _refuse_leaks(experiment, todo)
    made = _resumed if resume else _created
    session = {**environment.session(workers), "isolated": isolated, "limits": experiment.limits.model_dump()}
    folder = made(experiment, todo, out, session)
    try:
        with listening(), crew_of(workers, experiment.limits.memory_mb, isolated=isolated) as hands:
            _Run(folder, experiment, todo, hands, progress).carry_out()
        folder.seal()
    except KeyboardInterrupt:
        raise Interrupted(folder.path) from None
    return folder


def _refuse_leaks(experiment: Experiment, todo: Plan) -> None:
    """Refuse captures that a detector which runs on them was trained on; each is opened once."""
    for names in dict.fromkeys(source.detectors for source in experiment.datasets):
        labels = {source.label for source in experiment.datasets if source.detectors == names}
        refs = {(unit.dataset, unit.ref.name): unit.ref for unit in todo.units if unit.dataset in labels}
        captures = ((f"{label}: {name}", ref) for (label, name), ref in refs.items())
        refuse_trained_on((one for one in experiment.runnable if not names or one.name in names), captures)


def _created(experiment: Experiment, todo: Plan, out: Path | None, session: dict[str, Any]) -> RunFolder:
    if out is None:
        safe = re.sub(r"[^\w.-]+", "-", experiment.name, flags=re.ASCII).strip("-.")[:60] or "run"
        out = Path("runs") / f"{safe}-{datetime.now():%Y%m%d-%H%M%S}"
    manifest = {
        "experiment": experiment.to_dict(),
        **_code(experiment, todo),
        "scenes": todo.scenes,
        "skipped": todo.skipped,
        **({"runs": todo.runs} if todo.runs else {}),
        **_reported(experiment),
        **({} if experiment.frozen is None else {"frozen": experiment.frozen.contents()}),
        "sessions": [session],
    }
    return RunFolder.create(out, manifest)


def _reported(experiment: Experiment) -> dict[str, Any]:
    """What sources report of the detectors, where they do."""
    figures = {one.name: [each.model_dump() for each in one.reported] for one in experiment.detectors if one.reported}
    return {"reported": figures} if figures else {}


def _code(experiment: Experiment, todo: Plan) -> dict[str, Any]:
    """What detectors and the reference of times are: identities, hashes of what they come from, and who is a bound."""
    sources: dict[str, str] = {}
    for config in experiment.detectors:
        if config.results is None:
            sources |= Pipeline(config).sources
        else:
            units = [unit for unit in todo.units if unit.detector.name == config.name]
            sources |= ResultsFolder(config).source((unit.dataset, unit.ref.name) for unit in units)
    reference = None
    if experiment.latency.enabled and experiment.latency.reference is not None:
        reference = Pipeline(read_detector(experiment.latency.reference)).identity
    return {
        "detectors": {config.name: detector_identity(config.to_dict(), sources) for config in experiment.detectors},
        "sources": sources,
        "bounds": [config.name for config in experiment.detectors if is_bound(config)],
        "reference": reference,
    }


def _resumed(experiment: Experiment, todo: Plan, out: Path | None, session: dict[str, Any]) -> RunFolder:
    if out is None:
        raise StoreError("resuming needs the run folder to continue")
    folder = RunFolder(out)
    before, now = folder.manifest["experiment"], plain(experiment.to_dict())
    seeds = [one.get("suite", {}).get("seeds", "") for one in (before, now)]
    if seeds[0] != seeds[1]:
        said = [f"seeds {one[:12]}" if one else "no secret seeds" for one in seeds]
        raise StoreError(f"{out}: was run with {said[0]}, not with {said[1]}; resume it with the same --seeds")
    if canonical(before) != canonical(now):
        keys = [key for key in now if canonical(now[key]) != canonical(before.get(key))]
        raise StoreError(
            f"{out}: holds a run of another configuration (different: {', '.join(keys)}); "
            "resume with the same experiment, or give a new folder"
        )
    folder.update_manifest(
        **_code(experiment, todo),
        scenes={**folder.manifest.get("scenes", {}), **todo.scenes},
        skipped=todo.skipped,
        **({"runs": todo.runs} if todo.runs else {}),
        sessions=[*folder.manifest["sessions"], session],
    )
    return folder


class _Run:
    """One session of work on a run folder."""

    def __init__(
        self,
        folder: RunFolder,
        experiment: Experiment,
        todo: Plan,
        hands: Hands,
        progress: Callable[[Progress], None] | None,
    ) -> None:
        self.folder, self.experiment, self.plan = folder, experiment, todo
        self.hands, self.progress = hands, progress
        self.rules = rules_of(experiment.to_dict())
        self.session = uuid.uuid4().hex
        self.done = self.total = 0
        self._identities: dict[str, str] = {}

    def carry_out(self) -> None:
        before = {entry.unit: entry for entry in self.folder.entries()}
        broken = {entry.unit for entry in self.plan.failures}
        for entry in self.plan.failures:
            self.folder.record(self._without_seeds(entry))
        for entry in before.values():  # a dataset that is there again
            if entry.kind == "listing" and entry.unit not in broken:
                self.folder.record(dataclasses.replace(entry, status="done", reason=""))
        pending = self._pending(before)
        untried = self._unexamined(before)
        self.total = len(self.plan.units) + len(self._examinable)
        self.done = self.total - len(pending) - len(untried)
        accuracy = [unit for unit in pending if unit.kind == "accuracy"]
        try:
            self._detect(accuracy)
        finally:
            self._write_scores()
        self._examine(untried)
        contents = self._contents()
        self.folder.update_manifest(data=contents)
        failed = {
            (entry.detector, entry.dataset, entry.capture)
            for entry in self.folder.entries()
            if entry.kind == "accuracy" and entry.status == "failed"
        }
        for unit in pending:
            if unit.kind != "latency":
                continue
            if (unit.detector.name, unit.dataset, unit.ref.name) in failed:
                self._journal(entry_of(unit, "failed", reason="not timed, as it could not be run"))
            else:
                self._time(unit, contents.get(unit.capture_id, ""))

    @property
    def _examinable(self) -> tuple[DetectorConfig, ...]:
        """Detectors to examine with the hard cases, which are single captures."""
        if not self.experiment.stability:
            return ()
        return tuple(detector for detector in self.experiment.runnable if detector.mapper is None)

    def _unexamined(self, before: dict[str, Entry]) -> list[DetectorConfig]:
        """Detectors whose stability is not known, or has changed with their sources."""
        known = {unit: entry.identity for unit, entry in before.items() if entry.status == "done"}
        return [d for d in self._examinable if known.get(stability_name(d.name)) != identity_of_cases(d)]

    def _examine(self, detectors: list[DetectorConfig]) -> None:
        """Examine detectors with the hard cases; one that takes its process down does not take the others' results."""
        waiting, running = deque(detectors), dict[Task, DetectorConfig]()
        limit_s = self.experiment.limits.unit_s or PATIENCE_S
        while waiting or running:
            while waiting and len(running) < self.hands.size:
                detector = waiting.popleft()
                task = Task(f"detector {detector.name}", examined, (detector,), limit_s, ", its limit")
                running[task] = detector
                self.hands.start(task)
            ending = self.hands.next()
            detector = running.pop(ending.task)
            if ending.message is None:
                raised = ending.raised or Raised("it gave nothing", "")
                self._journal(unexamined(detector, raised.reason, raised.traceback))
            else:
                self._journal(unpacked(ending.message))

    def _pending(self, before: dict[str, Entry]) -> list[Unit]:
        """Units to run: all but those that gave the same before."""
        maybe = [unit for unit in self.plan.units if unit.id in before and before[unit.id].status == "done"]
        captures = {unit.capture_id: unit for unit in maybe}
        sha256 = contents(self.hands, [self._job(unit) for unit in captures.values()])
        same = {unit.id for unit in maybe if before[unit.id].identity == self._identity(unit, sha256[unit.capture_id])}
        return [unit for unit in self.plan.units if unit.id not in same]

    def _job(self, unit: Unit) -> Job:
        frozen = self.experiment.frozen
        mark = None if frozen is None else frozen.only(unit.dataset, unit.ref.name)
        identity = "" if unit.detector.results is not None else self._detector_identity(unit.detector)
        return Job(unit, self._rules(unit.dataset), self.session, identity, mark)

    def _detector_identity(self, detector: DetectorConfig) -> str:
        """Identity of a detector, for which all its sources are read: once."""
        if detector.name not in self._identities:
            self._identities[detector.name] = Pipeline(detector).identity
        return self._identities[detector.name]

    def _rules(self, dataset: str) -> tuple[ScoringRules, ...]:
        """Rules of the captures of one dataset."""
        return tuple(rules_on(self.rules, dataset))

    def _identity(self, unit: Unit, sha256: str) -> str:
        """Identity of a unit on a capture of this content, here and now."""
        if unit.detector.results is None:
            detector = self._detector_identity(unit.detector)
        else:
            stored = ResultsFolder(unit.detector)
            detector = stored.identity(stored.content(unit.dataset, unit.ref.name))
        if unit.kind == "latency":
            return latency_identity(detector, sha256, self.experiment.latency.model_dump(), machine())
        return accuracy_identity(detector, sha256, self._rules(unit.dataset))

    def _detect(self, units: list[Unit]) -> None:
        allowance = Allowance(self.experiment.limits)
        for finished in AccuracyPass(self.hands, [self._job(unit) for unit in units], allowance).finished():
            self._store(finished)

    def _store(self, finished: Finished) -> None:
        entry = finished.entry
        if finished.header is not None and finished.found is not None:
            self.folder.write_header(entry.capture_id, finished.header, finished.sha256)
            self.folder.write_detections(entry.unit, finished.found, finished.candidates)
            self.folder.write_mapped(entry.unit, finished.found.mapped, finished.header.trajectory.timestamp_s)
            self.folder.write_curve(entry.unit, finished.curve, self._rules(entry.dataset)[0])
        if finished.times_us is not None:
            self.folder.write_times(entry.unit, finished.times_us, entry.facts.get(REPORTED_FACT, {}))
        self._journal(entry)

    def _without_seeds(self, entry: Entry) -> Entry:
        """The entry with nothing secret in what a plugin says of its failure."""
        for dataset in self.experiment.datasets:
            for value in dataset.secret.values():
                texts = {name: getattr(entry, name).replace(str(value), HIDDEN) for name in ("reason", "traceback")}
                entry = dataclasses.replace(entry, **texts)
        return entry

    def _journal(self, entry: Entry) -> None:
        entry = self._without_seeds(entry)
        self.folder.record(entry)
        self.done += 1
        if self.progress is not None:
            self.progress(Progress(self.done, self.total, entry))

    def _time(self, unit: Unit, sha256: str) -> None:
        from uwbbench.measure.latency import measure

        started = time.perf_counter()
        try:
            latency = measure(unit.ref, unit.detector, self.experiment.latency)
        except BaseException as error:  # a measurement that fails is a row
            if not by_plugin(error):
                raise
            self._journal(entry_of(unit, "failed", reason=reason_of(error), traceback=traceback.format_exc()))
            return
        self.folder.write_times(unit.id, latency.times_us, latency.to_dict(), latency.step_us)
        if latency.paced is not None:
            self.folder.write_times(f"{unit.id}-paced", latency.paced_times_us, latency.paced)
        facts = {**latency.to_dict(), "elapsed_s": time.perf_counter() - started}
        identity = self._identity(unit, sha256)
        capture_id = unit.capture_id if sha256 else ""
        self._journal(entry_of(unit, "done", identity=identity, capture_id=capture_id, facts=facts))

    def _contents(self) -> dict[str, str]:
        """SHA-256 of each stored capture."""
        known = {entry.capture_id for entry in self.folder.entries() if entry.capture_id}
        return {capture_id: self.folder.content(capture_id) for capture_id in sorted(known)}

    def _write_scores(self) -> None:
        entries = self.folder.entries()
        scored = {entry.unit: entry.scores for entry in entries if entry.status == "done"}
        rows = with_metrics(self.folder, scored, self.rules, self.experiment.metrics)
        self.folder.write_scores(table_of(entries, rows), self.rules)
