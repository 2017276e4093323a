"""The training file: which step of a detector learns, from which captures, and which show what that is worth."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError, nearest
from uwbbench.api.learning import LearnedParams
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.datasets import DatasetSource, DatasetUse, dataset_sources
from uwbbench.config.detector import DetectorConfig, Step
from uwbbench.config.given import Given, read_model
from uwbbench.config.model import ConfigModel
from uwbbench.config.source import data_roots
from uwbbench.run.experiment import Experiment
from uwbbench.tools.tune.config import detector_of, experiment_of

By = Literal["recording", "scene", "room"]


class SplitModel(ConfigModel):
    """What must not lie on both sides of a split. Single frames are no choice: those of a recording are alike."""

    by: By = Field(
        default="recording",
        description="recording: all that its receivers saw; scene: as the dataset says; room: several scenes, which "
        "'variants' brings together.",
    )
    variants: str | None = Field(
        default=None,
        description="For rooms: regular expression of the part of scene names by which scenes of one room differ.",
    )
    folds: int | None = Field(
        default=None, ge=2, le=100, description="Also train on all parts but one, and try it on that one, each in turn."
    )

    @model_validator(mode="after")
    def _rooms_are_known(self) -> Self:
        if (self.by == "room") != (self.variants is not None):
            raise ValueError(
                "'variants' says which scenes are of one room: it goes with 'by: room', and with nothing else"
            )
        try:
            re.compile(self.variants or "")
        except re.error as error:
            raise ValueError(f"variants is no regular expression: {error}") from None
        return self


class TrainModel(ConfigModel):
    """A training: a detector, its step that learns, and captures to learn from and to try it on."""

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    name: str | None = Field(default=None, min_length=1, description="Name of the training; the file's if left out.")
    description: str = ""
    detector: str = Field(description="Detector by name, or a YAML file; the steps before the one that learns are run.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values to change in the detector first, by path.")
    step: str | None = Field(
        default=None, min_length=1, description="Label of the step that learns; the only one if left out."
    )
    training: list[DatasetUse] = Field(min_length=1, description="Captures to learn from.")
    validation: list[DatasetUse] = Field(default_factory=list, description="Captures to choose or to stop by.")
    held_out: list[DatasetUse] = Field(
        default_factory=list, description="Captures that show what it is worth, and that nothing is chosen by."
    )
    split: SplitModel = Field(default_factory=SplitModel)
    experiment: str | None = Field(
        default=None, min_length=1, description="Experiment whose captures must not be learned from, by name or file."
    )
    seed: int = Field(default=0, ge=0, description="Of all that learning draws.")


@dataclass(frozen=True)
class Training:
    """A checked training file.

    Attributes
    ----------
    name : str
    model : TrainModel
        Values of the file.
    detector : DetectorConfig
        With the values of ``set``, and without weights at the step that learns.
    step : Step
        The step that learns.
    training, validation, held_out : tuple of DatasetSource
    experiment : Experiment or None
    """

    name: str
    model: TrainModel
    detector: DetectorConfig
    step: Step
    training: tuple[DatasetSource, ...]
    validation: tuple[DatasetSource, ...]
    held_out: tuple[DatasetSource, ...]
    experiment: Experiment | None


def read_training(
    name: Given,
    changes: Mapping[str, Any] | None = None,
    data_dir: Path | None = None,
    experiment: str | None = None,
) -> Training:
    """Read a training file.

    Parameters
    ----------
    name : str, Path or mapping
        Shipped name, a path to a YAML file, or the values of one.
    changes : mapping, optional
        Values to change, by path, before checking: ``{"seed": 2}``.
    data_dir : Path, optional
        First folder in which datasets are searched.
    experiment : str, optional
        Experiment whose captures must not be learned from, instead of the file's.

    Returns
    -------
    Training

    Raises
    ------
    ConfigError, PluginError
        If a file is missing or wrong; the message names file, line and key.
    """
    path, source, model = read_model(TrainModel, "training", name, changes)
    _, config = detector_of(model.detector, model.set, source, path)
    step = _learning_step(config, model, source)
    without = {**model.set, f"pipeline.{step.label}.params.weights": None}
    _, config = detector_of(model.detector, without, source, path)
    roots = [str(root) for root in data_roots(data_dir, path)]
    return Training(
        name=model.name or path.stem,
        model=model,
        detector=config,
        step=next(one for one in config.steps if one.label == step.label),
        training=dataset_sources(model.training, source, roots, "training"),
        validation=dataset_sources(model.validation, source, roots, "validation"),
        held_out=dataset_sources(model.held_out, source, roots, "held_out"),
        experiment=experiment_of(model.experiment, source, path, data_dir, experiment),
    )


def _learning_step(config: DetectorConfig, model: TrainModel, source: YamlFile) -> Step:
    """Step that is asked for, or the only one that learns."""
    learning = {
        step.label: step
        for step in config.steps
        if issubclass(registry.load_plugin("stages", step.use).params_type(), LearnedParams)
    }
    if model.step is not None:
        if model.step not in learning:
            known = nearest(model.step, learning)
            place = source.place(("step",))
            raise ConfigError(f"{place}: detector '{config.name}' has no step '{model.step}' that learns.{known}")
        return learning[model.step]
    if len(learning) != 1:
        found = f"{', '.join(learning)}; name one with 'step'" if learning else "none"
        place = source.place(("detector",))
        raise ConfigError(f"{place}: steps of detector '{config.name}' that learn: {found}")
    return next(iter(learning.values()))
