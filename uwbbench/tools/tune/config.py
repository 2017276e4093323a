"""The tuning file: which parameters of a detector are varied, on which captures, and where the result is held out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError
from uwbbench.api.filters import RankFilter
from uwbbench.api.locate import find_config, is_path
from uwbbench.api.override import with_values
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.datasets import DatasetSource, DatasetUse, dataset_sources
from uwbbench.config.detector import DetectorConfig, read_detector
from uwbbench.config.extends import placed
from uwbbench.config.given import Given, read_model
from uwbbench.config.model import ConfigModel
from uwbbench.config.rules import GateRadius, IntervalModel, RegionModel, Table
from uwbbench.config.source import data_roots
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.scoring import Region, ScoringRules
from uwbbench.run.experiment import Experiment, read_experiment
from uwbbench.tools.tune.sweep.sweep import Sweep

By = Literal["material", "channel", "material-channel", "overall"]
Threshold = float | None


class Steps(ConfigModel):
    """Evenly spaced thresholds."""

    start: float
    stop: float
    count: int = Field(ge=2, le=10_000, description="Thresholds, both ends included.")
    spacing: Literal["linear", "log"] = Field(default="linear", description="Equal differences, or equal ratios.")

    @model_validator(mode="after")
    def _log_of_positive(self) -> Self:
        if self.spacing == "log" and not (self.start > 0 and self.stop > 0):
            raise ValueError("spacing log needs a start and a stop above 0")
        return self

    @property
    def values(self) -> list[float]:
        """The thresholds, to twelve digits: 0.3 rather than 0.30000000000000004."""
        spaced = np.geomspace if self.spacing == "log" else np.linspace
        return [float(f"{value:.12g}") for value in spaced(self.start, self.stop, self.count)]


class Interval(ConfigModel):
    """Numbers that a search may take."""

    low: float
    high: float
    step: float | None = Field(default=None, gt=0, description="Distance between values; null: any.")
    log: bool = Field(default=False, description="Search equal ratios alike, instead of equal differences.")
    whole: bool = Field(default=False, description="Whole numbers only.")

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.low >= self.high:
            raise ValueError(f"low ({self.low:g}) must lie below high ({self.high:g})")
        if self.log and (self.low <= 0 or self.step is not None):
            raise ValueError("log needs a low above 0, and no step")
        if self.whole and not all(float(v).is_integer() for v in (self.low, self.high, self.step or 1)):
            raise ValueError("whole needs a whole low, high and step")
        return self

    @property
    def middle(self) -> float:
        """Number in its middle: the geometric one where equal ratios are searched alike."""
        middle = math.sqrt(self.low * self.high) if self.log else (self.low + self.high) / 2
        return round(middle) if self.whole else middle


class Choices(ConfigModel):
    """Values that a search may take."""

    choices: list[str | bool | int | float | None] = Field(min_length=2)

    @field_validator("choices")
    @classmethod
    def _distinct(cls, value: list[Any]) -> list[Any]:
        if len({repr(one) for one in value}) < len(value):
            raise ValueError("a choice is given twice")
        return value


class SearchModel(ConfigModel):
    """Search of a space that is no grid of filters; needs Optuna."""

    space: dict[str, Interval | Choices] = Field(min_length=1, description="What each parameter may be, by its path.")
    trials: int = Field(default=100, ge=1, le=1_000_000, description="Detectors tried for each group.")
    sampler: Literal["tpe", "random"] = Field(default="tpe", description="How Optuna proposes the next one.")
    seed: int = Field(default=0, ge=0, description="Of the sampler.")
    timeout_s: float | None = Field(
        default=None, gt=0, description="Time after which no trial begins; null: as many trials as are asked for."
    )


class TuneModel(ConfigModel):
    """A tuning: a detector, what to vary, and captures to tune on and to hold out."""

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    name: str | None = Field(default=None, min_length=1, description="Name of the tuning; the file's if left out.")
    description: str = ""
    detector: str = Field(description="Detector by name, or a YAML file.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values to change in the detector first, by path.")
    grid: dict[str, list[Threshold] | Steps] | None = Field(
        default=None, description="Thresholds of filters, by path: a list, or start, stop and count."
    )
    search: SearchModel | None = Field(default=None, description="Instead of a grid.")
    tuning: list[DatasetUse] = Field(min_length=1, description="Captures to tune on.")
    held_out: list[DatasetUse] = Field(min_length=1, description="Captures that show what the tuning is worth.")
    experiment: str | None = Field(
        default=None, min_length=1, description="Experiment whose captures must not be tuned on, by name or file."
    )
    groups: list[By] = Field(
        default=["material", "channel", "overall"], min_length=1, description="What is tuned separately."
    )
    scoring: Literal["frame", "peak", "object"] = Field(default="frame", description="How detections are counted.")
    table: Table = Field(
        default="filtering", description="After which half of the chain; a grid is scored after filtering."
    )
    gate_m: GateRadius
    region: RegionModel = Field(default_factory=RegionModel)
    f1_tie: float = Field(default=0.001, ge=0, lt=1, description="Loss of F1 that a lower RMSE may make up for.")
    stable_within: float = Field(default=0.01, ge=0, lt=1, description="Loss of F1 that the stable zone allows.")
    seed: int = Field(default=0, ge=0, description="Of the resampling behind the intervals.")
    intervals: IntervalModel = Field(default_factory=IntervalModel)

    @field_validator("groups")
    @classmethod
    def _distinct(cls, value: list[By]) -> list[By]:
        return list(dict.fromkeys(value))

    @model_validator(mode="after")
    def _grid_or_search(self) -> Self:
        if (self.grid is None) == (self.search is None):
            raise ValueError("expected either 'grid' or 'search'")
        if self.grid is not None and self.table == "mapping":
            raise ValueError("a grid is scored after filtering; table 'mapping' needs 'search'")
        return self


@dataclass(frozen=True)
class Tuning:
    """A checked tuning file.

    Attributes
    ----------
    name : str
    model : TuneModel
        Values of the file.
    detector : DetectorConfig
        With the values of ``set``.
    use : str
        The detector as another file may name it: a registered name, or an absolute path.
    sweep : Sweep or None
        For a grid.
    tuning, held_out : tuple of DatasetSource
    experiment : Experiment or None
    """

    name: str
    model: TuneModel
    detector: DetectorConfig
    use: str
    sweep: Sweep | None
    tuning: tuple[DatasetSource, ...]
    held_out: tuple[DatasetSource, ...]
    experiment: Experiment | None

    @property
    def rules(self) -> ScoringRules:
        """How sets are scored."""
        return ScoringRules(self.model.scoring, self.model.gate_m, Region(**self.model.region.limits))

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of the parameters that are varied."""
        return tuple(axis.path for axis in self.sweep.axes) if self.sweep else tuple(self._search.space)

    @property
    def _search(self) -> SearchModel:
        assert self.model.search is not None  # noqa: S101 - the model has a grid or a search
        return self.model.search

    def to_dict(self) -> dict[str, Any]:
        """Resolved tuning as plain values, without the folders of this machine."""

        def named(sources: tuple[DatasetSource, ...]) -> list[dict[str, Any]]:
            return [{"label": d.label, "use": d.use, "params": d.params, "captures": d.captures} for d in sources]

        grid = None if self.sweep is None else {axis.path: axis.thresholds for axis in self.sweep.axes}
        values = self.model.model_dump(mode="json", by_alias=True, exclude={"detector", "experiment"})
        experiment = None if self.experiment is None else self.experiment.name
        return {
            **values,
            "name": self.name,
            "detector": self.detector.to_dict(),
            "grid": grid,
            "tuning": named(self.tuning),
            "held_out": named(self.held_out),
            "experiment": experiment,
        }


def read_tuning(
    name: Given,
    changes: Mapping[str, Any] | None = None,
    data_dir: Path | None = None,
    experiment: str | None = None,
) -> Tuning:
    """Read a tuning file.

    Parameters
    ----------
    name : str, Path or mapping
        Shipped name, a path to a YAML file, or the values of one.
    changes : mapping, optional
        Values to change, by path, before checking: ``{"search.trials": 20}``.
    data_dir : Path, optional
        First folder in which datasets are searched.
    experiment : str, optional
        Experiment whose captures must not be tuned on, instead of the file's.

    Returns
    -------
    Tuning

    Raises
    ------
    ConfigError, PluginError
        If a file is missing or wrong; the message names file, line and key.
    """
    path, source, model = read_model(TuneModel, "tuning", name, changes)
    use, config = detector_of(model.detector, model.set, source, path)
    roots = [str(root) for root in data_roots(data_dir, path)]
    return Tuning(
        name=model.name or path.stem,
        model=model,
        detector=config,
        use=use,
        sweep=_sweep(model, config, source),
        tuning=dataset_sources(model.tuning, source, roots, "tuning"),
        held_out=dataset_sources(model.held_out, source, roots, "held_out"),
        experiment=experiment_of(model.experiment, source, path, data_dir, experiment),
    )


def detector_of(named: str, changes: Mapping[str, Any], source: YamlFile, path: Path) -> tuple[str, DetectorConfig]:
    """Detector that a file names under ``detector``: as another file may name it, and checked.

    Parameters
    ----------
    named : str
        Name, or path from the file's folder.
    changes : mapping
        Values to change in it, by path.
    source : YamlFile
        The file, for messages.
    path : Path
        Where it lies.

    Raises
    ------
    ConfigError, PluginError
        If the detector is missing or wrong.
    """
    with placed(source, ("detector",)):
        use = str(find_config("detectors", named, path.parent).resolve()) if is_path(named) else named
        config = read_detector(use, None, changes)
        Pipeline(config)
    return use, config


def _sweep(model: TuneModel, config: DetectorConfig, source: YamlFile) -> Sweep | None:
    if model.grid is None:
        assert model.search is not None  # noqa: S101
        for path in model.search.space:
            with placed(source, ("search", "space", path)):
                with_values(config.to_dict(), {path: None}, "--set")
        return None
    grid = {path: given.values if isinstance(given, Steps) else given for path, given in model.grid.items()}
    for path, values in grid.items():  # one at a time, so that the message names the line
        with placed(source, ("grid", path)):
            Sweep(Pipeline(config), {path: values}, leave_out=behind_the_ranges(config))
    if math.prod(map(len, grid.values())) < 1:
        raise ConfigError(f"{source.place(('grid',))}: at least one threshold is needed")
    with placed(source, ("grid",)):
        return Sweep(Pipeline(config), grid, leave_out=behind_the_ranges(config))


def behind_the_ranges(config: DetectorConfig) -> tuple[str, ...]:
    """Labels of the last steps of a detector that change nothing after filtering: a clustering and what follows it."""
    stages = [registry.load_plugin("stages", step.use) for step in config.steps]
    selections = [place for place, stage in enumerate(stages) if issubclass(stage, RankFilter)]
    for place in range(selections[-1] + 1 if selections else len(stages), len(stages)):
        if "detections" in stages[place].consumes and not stages[place].rowwise:
            return tuple(step.label for step in config.steps[place:])
    return ()


def experiment_of(
    named: str | None, source: YamlFile, path: Path, data_dir: Path | None, given: str | None
) -> Experiment | None:
    """Experiment whose captures must not be used; None where there is none.

    Parameters
    ----------
    named : str or None
        As the file has it under ``experiment``: a name, or a path from its folder.
    source : YamlFile
        The file, for messages.
    path : Path
        Where it lies.
    data_dir : Path or None
        First folder in which datasets are searched.
    given : str or None
        Name or path that is used instead of the file's.

    Raises
    ------
    ConfigError, PluginError
        If the experiment is missing or wrong.
    """
    if given is not None:
        return read_experiment(given, data_dir=data_dir)
    if named is None:
        return None
    beside = path.parent / named
    with placed(source, ("experiment",)):
        return read_experiment(beside if beside.is_file() else named, data_dir=data_dir)
