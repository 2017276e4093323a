"""What there is to do: one unit for each detector and capture."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from uwbbench.api.errors import CaptureError
from uwbbench.api.interruption import by_plugin
from uwbbench.api.text import one_line
from uwbbench.config.detector import DetectorConfig
from uwbbench.config.source import CaptureRef, RunRef
from uwbbench.run.experiment import Experiment
from uwbbench.run.folder.identity import capture_name, listing_name, unit_name
from uwbbench.run.folder.journal import Entry

LONGEST_REASON = 400


@dataclass(frozen=True)
class Unit:
    """One detector on one capture, for accuracy or for time.

    Attributes
    ----------
    kind : {"accuracy", "latency"}
    detector : DetectorConfig
    dataset : str
        Label of the dataset.
    ref : CaptureRef or RunRef
        A run where the detector has a mapper.
    """

    kind: Literal["accuracy", "latency"]
    detector: DetectorConfig
    dataset: str
    ref: CaptureRef | RunRef

    @property
    def id(self) -> str:
        """Name of the unit's files: the same in every run of the same experiment."""
        return unit_name(self.kind, self.detector.name, self.dataset, self.capture_id)

    @property
    def capture_id(self) -> str:
        """File name of the capture's header."""
        ref = self.ref
        return capture_name(ref.dataset, ref.params, ref.name, ref.captures if isinstance(ref, RunRef) else ())


@dataclass(frozen=True)
class Plan:
    """All units of an experiment.

    Attributes
    ----------
    units : tuple of Unit
        Accuracy first, captures together; latency last.
    failures : tuple of Entry
        Datasets whose captures could not be listed.
    scenes : dict of dict
        Scene of each capture, by dataset and capture.
    skipped : dict of str
        Optional datasets whose files are not there: the reason, by label.
    runs : dict of dict
        Captures of each run that a mapper is tried on, by dataset and run.
    """

    units: tuple[Unit, ...]
    failures: tuple[Entry, ...]
    scenes: dict[str, dict[str, str]] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)
    runs: dict[str, dict[str, list[str]]] = field(default_factory=dict)


def plan(experiment: Experiment) -> Plan:
    """Plan of an experiment: lists the captures of its datasets, and opens none but the first of an optional one.

    Raises
    ------
    ChangedCapture
        If a suite's datasets have other captures than those that it was frozen with.
    """
    accuracy: list[Unit] = []
    latency: list[Unit] = []
    failures: list[Entry] = []
    scenes: dict[str, dict[str, str]] = {}
    skipped: dict[str, str] = {}
    of_runs: dict[str, dict[str, list[str]]] = {}
    for source in experiment.datasets:
        chosen = [d for d in experiment.detectors if not source.detectors or d.name in source.detectors]
        try:
            references = source.references()
            runs: list[RunRef] = source.runs() if any(d.of_runs for d in chosen) else []
            if source.optional:
                references[0].open()
            scenes[source.label] = source.scenes([ref.name for ref in references])
            scenes[source.label] |= {run.name: run.name for run in runs}
        except BaseException as error:  # an adapter may raise anything; the other datasets still run
            if not by_plugin(error):
                raise
            if source.optional and isinstance(error, CaptureError):
                skipped[source.label] = one_line(error, LONGEST_REASON)
                continue
            failures.append(
                Entry(
                    unit=listing_name(source.label),
                    kind="listing",
                    detector="",
                    dataset=source.label,
                    capture="",
                    status="failed",
                    reason=reason_of(error),
                )
            )
            continue
        if experiment.frozen is not None and not source.optional:
            names = [ref.name for ref in references]
            experiment.frozen.check_names(source.label, names, all_of_them=not experiment.part.quick)
        single = [d for d in chosen if not d.of_runs]
        mapping = [d for d in chosen if d.of_runs]
        pairs: list[tuple[CaptureRef | RunRef, DetectorConfig]] = [(ref, d) for ref in references for d in single]
        pairs += [(run, d) for run in runs for d in mapping]
        if runs:
            of_runs[source.label] = {run.name: list(run.captures) for run in runs}
        accuracy += [Unit("accuracy", d, source.label, ref) for ref, d in pairs]
        if source.timed:
            first = {references[0].name, *(run.name for run in runs[:1])}
            timed = [(ref, d) for ref, d in pairs if experiment.latency.captures == "all" or ref.name in first]
            latency += [Unit("latency", d, source.label, ref) for ref, d in timed if d.results is None]
    units = tuple(accuracy + (latency if experiment.latency.enabled else []))
    return Plan(units, tuple(failures), scenes, skipped, of_runs)


def reason_of(error: BaseException) -> str:
    """One line that says why something failed."""
    return f"{type(error).__name__}: {one_line(error, LONGEST_REASON) or 'no message'}"
