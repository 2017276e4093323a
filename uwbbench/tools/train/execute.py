"""Training: the steps before run on every capture, then the stage fitted, and tried on what it has not seen."""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Literal

from uwbbench.api import registry
from uwbbench.api.arrays import locked
from uwbbench.api.block import Block
from uwbbench.api.errors import ConfigError
from uwbbench.api.learning import Assessed, Example, LearnedParams, Trainable, Weights
from uwbbench.api.recording import leak_key
from uwbbench.api.stage import Stage
from uwbbench.api.weights import About, LearnedFrom, StepBefore, contents, sampling_of
from uwbbench.config.datasets import DatasetSource
from uwbbench.detect.pipeline import Pipeline
from uwbbench.run.leaks import Known
from uwbbench.tools.train.config import Training
from uwbbench.tools.tune.captures import Labelled, opened

Progress = Callable[[str], None]
Role = Literal["training", "validation", "held out"]
_LIBRARIES = {"numpy": "numpy", "sklearn": "scikit-learn", "torch": "torch"}


@dataclass(frozen=True)
class Prepared:
    """A capture as it arrives at the stage that learns.

    Attributes
    ----------
    role : {"training", "validation", "held out"}
    labelled : Labelled
    unit : str
        Recording, scene or room that it belongs to, after the training's split.
    example : Example
    """

    role: Role
    labelled: Labelled
    unit: str
    example: Example


@dataclass(frozen=True)
class Score:
    """What the trained stage makes of some captures.

    Attributes
    ----------
    on : str
        Role and dataset, for people.
    captures, units, frames : int
    figures : mapping of str to float
        By the stage's own measures; empty where it has none.
    """

    on: str
    captures: int
    units: int
    frames: int
    figures: Mapping[str, float]


@dataclass(frozen=True)
class Trained:
    """What a training gave.

    Attributes
    ----------
    training : Training
    content : bytes
        The weights file.
    about : About
        What is in its metadata.
    scores : tuple of Score
    source : {"measured", "simulated", "measured and simulated"}
        Of the captures.
    """

    training: Training
    content: bytes
    about: About
    scores: tuple[Score, ...]
    source: str

    @property
    def sha256(self) -> str:
        """Of the weights file."""
        return hashlib.sha256(self.content).hexdigest()


def train(training: Training, progress: Progress = lambda _: None) -> Trained:
    """Train the step of a detector that learns.

    Parameters
    ----------
    training : Training
    progress : callable
        Receives what is being done, for people.

    Returns
    -------
    Trained
        The same bytes for the same captures and seed on one machine.

    Raises
    ------
    ConfigError
        If captures of the training are also to be tried on or scored, are all of one recording, scene or room, or if
        nothing can be learned from them.
    CaptureError, ScoringError
        If a capture cannot be read, or has no truth.
    """
    from threadpoolctl import threadpool_limits

    captures = _captures(training, progress)
    _refuse_shared(training, captures)
    _refuse_scored(training, captures, progress)
    examples = [_prepared(training, captures, place, progress) for place in range(len(captures))]
    mine, chosen_by = _of("training", examples), _of("validation", examples)
    with threadpool_limits(1):  # sums of several threads come in any order
        progress(f"learning from {len(mine)} captures")
        weights = _fitted(training, mine, chosen_by)
        scores = [*_scores(training, weights, examples), *_folds(training, mine, chosen_by, progress)]
    about = _about(training, examples)
    sources = sorted({one.labelled.capture.source for one in examples})
    return Trained(training, contents(weights, about), about, tuple(scores), " and ".join(sources))


def _captures(training: Training, progress: Progress) -> list[tuple[Role, Labelled, str]]:
    progress("opening captures")
    named: list[tuple[Role, tuple[DatasetSource, ...]]] = [
        ("training", training.training),
        ("validation", training.validation),
        ("held out", training.held_out),
    ]
    return [(role, one, _unit(training, one)) for role, sources in named for one in opened(sources)]


def _unit(training: Training, one: Labelled) -> str:
    """Recording, scene or room of a capture."""
    split = training.model.split
    if split.by == "recording":
        return leak_key(one.capture.recording)
    return one.scene if split.variants is None else re.sub(split.variants, "", one.scene.partition(": ")[2])


def _refuse_shared(training: Training, captures: Sequence[tuple[Role, Labelled, str]]) -> None:
    """Refuse captures of one recording, scene or room on two sides of the split, and a single one to learn from."""
    by = training.model.split.by
    sides: dict[str, dict[str, Labelled]] = {"training": {}, "validation": {}, "held out": {}}
    recordings = {role: Known() for role in sides}
    for role, one, unit in captures:
        for other in sides:
            if other == role:
                continue
            shared = sides[other].get(unit)
            name = recordings[other].same(one.capture) or (shared.text if shared is not None else None)
            if name is not None:
                raise ConfigError(
                    f"{training.name}: '{one.text}' ({role}) shares its recording or {by} with '{name}' ({other}): "
                    "what the weights are worth on others would not be known"
                )
        sides[role].setdefault(unit, one)
        recordings[role].add(one.text, one.capture.sha256, one.capture.recording)
    if len(sides["training"]) < 2:
        raise ConfigError(
            f"{training.name}: all training captures are of one {by}, so that nothing tells what belongs to it from "
            "what is to be learned; give captures of several"
        )
    folds = training.model.split.folds
    if folds is not None and folds > len(sides["training"]):
        raise ConfigError(f"{training.name}: {folds} folds, but training captures of {len(sides['training'])} {by}s")


def _refuse_scored(training: Training, captures: Sequence[tuple[Role, Labelled, str]], progress: Progress) -> None:
    """Refuse to learn from, or to choose by, what an experiment will score."""
    if training.experiment is None:
        return
    known = Known()
    for role, one, _ in captures:
        if role != "held out":
            known.add(one.text, one.capture.sha256, one.capture.recording)
    for source in training.experiment.datasets:
        progress(f"comparing with what '{training.experiment.name}' scores: {source.label}")
        for ref in source.references():
            if (name := known.same(ref.open())) is not None:
                raise ConfigError(
                    f"experiment '{training.experiment.name}' scores '{source.label}: {ref.name}', of the same "
                    f"recording as '{name}', which would be learned from: its results would say nothing about others"
                )


def _prepared(
    training: Training, captures: Sequence[tuple[Role, Labelled, str]], place: int, progress: Progress
) -> Prepared:
    """A capture behind the steps before the stage that learns."""
    role, one, unit = captures[place]
    progress(f"{role}: capture {place + 1} of {len(captures)}, {one.text}")
    capture = one.capture
    assert capture.truth is not None  # noqa: S101 - opened() has made sure
    block = Block.join(list(Pipeline(training.detector).arriving(capture, training.step.label)))
    return Prepared(
        role, one, unit, Example(block, capture.truth, capture.trajectory, capture.radar, capture.recording)
    )


def _of(role: Role, examples: Iterable[Prepared]) -> list[Prepared]:
    return [one for one in examples if one.role == role]


def _stage(training: Training, examples: Sequence[Prepared]) -> Stage[Any]:
    """The stage that learns, as it is configured for the channel of the captures."""
    cls = registry.load_plugin("stages", training.step.use)
    params, _ = training.step.params_for(examples[0].example.radar.channel)
    stage: Stage[Any] = cls(cls.params_type().model_validate(params))
    return stage


def _fitted(training: Training, mine: Sequence[Prepared], chosen_by: Sequence[Prepared]) -> Weights:
    stage = _stage(training, mine)
    assert isinstance(stage, Trainable)  # noqa: S101 - its parameters say so
    examples, validation = ([one.example for one in side] for side in (mine, chosen_by))
    try:
        weights = stage.fit(examples, seed=training.model.seed, validation=validation)
    except ConfigError as error:
        raise ConfigError(f"{training.name}: step '{training.step.label}': {error}") from None
    return {name: locked(array) for name, array in weights.items()}  # as they are behind a file


def _scores(training: Training, weights: Weights, examples: Sequence[Prepared]) -> list[Score]:
    """What the weights are worth on each dataset of each role."""
    together: dict[str, list[Prepared]] = {}
    for one in examples:
        together.setdefault(f"{one.role}: {one.labelled.dataset}", []).append(one)
    return [_score(training, weights, on, side) for on, side in together.items()]


def _score(training: Training, weights: Weights, on: str, side: Sequence[Prepared]) -> Score:
    stage = _stage(training, side)
    assert isinstance(stage, Trainable)  # noqa: S101
    stage.load(weights)
    stage.open(side[0].labelled.capture.radar)
    figures = stage.assess([one.example for one in side]) if isinstance(stage, Assessed) else {}
    frames = sum(len(one.example.block.frames) for one in side)
    return Score(on, len(side), len({one.unit for one in side}), frames, figures)


def _folds(
    training: Training, mine: Sequence[Prepared], chosen_by: Sequence[Prepared], progress: Progress
) -> list[Score]:
    """What weights of all parts but one are worth on that one, for each part of the training captures."""
    folds = training.model.split.folds
    if folds is None:
        return []
    number = {unit: place % folds for place, unit in enumerate(dict.fromkeys(one.unit for one in mine))}
    scores = []
    for fold in range(folds):
        progress(f"fold {fold + 1} of {folds}")
        own = [one for one in mine if number[one.unit] == fold]
        others = [one for one in mine if number[one.unit] != fold]
        weights = _fitted(training, others, chosen_by)
        scores.append(_score(training, weights, f"fold {fold + 1} of {folds}, by {training.model.split.by}", own))
    return scores


def _about(training: Training, examples: Sequence[Prepared]) -> About:
    pipeline, stage = Pipeline(training.detector), _stage(training, examples)
    assert isinstance(stage.params, LearnedParams)  # noqa: S101
    used = [one for one in examples if one.role != "held out"]
    channels = {one.example.radar.channel for one in used}
    before = [pipeline.steps_before(training.step.label, channel) for channel in sorted(channels, key=str)]
    if any(one != before[0] for one in before):
        raise ConfigError(f"{training.name}: the steps before differ between channels: train each channel for itself")
    radars = list({str(sampling_of(one.example.radar)): sampling_of(one.example.radar) for one in used}.values())
    return About(
        plugin=training.step.use,
        params=stage.params.learned_with,
        before=tuple(StepBefore(**one) for one in before[0]),
        source=pipeline.sources[training.step.use],
        radars=tuple(radars),
        captures=tuple(_learned_from(one) for one in used),
        seed=training.model.seed,
        versions={"uwbbench": version("uwbbench"), **_libraries()},
    )


def _learned_from(one: Prepared) -> LearnedFrom:
    capture = one.labelled.capture
    return LearnedFrom(
        role="training" if one.role == "training" else "validation",
        dataset=one.labelled.dataset,
        capture=capture.name,
        sha256=capture.sha256,
        recording=capture.recording,
    )


def _libraries() -> dict[str, str]:
    """Versions of what may have learned."""
    return {name: version(name) for module, name in _LIBRARIES.items() if module in sys.modules}
