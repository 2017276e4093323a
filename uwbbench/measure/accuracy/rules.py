"""Rules of scoring: what is counted, within which gate and region."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, get_args

from uwbbench.api.errors import ScoringError, nearest
from uwbbench.api.metric import Metric, Outcome
from uwbbench.api.outcomes import MapOutcome, PoseOutcome, PresenceOutcome, SegmentOutcome, TrackOutcome
from uwbbench.config.rules import Scoring, Surface
from uwbbench.measure.accuracy.region import Region

SCORINGS: tuple[Scoring, ...] = get_args(Scoring)

_OUTCOMES: Mapping[str, type[Outcome]] = {
    "track": TrackOutcome,
    "segment": SegmentOutcome,
    "presence": PresenceOutcome,
    "pose": PoseOutcome,
    "map": MapOutcome,
}


def outcome_of(scoring: str) -> type[Outcome]:
    """Outcomes of a scoring: what its metrics are made of."""
    return _OUTCOMES.get(scoring, Outcome)


def has_causes(scoring: str) -> bool:
    """Whether errors in a scoring have causes: not by the latest answer, nor of presence and whole runs."""
    return scoring not in ("latest", "presence") and not outcome_of(scoring).of_run


def applies(metric: type[Metric], scoring: str) -> bool:
    """Whether a metric has a meaning in a scoring: where runs are judged, none that counts detections has."""
    made = outcome_of(scoring)
    return issubclass(made, metric.of) and made.of_run == metric.of.of_run


@dataclass(frozen=True)
class ScoringRules:
    """How to score.

    Parameters
    ----------
    scoring : {"frame", "peak", "object", "latest", "track", "segment", "presence", "pose", "map"}
    gate_m : float
        Largest error of a true detection, inclusive.
    region : Region
    strongest : int or None
        Score only that many detections of a frame, those of largest amplitude in the region.
    surface : {"outline", "visible"}
        What the error of a position is the distance to: the outline, 0 inside, or what the receiver sees of it.
    regions : tuple of (str, Region)
        Datasets of a run, by label, that have a region of their own; see :meth:`of`.
    gates : tuple of (str, float)
        Datasets of a run, by label, that have a gate of their own.
    only : tuple of str or None
        Datasets of a run, by label, that are scored like this; None: all. See :func:`rules_on`.

    Raises
    ------
    ScoringError
        If a value is not allowed.
    """

    scoring: Scoring = "frame"
    gate_m: float = 0.20
    region: Region = field(default_factory=Region)
    strongest: int | None = None
    surface: Surface = "outline"
    regions: tuple[tuple[str, Region], ...] = ()
    gates: tuple[tuple[str, float], ...] = ()
    only: tuple[str, ...] | None = None

    def of(self, dataset: str) -> ScoringRules:
        """Rules of the captures of one dataset of a run, by its label."""
        region, gate_m = dict(self.regions).get(dataset, self.region), dict(self.gates).get(dataset, self.gate_m)
        return replace(self, region=region, gate_m=gate_m, regions=(), gates=(), only=None)

    @property
    def one_to_one(self) -> bool:
        """Whether every object in a frame is one chance, matched with at most one row, and structure is set aside."""
        return self.scoring in ("object", "track", "segment")

    def to_dict(self) -> dict[str, Any]:
        """Rules as plain values; what is of single datasets only where there is any, as earlier versions had none."""
        facts = {name: value for name, value in asdict(self).items() if name not in ("regions", "gates", "only")}
        if self.regions:
            facts["regions"] = {label: asdict(region) for label, region in self.regions}
        if self.gates:
            facts["gates"] = dict(self.gates)
        return facts if self.only is None else {**facts, "only": list(self.only)}

    @classmethod
    def from_dict(cls, facts: Mapping[str, Any]) -> ScoringRules:
        """Rules from plain values."""
        regions = tuple((label, Region(**region)) for label, region in facts.get("regions", {}).items())
        only = tuple(facts["only"]) if "only" in facts else None
        gates = tuple(facts.get("gates", {}).items())
        own = {"region": Region(**facts["region"]), "regions": regions, "gates": gates, "only": only}
        return cls(**{**facts, **own})

    def __post_init__(self) -> None:
        if self.surface not in get_args(Surface):
            raise ScoringError(f"no surface '{self.surface}'.{nearest(self.surface, get_args(Surface))}")
        if self.scoring not in SCORINGS:
            raise ScoringError(f"no scoring '{self.scoring}'.{nearest(self.scoring, SCORINGS)}")
        if not 0 < self.gate_m < math.inf:
            raise ScoringError(f"gate_m must be positive and finite, not {self.gate_m}")
        if self.strongest is not None and self.strongest < 1:
            raise ScoringError(f"strongest must be at least 1, not {self.strongest}")


def rules_on(rules: Iterable[ScoringRules], dataset: str) -> list[ScoringRules]:
    """Rules by which the captures of one dataset of a run, by its label, are scored."""
    return [rule.of(dataset) for rule in rules if rule.only is None or dataset in rule.only]
