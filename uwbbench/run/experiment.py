"""The experiment file: which detectors run on which captures, and how they are scored and timed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator

from uwbbench.api import registry
from uwbbench.api.check import checked
from uwbbench.api.errors import ConfigError, nearest
from uwbbench.api.override import with_values
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.datasets import DatasetSource, DatasetUse, dataset_sources
from uwbbench.config.detector import DetectorConfig, read_detector
from uwbbench.config.extends import extended, placed
from uwbbench.config.given import Given, read_given
from uwbbench.config.model import ConfigModel
from uwbbench.config.rules import GateRadius, IntervalModel, MetricsUse, RegionModel, Scoring, Strongest, Surface
from uwbbench.config.seeds import Seeds, read_seeds
from uwbbench.config.source import data_roots
from uwbbench.measure.accuracy.metrics.choice import check_applies, load_metric
from uwbbench.measure.latency.settings import LatencyModel
from uwbbench.run.combine import combined
from uwbbench.run.contenders import DetectorItem, read_detectors, with_absolute_paths
from uwbbench.run.folder.scored import rules_of
from uwbbench.run.limits import LimitsModel
from uwbbench.run.suite import WHOLE, Frozen, SuitePart, read_frozen


class ScoredDataset(DatasetUse):
    """Captures of one dataset, where they are scored, and whether they are timed."""

    region: RegionModel | None = Field(
        default=None, description="Score region of these captures alone; that of the experiment if left out."
    )
    optional: bool = Field(default=False, description="Skip it, with a note, where its files are not there.")
    latency: bool = Field(default=True, description="Time detectors on it, where the experiment times them at all.")
    gate_m: float | None = Field(
        default=None, gt=0, description="Largest error of a true detection here; the experiment's if left out."
    )
    scoring: list[Scoring] | None = Field(
        default=None, min_length=1, description="How these captures are scored, of the experiment's; all if left out."
    )
    detectors: list[str] | None = Field(
        default=None, min_length=1, description="Names of the detectors that run on it; all if left out."
    )


class QuickModel(ConfigModel):
    """What ``--quick`` makes of an experiment."""

    captures: int = Field(default=2, ge=1, description="Captures of each dataset at most, spread evenly.")
    latency: bool = Field(default=False, description="Whether detectors are timed.")
    stability: bool = Field(default=False, description="Whether the hard cases are put to them.")


class ExperimentModel(ConfigModel):
    """An experiment: detectors times captures, scored and timed."""

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    name: str | None = Field(default=None, min_length=1, description="Name of the run; the file's name if left out.")
    description: str = ""
    extends: str | None = Field(default=None, description="Experiment (name or file) that this one changes.")
    experiments: list[str] | None = Field(
        default=None,
        description="Experiments (names or files) to run as one, in place of 'detectors' and 'datasets': each dataset "
        "keeps the detectors, scorings, region and gate of its experiment.",
    )
    set: dict[str, Any] = Field(default_factory=dict, description="Values to change in the extended one, by path.")
    detectors: list[DetectorItem] = Field(
        min_length=1, description="Names, paths, changed detectors, or folders of results of any program."
    )
    datasets: list[ScoredDataset] = Field(min_length=1)
    scoring: list[Scoring] = Field(default=["frame", "object"], min_length=1)
    gate_m: GateRadius
    region: RegionModel = Field(default_factory=RegionModel)
    strongest: Strongest
    surface: Surface = Field(
        default="outline",
        description="What the error of a position is the distance to: 'outline', 0 inside it, or 'visible', the part "
        "of it that the receiver can see in that frame.",
    )
    metrics: MetricsUse = Field(
        default_factory=list,
        description="Registered metrics to show besides the default ones, of which the first ranks, if it has a better "
        "end; or exactly which metrics rank, are columns of tables, and are charted.",
    )
    latency: LatencyModel = Field(default_factory=LatencyModel)
    stability: bool = Field(default=True, description="Put the hard cases to each detector; see 'uwbbench stability'.")
    limits: LimitsModel = Field(default_factory=LimitsModel, description="What a unit may take.")
    seed: int = Field(default=0, ge=0, description="Of what reports draw: the probability of being on a front.")
    intervals: IntervalModel = Field(default_factory=IntervalModel)
    quick: QuickModel | None = Field(default=None, description="A smaller version of it, for 'run --quick'.")

    @field_validator("scoring", mode="before")
    @classmethod
    def _one_scoring(cls, value: Any) -> Any:
        return [value] if isinstance(value, str) else value

    @field_validator("scoring")
    @classmethod
    def _distinct(cls, value: list[Scoring]) -> list[Scoring]:
        return list(dict.fromkeys(value))

    @field_validator("latency", mode="before")
    @classmethod
    def _switch(cls, value: Any) -> Any:
        return {"enabled": value} if isinstance(value, bool) else value


@dataclass(frozen=True)
class Experiment:
    """A checked experiment.

    Attributes
    ----------
    name, description : str
    detectors : tuple of DetectorConfig
        With distinct names.
    datasets : tuple of DatasetSource
    scoring : tuple of str
    gate_m : float
    region : RegionModel
    strongest : int or None
    surface : {"outline", "visible"}
    metrics : tuple of str or mapping
        As the file has it: metrics besides the default ones, or exactly which of them are shown where.
    latency : LatencyModel
    stability : bool
    seed : int
    intervals : IntervalModel
    limits : LimitsModel
        Not part of what the results depend on: a run may be resumed with others.
    part : SuitePart
        Which part of a suite it is.
    frozen : Frozen or None
        What its captures are held against; None where it is no suite.
    left_out : tuple of str
        Datasets that cannot be drawn anew, where seeds are secret.
    """

    name: str
    description: str
    detectors: tuple[DetectorConfig, ...]
    datasets: tuple[DatasetSource, ...]
    scoring: tuple[Scoring, ...]
    gate_m: float
    region: RegionModel
    strongest: int | None
    surface: Surface
    metrics: tuple[str, ...] | Mapping[str, Any]
    latency: LatencyModel
    stability: bool
    seed: int
    intervals: IntervalModel
    limits: LimitsModel = field(default_factory=LimitsModel)
    part: SuitePart = WHOLE
    frozen: Frozen | None = field(default=None, repr=False)
    left_out: tuple[str, ...] = ()

    @property
    def runnable(self) -> tuple[DetectorConfig, ...]:
        """Detectors that can be timed and examined; of the others only results are known."""
        return tuple(config for config in self.detectors if config.results is None)

    def to_dict(self) -> dict[str, Any]:
        """Resolved experiment as plain values, without the folders of this machine."""
        datasets = [dataset.to_dict() for dataset in self.datasets]
        return {
            "schema": 1,
            "name": self.name,
            "description": self.description,
            "detectors": [config.to_dict() for config in self.detectors],
            "datasets": datasets,
            "scoring": list(self.scoring),
            "gate_m": self.gate_m,
            "region": self.region.model_dump(),
            "strongest": self.strongest,
            **({} if self.surface == "outline" else {"surface": self.surface}),  # as versions without it resume
            "metrics": dict(self.metrics) if isinstance(self.metrics, Mapping) else list(self.metrics),
            "latency": self.latency.model_dump(),
            "stability": self.stability,
            "seed": self.seed,
            "intervals": self.intervals.model_dump(),
            **({} if self.part == WHOLE else {"suite": self.part.to_dict()}),
        }


def read_experiment(
    name: Given,
    changes: Mapping[str, Any] | None = None,
    data_dir: Path | None = None,
    *,
    quick: bool = False,
    seeds: Path | None = None,
    frozen: bool = True,
) -> Experiment:
    """Read an experiment by name or path, with every detector and dataset in it checked.

    Parameters
    ----------
    name : str, Path or mapping
        Shipped name, a path to a YAML file, or the values of one.
    changes : mapping, optional
        Values to change, by path, before checking: ``{"gate_m": 0.1}``.
    data_dir : Path, optional
        First folder in which datasets are searched.
    quick : bool
        Its smaller version.
    seeds : Path, optional
        Seed file: captures are drawn from secret seeds, and datasets that cannot be are left out.
    frozen : bool
        Hold it against the lock file beside it, where there is one.

    Returns
    -------
    Experiment

    Raises
    ------
    ConfigError, PluginError
        If a file is missing or wrong; the message names file, line and key.
    """
    path, source = read_given("experiments", name)
    data = extended(source, "experiments", path, with_absolute_paths)
    data = combined(data, source, path, with_absolute_paths)
    if changes:
        data = with_values(data, changes, "--set")
    model = checked(ExperimentModel, data, source)
    if model.set:
        raise ConfigError(f"{source.place(('set',))}: 'set' changes an extended experiment, but 'extends' is missing")
    metrics = _metrics(model, source)
    if model.latency.enabled and model.latency.reference is not None:
        with placed(source, ("latency", "reference")):
            read_detector(model.latency.reference, path.parent)
    detectors = read_detectors(model.detectors, source, path.parent)
    _check_choices(model, detectors, source)
    experiment = Experiment(
        name=model.name or path.stem,
        description=model.description,
        detectors=detectors,
        datasets=_datasets(model, source, [str(root) for root in data_roots(data_dir, path)]),
        scoring=tuple(model.scoring),
        gate_m=model.gate_m,
        region=model.region,
        strongest=model.strongest,
        surface=model.surface,
        metrics=metrics,
        latency=model.latency,
        stability=model.stability,
        seed=model.seed,
        intervals=model.intervals,
        limits=model.limits,
    )
    experiment = _frozen(experiment, read_frozen(path) if frozen else None)
    if quick:
        experiment = _quick(experiment, model.quick, source)
    return experiment if seeds is None else _private(experiment, read_seeds(seeds), source)


def _frozen(experiment: Experiment, frozen: Frozen | None) -> Experiment:
    """The experiment as a suite, where a lock file lies beside it and has its name."""
    if frozen is None or frozen.name != experiment.name:
        return experiment
    labels = [dataset.label for dataset in experiment.datasets if not dataset.optional]
    frozen.check_rules(labels, [rule.to_dict() for rule in rules_of(experiment.to_dict())])
    return replace(experiment, frozen=frozen, part=SuitePart(version=frozen.version))


def _quick(experiment: Experiment, quick: QuickModel | None, source: YamlFile) -> Experiment:
    """The smaller version of an experiment."""
    if quick is None:
        raise ConfigError(f"{source.name}: has no 'quick', so there is no smaller version of it")
    return replace(
        experiment,
        datasets=tuple(replace(dataset, at_most=quick.captures) for dataset in experiment.datasets),
        latency=experiment.latency.model_copy(update={"enabled": experiment.latency.enabled and quick.latency}),
        stability=experiment.stability and quick.stability,
        part=replace(experiment.part, quick=True),
    )


def _private(experiment: Experiment, seeds: Seeds, source: YamlFile) -> Experiment:
    """The private half of an experiment: the datasets that have a seed, drawn from secret ones."""
    drawn, left_out = [], []
    for dataset in experiment.datasets:
        if "seed" in registry.load_plugin("datasets", dataset.use).params_type().model_fields:
            drawn.append(replace(dataset, secret={"seed": seeds.of(dataset.label)}))
        else:
            left_out.append(dataset.label)
    if not drawn:
        raise ConfigError(f"{source.name}: none of its datasets has a seed, so it has no private half")
    part = replace(experiment.part, seeds=seeds.sha256)
    return replace(experiment, datasets=tuple(drawn), left_out=tuple(left_out), part=part, frozen=None)


def _datasets(model: ExperimentModel, source: YamlFile, roots: list[str]) -> tuple[DatasetSource, ...]:
    sources = dataset_sources(model.datasets, source, roots)
    uses = zip(sources, model.datasets, strict=True)
    return tuple(
        replace(
            one,
            region=use.region,
            optional=use.optional,
            timed=use.latency,
            gate_m=use.gate_m,
            scoring=tuple(use.scoring or ()),
            detectors=tuple(use.detectors or ()),
        )
        for one, use in uses
    )


def _check_choices(model: ExperimentModel, detectors: Iterable[DetectorConfig], source: YamlFile) -> None:
    """Check that datasets choose among the detectors and scorings of the experiment."""
    known: dict[str, list[str]] = {"detectors": [one.name for one in detectors], "scoring": list(model.scoring)}
    for index, dataset in enumerate(model.datasets):
        for key, names in known.items():
            for at, name in enumerate(getattr(dataset, key) or ()):
                if name not in names:
                    place = source.place(("datasets", index, key, at))
                    hint = nearest(name, names)
                    raise ConfigError(f"{place}: '{name}' is not among the experiment's {key}.{hint}")


def _metrics(model: ExperimentModel, source: YamlFile) -> tuple[str, ...] | dict[str, Any]:
    """Metrics as the experiment has them, each looked up."""
    if isinstance(model.metrics, list):
        places: list[tuple[str, tuple[str | int, ...]]] = [(name, (at,)) for at, name in enumerate(model.metrics)]
    else:
        chosen = model.metrics
        places = [(chosen.rank, ("rank",))] if chosen.rank is not None else []
        places += [(name, ("table", at)) for at, name in enumerate(chosen.table or ())]
        places += [(name, ("charts", at)) for at, name in enumerate(chosen.charts or ())]
    for name, at in places:
        with placed(source, ("metrics", *at)):
            metric = load_metric(name)
            check_applies(name, metric, model.scoring)
            if at == ("rank",) and metric.better == "zero":
                raise ConfigError(f"metric '{name}' has no better end, so it cannot rank")
    if isinstance(model.metrics, list):
        return tuple(dict.fromkeys(model.metrics))
    return model.metrics.model_dump(exclude_none=True)
