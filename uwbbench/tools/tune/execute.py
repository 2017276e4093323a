"""Tuning: every set on the tuning captures of each group, and the chosen one on the captures held out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.api.errors import ConfigError
from uwbbench.api.override import with_values
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.detector import check_detector
from uwbbench.detect.pipeline import Pipeline
from uwbbench.run.leaks import refuse_trained_on
from uwbbench.tools.tune.captures import Group, Labelled, grouped, opened, refuse_leaks
from uwbbench.tools.tune.choice import StableZone, best_of, stable_zone
from uwbbench.tools.tune.config import SearchModel, Tuning
from uwbbench.tools.tune.evaluate import Result, outcomes_of, result_of, scores_of, scores_of_sets
from uwbbench.tools.tune.search import require_optuna, search, within
from uwbbench.tools.tune.sweep.scores import SetScores

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Tuned:
    """What one group was tuned to.

    Attributes
    ----------
    group : Group
    columns : dict of str to list
        Value of each parameter in every set that was tried, by path.
    scores : SetScores
        Of every set, on the tuning captures.
    best : int
        The chosen set.
    zone : StableZone or None
        None after a search, whose sets are no grid.
    before, after : Result
        The detector as it was and as it is tuned, on the tuning captures.
    held_out_before, held_out_after : Result or None
        The same on the captures held out; None where none of them belongs to the group.
    """

    group: Group
    columns: dict[str, list[Any]]
    scores: SetScores
    best: int
    zone: StableZone | None
    before: Result
    after: Result
    held_out_before: Result | None
    held_out_after: Result | None

    @property
    def values(self) -> dict[str, Any]:
        """Chosen values by path."""
        return {path: column[self.best] for path, column in self.columns.items()}


@dataclass(frozen=True)
class TuneOutcome:
    """What a tuning gave.

    Attributes
    ----------
    tuning : Tuning
    groups : tuple of Tuned
    captures, held_out : tuple of Labelled
    notes : tuple of str
        What a reader of the results must know.
    """

    tuning: Tuning
    groups: tuple[Tuned, ...]
    captures: tuple[Labelled, ...]
    held_out: tuple[Labelled, ...]
    notes: tuple[str, ...]


def tune(tuning: Tuning, progress: Progress = lambda _: None) -> TuneOutcome:
    """Tune a detector for each group of captures.

    Parameters
    ----------
    tuning : Tuning
    progress : callable
        Receives what is being done, for people.

    Returns
    -------
    TuneOutcome

    Raises
    ------
    ConfigError
        If captures that are held out, or that the experiment scores, would be tuned on.
    CaptureError, ScoringError
        If a capture cannot be read, or scored as asked.
    """
    if tuning.model.search is not None:
        require_optuna()
    progress("opening captures")
    captures, held_out = opened(tuning.tuning), opened(tuning.held_out)
    progress("comparing their contents")
    refuse_leaks(captures, held_out, tuning.experiment)
    refuse_trained_on([tuning.detector], ((one.text, one.capture) for one in (*captures, *held_out)))
    groups = grouped(tuning.model.groups, captures, held_out)
    if not groups:
        raise ConfigError(
            f"{tuning.name}: the tuning captures make none of the groups {', '.join(tuning.model.groups)}"
        )
    swept = {} if tuning.sweep is None else _swept(tuning, captures, progress)
    tuned = []
    for group in groups:
        progress(f"tuning for {group.text}")
        tuned.append(
            _of_grid(tuning, group, swept) if tuning.sweep is not None else _of_search(tuning, group, progress)
        )
    return TuneOutcome(tuning, tuple(tuned), captures, held_out, _notes(tuning, captures, tuned))


def variant(tuning: Tuning, values: Mapping[str, Any]) -> Pipeline:
    """Detector of a tuning with some values changed, by path."""
    data = with_values(tuning.detector.here(), values, tuning.name)
    return Pipeline(check_detector(data, YamlFile(tuning.name, data, {})))


def _swept(tuning: Tuning, captures: Sequence[Labelled], progress: Progress) -> dict[int, SetScores]:
    """Scores of all sets of the grid on each capture."""
    assert tuning.sweep is not None  # noqa: S101
    scores = {}
    for number, one in enumerate(captures, 1):
        progress(f"{len(tuning.sweep)} sets on capture {number} of {len(captures)}: {one.text}")
        scores[id(one)] = scores_of_sets(tuning.sweep.run(one.capture), one, tuning.rules)
    return scores


def _of_grid(tuning: Tuning, group: Group, swept: Mapping[int, SetScores]) -> Tuned:
    sweep = tuning.sweep
    assert sweep is not None  # noqa: S101
    scores = SetScores.merged([swept[id(one)] for one in group.tuning])
    axes = {axis.path: axis.thresholds for axis in sweep.axes}
    zone = stable_zone(scores, tuning.model.stable_within, axes, [np.argsort(axis.place) for axis in sweep.axes])
    places = np.unravel_index(np.arange(len(sweep)), sweep.shape)
    columns = {
        path: [thresholds[place] for place in own.tolist()]
        for (path, thresholds), own in zip(axes.items(), places, strict=True)
    }
    best = best_of(scores, tuning.model.f1_tie, sweep.shape)
    return _concluded(tuning, group, columns, scores, best, zone)


def _of_search(tuning: Tuning, group: Group, progress: Progress) -> Tuned:
    model = tuning.model.search
    assert model is not None  # noqa: S101
    tried: list[dict[str, Any]] = []
    parts: list[SetScores] = []

    def f1_of(values: dict[str, Any]) -> float:
        judged = outcomes_of(variant(tuning, values), group.tuning, tuning.rules, tuning.model.table)
        tried.append(values)
        parts.append(SetScores.merged([scores_of(outcome) for outcome in judged]))
        f1 = float(parts[-1].f1[0])
        progress(f"{group.text}: trial {len(tried)} of {model.trials}, F1 {f1:.3f}")
        return 0.0 if np.isnan(f1) else f1

    search(model, f1_of, _as_it_is(tuning, model))
    scores = SetScores.stacked(parts)
    columns = {path: [values[path] for values in tried] for path in model.space}
    best = best_of(scores, tuning.model.f1_tie, (len(tried),))
    return _concluded(tuning, group, columns, scores, best, None)


def _as_it_is(tuning: Tuning, model: SearchModel) -> dict[str, Any]:
    """Values of the detector as it is, as far as the file names them and the space holds them."""
    known = {
        f"pipeline.{step.label}.params.{name}": value
        for step in tuning.detector.steps
        for name, value in step.params.items()
    }
    return {path: known[path] for path, space in model.space.items() if path in known and within(space, known[path])}


def _concluded(
    tuning: Tuning, group: Group, columns: dict[str, list[Any]], scores: SetScores, best: int, zone: StableZone | None
) -> Tuned:
    """Chosen set beside the detector as it was, on both kinds of captures."""
    after = variant(tuning, {path: column[best] for path, column in columns.items()})
    before = Pipeline(tuning.detector)

    def results(captures: Sequence[Labelled]) -> list[Result | None]:
        if not captures:
            return [None, None]
        judged = [outcomes_of(one, captures, tuning.rules, tuning.model.table) for one in (before, after)]
        scenes = [one.scene for one in captures]
        return [result_of(one, scenes, tuning.model.intervals) for one in judged]

    own_before, own_after = results(group.tuning)
    assert own_before is not None  # noqa: S101
    assert own_after is not None  # noqa: S101
    return Tuned(group, columns, scores, best, zone, own_before, own_after, *results(group.held_out))


def _notes(tuning: Tuning, captures: Sequence[Labelled], found: Sequence[Tuned]) -> tuple[str, ...]:
    notes = []
    if any(one.capture.source == "simulated" for one in captures):
        notes.append("tuned on SIMULATED captures: thresholds for recordings may differ")
    mixed = [one.text for one in captures if len(one.materials) != 1]
    if mixed and {"material", "material-channel"} & set(tuning.model.groups):
        notes.append(f"with obstacles of several materials or none, in no group of a material: {', '.join(mixed)}")
    notes += [f"{one.group.text}: no capture is held out" for one in found if one.held_out_after is None]
    for one in found:
        if ends := _edges(tuning, one):
            notes.append(f"{one.group.text}: at the edge of the grid, which may be too narrow: {', '.join(ends)}")
    return tuple(notes)


def _edges(tuning: Tuning, tuned: Tuned) -> list[str]:
    """Parameters whose chosen value is the first or last of the grid, and better than the one beside it."""
    if tuning.sweep is None:
        return []
    f1 = tuned.scores.f1.reshape(tuning.sweep.shape)
    chosen = tuple(int(place) for place in np.unravel_index(tuned.best, tuning.sweep.shape))
    at_edge = []
    for axis, (one, place) in enumerate(zip(tuning.sweep.axes, chosen, strict=True)):
        last = len(one.thresholds) - 1
        if last and place in (0, last):
            beside = (*chosen[:axis], 1 if place == 0 else last - 1, *chosen[axis + 1 :])
            if f1[chosen] > f1[beside]:
                at_edge.append(one.path)
    return at_edge
