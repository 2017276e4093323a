"""What pictures are drawn from: detections with the capture they belong to, fresh or out of a run folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from uwbbench.api import registry
from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ConfigError, StoreError, nearest
from uwbbench.api.mapper import Mapped
from uwbbench.api.stage import Filter
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.results.units import units_of
from uwbbench.run.folder import RunFolder


@dataclass(frozen=True)
class Result:
    """What one detector found on one capture.

    Attributes
    ----------
    header : CaptureHeader
    detector : str
        Name of the detector.
    dataset : str
        Name of the dataset in the run; empty for a capture file.
    detections : Detections
    filters : frozenset of str
        Labels of the detector's steps that only drop detections.
    """

    header: CaptureHeader
    detector: str
    dataset: str
    detections: Detections
    filters: frozenset[str]

    @property
    def subject(self) -> str:
        """Sentence that names capture and detector, and says so where the capture is simulated."""
        return f"{about(self.header)} Detector {self.detector}."

    @cached_property
    def candidates(self) -> Detections:
        """Peaks before the filters.

        Raises
        ------
        StoreError
            If the run did not keep them.
        """
        known = self.detections.candidates
        if known is None or "retained" not in known:
            raise StoreError(
                f"the run did not keep the peaks before the filters of '{self.detector}' on '{self.header.name}'; "
                "add 'peak' to the experiment's scoring, or plot the capture file with --detector"
            )
        return known


def about(header: CaptureHeader) -> str:
    """Sentence that names a capture, and says so where it is simulated."""
    names = [radar.receiver for radar in header.radars or (header.radar,)]
    several = f", receiver{'s' * (len(names) > 1)} {', '.join(names)}" if names != ["main"] else ""
    channel = f", channel {header.radar.channel}" if header.radar.channel else ""
    kind = "SIMULATED" if header.source == "simulated" else "Measured"
    return f"{kind} {'run' if header.radars else 'capture'} {header.name}{channel}{several}."


def from_capture(capture: Capture, detector: Pipeline) -> Result:
    """Run a detector on a capture, keeping the peaks before its filters."""
    detections = detector.run(capture, candidates=True)
    steps = [(step.label, step.use) for step in detector.config.steps]
    return Result(capture.header, detector.name, "", detections, _filters(steps))


def from_run(
    folder: RunFolder, detector: str | None = None, capture: str | None = None, dataset: str | None = None
) -> list[Result]:
    """Stored detections of a run, of all detectors, captures and datasets unless some are named.

    Parameters
    ----------
    folder : RunFolder
    detector, capture, dataset : str, optional
        Names.

    Returns
    -------
    list of Result
        In the order of the run's detectors, then by dataset and capture.

    Raises
    ------
    ConfigError
        If the run has none of that name.
    StoreError
        If nothing was stored.
    """
    chosen = units_of(folder, "accuracy", detector, capture, dataset)
    steps = {
        config["name"]: [(step["as"], step["use"]) for step in config["pipeline"]]
        for config in folder.manifest["experiment"]["detectors"]
    }
    order = list(steps)
    return [
        Result(
            header=folder.header(entry.capture_id),
            detector=entry.detector,
            dataset=entry.dataset,
            detections=folder.detections(entry.unit),
            filters=_filters(steps[entry.detector]),
        )
        for entry in sorted(chosen, key=lambda e: (order.index(e.detector), e.dataset, e.capture))
    ]


def rules_of_run(folder: RunFolder, scoring: str | None) -> ScoringRules:
    """Rules of a run's scores: of the named scoring, else the first.

    Raises
    ------
    ConfigError
        If the run was not scored so.
    """
    rules = {rule.scoring: rule for rule in folder.rules}
    if scoring is not None and scoring not in rules:
        raise ConfigError(
            f"{folder.path}: was not scored by '{scoring}'.{nearest(scoring, rules)} See 'uwbbench rescore'"
        )
    return rules[scoring] if scoring in rules else next(iter(rules.values()))


def one_of(results: list[Result], where: str) -> Result:
    """The only one, for a kind of picture that shows one detector on one capture.

    Raises
    ------
    ConfigError
        If there are several.
    """
    for option, names in (
        ("--detector", _distinct(results, lambda result: result.detector)),
        ("--capture", _distinct(results, lambda result: result.header.name)),
        ("--dataset", _distinct(results, lambda result: result.dataset)),
    ):
        if len(names) > 1:
            raise ConfigError(f"{where}: choose one with {option}: {', '.join(names)}")
    return results[0]


def mapped_of(result: Result) -> Mapped:
    """Poses and map of a result.

    Raises
    ------
    ConfigError
        If its detector has no mapper.
    """
    mapped = result.detections.mapped
    if mapped is None:
        raise ConfigError(f"detector '{result.detector}' has no mapper: it hands out no poses and makes no map")
    return mapped


def _distinct(results: list[Result], key: Callable[[Result], str]) -> list[str]:
    return list(dict.fromkeys(map(key, results)))


def _filters(steps: list[tuple[str, str]]) -> frozenset[str]:
    return frozenset(label for label, use in steps if issubclass(registry.load_plugin("stages", use), Filter))
