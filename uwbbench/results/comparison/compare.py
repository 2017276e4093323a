"""Comparing two runs, in the order in which one asks: what went in, what came out, which frames."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from uwbbench.api.errors import ConfigError, nearest
from uwbbench.api.text import printable
from uwbbench.config.identity import from_results, marked
from uwbbench.measure.accuracy.metrics.choice import MetricChoice, combined
from uwbbench.results.comparison.causes import CauseChange, cause_changes
from uwbbench.results.comparison.changes import Change, changes
from uwbbench.results.comparison.flips import Flip, flips
from uwbbench.results.comparison.scores import ScoreChange, TimeChange, score_changes, time_changes
from uwbbench.results.comparison.units import shared
from uwbbench.results.report import read_safely
from uwbbench.run.folder.folder import RunFolder

MOST_FLIPS = 20
LONGEST_NAME = 60


@dataclass(frozen=True)
class Comparison:
    """What differs between two runs.

    Attributes
    ----------
    first, second : RunFolder
    changes : tuple of Change
        In configuration, code, data and machine.
    metrics : MetricChoice
        Those that either run shows.
    scores : tuple of ScoreChange
    times : tuple of TimeChange
    scoring : str
        Of the flips.
    compared_frames : int
    flip_counts : mapping
        By detector: frames from which outcome to which.
    worst : tuple of Flip
        The worst first.
    causes : tuple of CauseChange
        Causes of errors of that scoring whose count changed, those that grew most first.
    notes : tuple of str
        What was not compared, and what a reader must know.
    """

    first: RunFolder
    second: RunFolder
    changes: tuple[Change, ...]
    metrics: MetricChoice
    scores: tuple[ScoreChange, ...]
    times: tuple[TimeChange, ...]
    scoring: str
    compared_frames: int
    flip_counts: Mapping[str, Counter[tuple[str, str]]]
    worst: tuple[Flip, ...]
    causes: tuple[CauseChange, ...]
    notes: tuple[str, ...]

    @property
    def changed_scores(self) -> tuple[ScoreChange, ...]:
        """Scores that differ by more than rounding."""
        return tuple(change for change in self.scores if change.changed)

    @property
    def differs(self) -> bool:
        """Whether anything differs but measured times and the machine, which never repeat."""
        inputs = any(change.kind != "machine" for change in self.changes)
        return (
            inputs or bool(self.changed_scores) or any(self.flip_counts.values()) or bool(self.causes) or self._unequal
        )

    def label(self, detector: str) -> str:
        """Name of a detector as tables show it, which say so where either run read its results from files."""
        configs = [one for folder in (self.first, self.second) for one in folder.manifest["experiment"]["detectors"]]
        read = any(one["name"] == detector and from_results(one) for one in configs)
        return marked(printable(detector, LONGEST_NAME), results_file=read)

    @property
    def _unequal(self) -> bool:
        return any("units not compared" in note for note in self.notes)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; undefined numbers are NaN, which the store writes as null."""
        return {
            "first": str(self.first.path),
            "second": str(self.second.path),
            "differs": self.differs,
            "changes": [vars(change) for change in self.changes],
            "scores": [
                {
                    **dict(zip(("dataset", "source", "scoring", "table"), change.board, strict=True)),
                    **{key: getattr(change, key) for key in ("detector", "metric", "captures", "before", "after")},
                    "difference": dataclasses.asdict(change.difference),
                    "p_adjusted": change.adjusted,
                }
                for change in self.scores
            ],
            "times": [dataclasses.asdict(change) for change in self.times],
            "flips": {
                "scoring": self.scoring,
                "frames": self.compared_frames,
                "counts": [
                    {"detector": detector, "before": before, "after": after, "frames": count}
                    for detector, counter in self.flip_counts.items()
                    for (before, after), count in counter.most_common()
                ],
                "worst": [_flip(flip) for flip in self.worst],
            },
            "causes": [{**vars(change), "growth": change.growth} for change in self.causes],
            "notes": list(self.notes),
        }


def compare(first: RunFolder, second: RunFolder, scoring: str | None = None, most: int = MOST_FLIPS) -> Comparison:
    """Compare two runs from what they stored; nothing is run.

    Parameters
    ----------
    first, second : RunFolder
    scoring : str, optional
        By which frames are compared; the first run's first by default.
    most : int
        Flipped frames that are listed.

    Raises
    ------
    ConfigError
        If the first run was not scored so.
    StoreError
        If something stored is missing or broken.
    """
    with read_safely(first.path):
        rules = {rule.scoring: rule for rule in first.rules}
        settings = {**first.manifest["experiment"]["intervals"], "seed": first.manifest["experiment"]["seed"]}
        metrics = combined([folder.manifest["experiment"]["metrics"] for folder in (first, second)], list(rules))
    if scoring is not None and scoring not in rules:
        raise ConfigError(f"{first.path}: was not scored by '{scoring}'.{nearest(scoring, rules)}")
    rule = next(rule for name, rule in rules.items() if scoring in (None, name))
    with read_safely(second.path):
        different = changes(first, second)
        units, left_out = shared(first, second)
        scores, unjudged = score_changes(units, list(rules.values()), metrics, settings)
        times, untimed = time_changes(first, second)
        counts, frames, worst = flips(units, rule, most)
        causes, unexplained = cause_changes((first, second), units, rule)
    if first.rules != second.rules:
        unjudged.insert(0, "the runs were scored by different rules; both are judged here by those of the first")
    ended = [note for folder in (first, second) for note in _seal(folder)]
    notes = (*ended, *left_out, *unjudged, *untimed, *unexplained, *metrics.notes, *first.damage, *second.damage)
    return Comparison(
        first=first,
        second=second,
        changes=tuple(different),
        metrics=metrics,
        scores=tuple(scores),
        times=tuple(times),
        scoring=rule.scoring,
        compared_frames=frames,
        flip_counts=counts,
        worst=tuple(worst),
        causes=tuple(causes),
        notes=notes,
    )


def _seal(folder: RunFolder) -> Iterator[str]:
    """What its seal says against a run; 'uwbbench verify' looks closer."""
    if not folder.sealed:
        yield f"{folder.path}: is not sealed: the run did not end, or an earlier version made it"
    elif not folder.intact:
        yield f"{folder.path}: its manifest was changed after the run ended; see 'uwbbench verify'"


def _flip(flip: Flip) -> dict[str, Any]:
    about = {key: getattr(flip.unit, key) for key in ("detector", "dataset", "capture")}
    return about | {field.name: getattr(flip, field.name) for field in dataclasses.fields(flip) if field.name != "unit"}
