"""Scoring: the numbers of one detector on one capture.

What is true, false and missed is the affair of :mod:`uwbbench.measure.accuracy.judge`, whose conventions hold here;
what each number means that of :mod:`uwbbench.measure.accuracy.metrics`. The two tables are those of arXiv 2512.01018:
after filtering, and after mapping.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, get_args

from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import Detections
from uwbbench.api.errors import nearest
from uwbbench.api.metric import Metric, Outcome
from uwbbench.api.outcomes import PresenceOutcome
from uwbbench.config.rules import Scoring, Surface, Table
from uwbbench.measure.accuracy.judge import judge, tables_of
from uwbbench.measure.accuracy.metrics.detection import F1, FalseAlarmsPerMinute, Precision, Recall
from uwbbench.measure.accuracy.metrics.error import (
    Bias,
    MeanAbsoluteError,
    Percentile90,
    Percentile95,
    Scatter,
    StandardDeviation,
    matched_only,
)
from uwbbench.measure.accuracy.metrics.map import MAP_METRICS
from uwbbench.measure.accuracy.metrics.pose import POSE_METRICS
from uwbbench.measure.accuracy.metrics.presence import PRESENCE_METRICS, confusion
from uwbbench.measure.accuracy.metrics.segment import SEGMENT_METRICS
from uwbbench.measure.accuracy.metrics.track import TRACK_METRICS
from uwbbench.measure.accuracy.region import Region
from uwbbench.measure.accuracy.rules import SCORINGS, ScoringRules
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.stats import evaluate
from uwbbench.measure.accuracy.verdict import Verdict

__all__ = ["SCORINGS", "Region", "ScoreBlock", "Scores", "Scoring", "ScoringRules", "outcomes", "score", "tables_of"]


_OWN: Mapping[str, Mapping[str, type[Metric]]] = {
    "track": TRACK_METRICS,
    "segment": SEGMENT_METRICS,
    "presence": PRESENCE_METRICS,
    "pose": POSE_METRICS,
    "map": MAP_METRICS,
}
"""Metrics that one scoring alone has, which its scores hold beside those of every scoring."""


@dataclass(frozen=True)
class ScoreBlock:
    """One table of scores. A number that is undefined is NaN.

    Attributes
    ----------
    precision, recall, f1 : float
    mae_m, p90_m, p95_m, sd_m : float
        Of the absolute errors of all retained detections (:mod:`uwbbench.measure.accuracy.metrics.error`).
    tp, fp, fn, retained : int
    matched_mae_m, matched_p90_m, matched_bias_m, matched_scatter_m : float
        Of true positives only; the recall beside them is the match rate.
    bias_m, scatter_m : float
        Mean of the signed errors of all retained detections, and their spread around it.
    true_empty : int
        Frames with nothing to find and nothing found; not part of any ratio.
    duplicates, structure, unmatched : int
        Retained detections counted apart; duplicates are false positives too, unless the truth is not exhaustive.
    chance_recall : float
        Recall of as many uniformly random ranges of the region in each frame, with a shared match allowed. NaN in the
        mapping table and in ``peak``, whose recall has no such chance level.
    false_alarms_per_minute : float
    recall_with_blind_zone : float
        Recall where the region starts at 0 m.
    frames, unprocessed : int
        Scored frames, and labelled ones that no detector has processed.
    exhaustive : bool
        Whether the truth names all that is visible.
    own : mapping of str to float
        What this scoring alone has, such as ``gospa_m`` of tracks (:mod:`uwbbench.measure.accuracy.metrics.track`); in
        a program's hands like the others: ``block.gospa_m``.
    counts : bool
        Whether detections are counted. Where a run is judged they are not: files then hold ``frames``, ``unprocessed``,
        ``exhaustive`` and ``own`` alone.
    """

    precision: float
    recall: float
    f1: float
    mae_m: float
    p90_m: float
    p95_m: float
    sd_m: float
    tp: int
    fp: int
    fn: int
    retained: int
    matched_mae_m: float
    matched_p90_m: float
    matched_bias_m: float
    matched_scatter_m: float
    bias_m: float
    scatter_m: float
    true_empty: int
    duplicates: int
    structure: int
    unmatched: int
    chance_recall: float
    false_alarms_per_minute: float
    recall_with_blind_zone: float
    frames: int
    unprocessed: int
    exhaustive: bool
    own: Mapping[str, float] = field(default_factory=dict)
    counts: bool = True

    def __getattr__(self, name: str) -> float:
        own = self.__dict__.get("own", {})  # absent while an instance is being unpickled
        if name not in own:
            raise AttributeError(f"this scoring has no '{name}'")
        return float(own[name])

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON, None where a number is undefined."""
        values = dataclasses.asdict(self)
        own = values.pop("own")
        if not values.pop("counts"):
            values = {name: values[name] for name in ("frames", "unprocessed", "exhaustive")}
        values |= own
        return {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in values.items()}


@dataclass(frozen=True)
class Scores:
    """Scores of one detector on one capture.

    A table is also ``scores["filtering"]``; the filtering table's numbers are also attributes: ``scores.f1``.

    Attributes
    ----------
    rules : ScoringRules
    filtering : ScoreBlock
    mapping : ScoreBlock or None
        None where the detector does not cluster positions.
    outcomes : mapping of str to Outcome
        Of each table: what intervals are made of.
    """

    rules: ScoringRules
    filtering: ScoreBlock
    mapping: ScoreBlock | None = None
    outcomes: Mapping[str, Outcome] = field(default_factory=dict, repr=False, compare=False)

    def __repr__(self) -> str:
        block, rules = self.filtering, self.rules
        counts = f"{block.tp} true, {block.fp} false, {block.fn} missed"
        return f"Scores({rules.scoring}, gate {rules.gate_m:g} m: {counts}, F1 {block.f1:.3f}, MAE {block.mae_m:.3f} m)"

    def _repr_html_(self) -> str:
        from uwbbench.show.notebook.scores import scores

        return scores(self)

    def __getitem__(self, table: str) -> ScoreBlock | None:
        if table not in get_args(Table):
            raise KeyError(f"no table '{table}'.{nearest(table, get_args(Table))}")
        block: ScoreBlock | None = getattr(self, table)
        return block

    def __getattr__(self, name: str) -> Any:
        block = self.__dict__.get("filtering")  # absent while an instance is being unpickled
        if block is None or not (name in block.__dict__ or name in block.own):
            raise AttributeError(f"scores have no '{name}'")
        return getattr(block, name)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "scoring": self.rules.scoring,
            "gate_m": self.rules.gate_m,
            "filtering": self.filtering.to_dict(),
            "mapping": None if self.mapping is None else self.mapping.to_dict(),
        }


def score(
    found: Detections,
    capture: CaptureHeader,
    scoring: Scoring = "frame",
    gate_m: float = 0.20,
    region: Region | None = None,
    strongest: int | None = None,
    surface: Surface = "outline",
) -> Scores:
    """Score detections against the ground truth of their capture.

    Parameters
    ----------
    found : Detections
        With ``range_m``; with ``x_m``, ``y_m`` and ``cluster`` too for the mapping table.
    capture : Capture or CaptureHeader
        Its samples are not touched.
    scoring : {"frame", "peak", "object", "latest", "track", "segment", "presence", "pose", "map"}
    gate_m : float
        Largest error of a true detection, inclusive.
    region : Region, optional
    strongest : int, optional
        Score only that many detections of a frame.
    surface : {"outline", "visible"}
        What the error of a position is the distance to: the outline, 0 inside, or what the receiver sees of it.

    Returns
    -------
    Scores

    Raises
    ------
    ScoringError
        If the capture has no truth, the detections are of another capture or lack a range, ``peak`` is asked for and
        the peaks before the filters are not known, ``latest`` and it is not known when the detections were handed out,
        or a parameter is not allowed.
    """
    rules = ScoringRules(scoring, gate_m, region or Region(), strongest, surface)
    return score_scene(found, Scene.of(found, capture), rules)


def score_scene(found: Detections, scene: Scene, rules: ScoringRules) -> Scores:
    """Score detections as :func:`score` does, where several scorings share what there is to be found.

    Parameters
    ----------
    found : Detections
    scene : Scene
        Of these detections on their capture.
    rules : ScoringRules

    Raises
    ------
    ScoringError
        As :func:`score`.
    """
    verdicts = {table: judge(found, scene, rules, table) for table in tables_of(found, rules.scoring)}
    blocks = {table: _block(found, scene, rules, table, verdict) for table, verdict in verdicts.items()}
    kept: dict[str, Outcome] = {table: verdict.outcome for table, verdict in verdicts.items()}
    return Scores(rules, blocks["filtering"], blocks.get("mapping"), kept)


def outcomes(detections: Detections, header: CaptureHeader, rules: ScoringRules) -> dict[str, Outcome]:
    """Outcome of each table, to merge over captures and to resample.

    Parameters
    ----------
    detections : Detections
    header : CaptureHeader
    rules : ScoringRules

    Returns
    -------
    dict of str to Outcome
        ``filtering``, and ``mapping`` where the detections are clustered.

    Raises
    ------
    ScoringError
        As :func:`score`.
    """
    scene = Scene.of(detections, header)
    tables = tables_of(detections, rules.scoring)
    return {table: judge(detections, scene, rules, table).outcome for table in tables}


def column_of(name: str, unit: str) -> str:
    """Column of a metric: lengths say that they are in metres, angles that they are in radians."""
    return f"{name}_{unit}" if unit in ("m", "rad") else name


def _block(detections: Detections, scene: Scene, rules: ScoringRules, table: Table, verdict: Verdict) -> ScoreBlock:
    judged, matched = [verdict.outcome], [matched_only(verdict.outcome)]
    of_run = verdict.outcome.of_run
    everywhere = dataclasses.replace(rules, region=dataclasses.replace(rules.region, min_range_m=0.0))
    from_zero = verdict if of_run else judge(detections, scene, everywhere, table)
    return ScoreBlock(
        precision=evaluate(Precision, judged),
        recall=evaluate(Recall, judged),
        f1=evaluate(F1, judged),
        mae_m=evaluate(MeanAbsoluteError, judged),
        p90_m=evaluate(Percentile90, judged),
        p95_m=evaluate(Percentile95, judged),
        sd_m=evaluate(StandardDeviation, judged),
        tp=int(verdict.outcome.tp.sum()),
        fp=int(verdict.outcome.fp.sum()),
        fn=int(verdict.outcome.fn.sum()),
        retained=len(verdict.outcome.error_m),
        matched_mae_m=evaluate(MeanAbsoluteError, matched),
        matched_p90_m=evaluate(Percentile90, matched),
        matched_bias_m=evaluate(Bias, matched),
        matched_scatter_m=evaluate(Scatter, matched),
        bias_m=evaluate(Bias, judged),
        scatter_m=evaluate(Scatter, judged),
        true_empty=verdict.true_empty,
        duplicates=verdict.duplicates,
        structure=verdict.structure,
        unmatched=verdict.unmatched,
        chance_recall=verdict.chance_recall,
        false_alarms_per_minute=evaluate(FalseAlarmsPerMinute, judged),
        recall_with_blind_zone=evaluate(Recall, [from_zero.outcome]),
        frames=len(verdict.outcome.group),
        unprocessed=len(scene.header) - len(verdict.outcome.group) if rules.scoring == "pose" else scene.unprocessed,
        exhaustive=scene.truth.exhaustive,
        own={
            column_of(name, metric.unit): evaluate(metric, judged)
            for name, metric in _OWN.get(rules.scoring, {}).items()
        }
        | (confusion(verdict.outcome) if isinstance(verdict.outcome, PresenceOutcome) else {}),
        counts=not of_run,
    )
