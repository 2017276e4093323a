"""The experiment file: which detectors run on which captures, and how they are scored and timed."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from uwbbench.api import registry
from uwbbench.api.check import checked
from uwbbench.api.errors import CaptureError, ConfigError, PluginError, UwbbenchError, nearest
from uwbbench.api.locate import find_config
from uwbbench.api.override import merged, with_values
from uwbbench.api.yaml_file import Path_, YamlFile, read_yaml
from uwbbench.config.detector import DetectorConfig, read_detector
from uwbbench.config.given import Given, read_given
from uwbbench.config.source import CaptureRef, data_roots, open_dataset
from uwbbench.measure.latency.settings import LatencyModel

Scoring = Literal["frame", "peak", "object"]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", populate_by_name=True, allow_inf_nan=False, frozen=True)


class DetectorUse(_Model):
    """A detector with another name or other values."""

    use: str = Field(description="Name, or path to a detector YAML.")
    name: str | None = Field(default=None, min_length=1, description="Name in tables and reports.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values to change in the detector, by path.")

    @field_validator("use", mode="before")
    @classmethod
    def _null(cls, value: Any) -> Any:
        return "null" if value is None else value


class DatasetUse(_Model):
    """Captures of one dataset."""

    use: str = Field(description="Registered name of the dataset.")
    name: str | None = Field(default=None, min_length=1, description="Name in tables and reports.")
    params: dict[str, Any] = Field(default_factory=dict, description="Parameters of the dataset.")
    captures: list[str] | None = Field(
        default=None, min_length=1, description="Names, or patterns such as 'ch9-*'; all if left out."
    )


class RegionModel(_Model):
    """Where detectors are asked to find obstacles, seen from the receiver."""

    min_range_m: float = Field(default=0.6, ge=0, description="Radius of the blind zone.")
    max_range_m: float | None = Field(default=None, gt=0, description="Farthest range; null: as far as the taps reach.")
    half_angle_deg: float | None = Field(
        default=None, gt=0, le=180, description="Widest azimuth to either side; null: 45 with two antennas, else 90."
    )

    @property
    def half_angle_rad(self) -> float | None:
        """The same in radians."""
        return None if self.half_angle_deg is None else math.radians(self.half_angle_deg)


class IntervalModel(_Model):
    """How uncertainty is estimated."""

    resamples: int = Field(default=1000, ge=100, description="Bootstrap resamples.")
    confidence: float = Field(default=0.95, gt=0, lt=1)


class ExperimentModel(_Model):
    """An experiment: detectors times captures, scored and timed."""

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    name: str | None = Field(default=None, min_length=1, description="Name of the run; the file's name if left out.")
    description: str = ""
    extends: str | None = Field(default=None, description="Experiment (name or file) that this one changes.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values to change in the extended one, by path.")
    detectors: list[str | DetectorUse | None] = Field(min_length=1, description="Names, paths, or changed detectors.")
    datasets: list[DatasetUse] = Field(min_length=1)
    scoring: list[Scoring] = Field(default=["frame", "object"], min_length=1)
    gate_m: float = Field(default=0.20, gt=0, description="Largest error of a true detection.")
    region: RegionModel = Field(default_factory=RegionModel)
    strongest: int | None = Field(
        default=None, ge=1, description="Score only that many detections of a frame, the strongest."
    )
    metrics: list[str] = Field(default_factory=list, description="Registered metrics besides the standard ones.")
    latency: LatencyModel = Field(default_factory=LatencyModel)
    stability: bool = Field(default=True, description="Put the hard cases to each detector; see 'uwbbench stability'.")
    seed: int = Field(default=0, ge=0, description="Of the resampling behind the intervals.")
    intervals: IntervalModel = Field(default_factory=IntervalModel)

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
class DatasetSource:
    """One dataset of an experiment.

    Attributes
    ----------
    label : str
        Its name in tables: the given one, or the adapter's, with a number where several entries use the same.
    use : str
    params : dict
        Parameters as written.
    captures : tuple of str or None
        Patterns of the names to take; None for all.
    roots : tuple of str
        Folders to search.
    """

    label: str
    use: str
    params: dict[str, Any] = field(default_factory=dict)
    captures: tuple[str, ...] | None = None
    roots: tuple[str, ...] = ()

    def references(self) -> list[CaptureRef]:
        """References to the chosen captures.

        Raises
        ------
        CaptureError
            If the dataset has no captures, or a pattern fits none of them.
        """
        names = open_dataset(self.use, self.params, [Path(root) for root in self.roots]).names()
        if not names:
            raise CaptureError(f"dataset '{self.label}' holds no captures")
        for pattern in self.captures or ():
            if not any(_fits(name, (pattern,)) for name in names):
                raise CaptureError(f"dataset '{self.label}' has no capture '{pattern}'.{nearest(pattern, names)}")
        chosen = [name for name in names if self.captures is None or _fits(name, self.captures)]
        return [CaptureRef(self.use, self.params, self.roots, name) for name in chosen]


def _fits(name: str, patterns: tuple[str, ...]) -> bool:
    return any(name == pattern or fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


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
    metrics : tuple of str
    latency : LatencyModel
    stability : bool
    seed : int
    intervals : IntervalModel
    """

    name: str
    description: str
    detectors: tuple[DetectorConfig, ...]
    datasets: tuple[DatasetSource, ...]
    scoring: tuple[Scoring, ...]
    gate_m: float
    region: RegionModel
    strongest: int | None
    metrics: tuple[str, ...]
    latency: LatencyModel
    stability: bool
    seed: int
    intervals: IntervalModel

    def to_dict(self) -> dict[str, Any]:
        """Resolved experiment as plain values, without the folders of this machine."""
        datasets = [{"label": d.label, "use": d.use, "params": d.params, "captures": d.captures} for d in self.datasets]
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
            "metrics": list(self.metrics),
            "latency": self.latency.model_dump(),
            "stability": self.stability,
            "seed": self.seed,
            "intervals": self.intervals.model_dump(),
        }


def read_experiment(name: Given, changes: Mapping[str, Any] | None = None, data_dir: Path | None = None) -> Experiment:
    """Read an experiment by name or path, with every detector and dataset in it checked.

    Parameters
    ----------
    name : str, Path or mapping
        Shipped name, a path to a YAML file, or the values of one.
    changes : mapping, optional
        Values to change, by path, before checking: ``{"gate_m": 0.1}``.
    data_dir : Path, optional
        First folder in which datasets are searched.

    Returns
    -------
    Experiment

    Raises
    ------
    ConfigError, PluginError
        If a file is missing or wrong; the message names file, line and key.
    """
    path, source = read_given("experiments", name)
    data = _extended(source, path, (path.resolve(),))
    if changes:
        data = with_values(data, changes, "--set")
    model = checked(ExperimentModel, data, source)
    if model.set:
        raise ConfigError(f"{source.place(('set',))}: 'set' changes an extended experiment, but 'extends' is missing")
    for index, metric in enumerate(model.metrics):
        with standing(source, ("metrics", index)):
            registry.load_plugin("metrics", metric)
    if model.latency.enabled and model.latency.reference is not None:
        with standing(source, ("latency", "reference")):
            read_detector(model.latency.reference, path.parent)
    if model.region.max_range_m is not None and model.region.max_range_m <= model.region.min_range_m:
        raise ConfigError(
            f"{source.place(('region', 'max_range_m'))}: must exceed min_range_m {model.region.min_range_m}"
        )
    return Experiment(
        name=model.name or path.stem,
        description=model.description,
        detectors=_detectors(model, source, path.parent),
        datasets=dataset_sources(model.datasets, source, [str(root) for root in data_roots(data_dir, path)]),
        scoring=tuple(model.scoring),
        gate_m=model.gate_m,
        region=model.region,
        strongest=model.strongest,
        metrics=tuple(dict.fromkeys(model.metrics)),
        latency=model.latency,
        stability=model.stability,
        seed=model.seed,
        intervals=model.intervals,
    )


@contextmanager
def standing(source: YamlFile, at: Path_) -> Iterator[None]:
    """Report what is found wrong inside as standing at ``at``."""
    try:
        yield
    except UwbbenchError as error:
        text = str(error).removeprefix("--set: ")
        kind = PluginError if isinstance(error, PluginError) else ConfigError
        raise (error if text.startswith(source.name) else kind(f"{source.place(at)}: {text}")) from None


def _extended(source: YamlFile, path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    """Values of a file on top of those of the experiment that it extends."""
    data = dict(source.data)
    parent = data.pop("extends", None)
    if parent is None:
        return data
    if not isinstance(parent, str):
        raise ConfigError(f"{source.place(('extends',))}: expected the name or path of an experiment, found {parent!r}")
    with standing(source, ("extends",)):
        file = find_config("experiments", parent, path.parent)
    if file.resolve() in seen:
        raise ConfigError(f"{source.place(('extends',))}: experiments extend each other in a circle")
    changes = data.pop("set", None) or {}
    if not isinstance(changes, dict):
        raise ConfigError(f"{source.place(('set',))}: expected values by path")
    base = _extended(read_yaml(file), file, (*seen, file.resolve()))
    if isinstance(base.get("detectors"), list):
        base["detectors"] = [_anchored(item, file.parent) for item in base["detectors"]]
    return merged(with_values(base, changes, source.place(("set",))), data)


def _anchored(item: Any, folder: Path) -> Any:
    """Detector of an extended experiment: its path starts from that experiment's folder."""
    if isinstance(item, dict):
        return {**item, "use": _anchored(item.get("use"), folder)}
    is_path = isinstance(item, str) and (item.endswith((".yaml", ".yml")) or "/" in item)
    return str((folder / item).resolve()) if is_path and (folder / item).is_file() else item


def _detectors(model: ExperimentModel, source: YamlFile, folder: Path) -> tuple[DetectorConfig, ...]:
    from uwbbench.detect.pipeline import Pipeline

    found: dict[str, DetectorConfig] = {}
    for index, item in enumerate(model.detectors):
        use = item if isinstance(item, DetectorUse) else DetectorUse(use="null" if item is None else item)
        at = ("detectors", index)
        with standing(source, at):
            config = read_detector(use.use, folder, use.set)
            config = replace(config, name=use.name or config.name)
            Pipeline(config)  # checks that its steps fit together
        if config.name in found:
            raise ConfigError(
                f"{source.place(at)}: detector '{config.name}' appears twice; give one of them another 'name'"
            )
        found[config.name] = config
    return tuple(found.values())


def dataset_sources(
    uses: Sequence[DatasetUse], source: YamlFile, roots: list[str], key: str = "datasets"
) -> tuple[DatasetSource, ...]:
    """Checked datasets of a file, with distinct labels.

    Parameters
    ----------
    uses : sequence of DatasetUse
        As they stand under ``key``.
    source : YamlFile
        The file, for messages.
    roots : list of str
        Folders to search.
    key : str
        Key of the file.

    Raises
    ------
    ConfigError, PluginError
        If an adapter is unknown, a parameter wrong, or a label given twice.
    """
    found: list[DatasetSource] = []
    for index, item in enumerate(uses):
        at = (key, index)
        with standing(source, (*at, "use")):
            registry.load_plugin("datasets", item.use)
        open_dataset(item.use, item.params, [Path(root) for root in roots], source, (*at, "params"))
        same = sum(other.use == item.use for other in found)
        label = item.name or (f"{item.use} {same + 1}" if same else item.use)
        if label in {other.label for other in found}:
            raise ConfigError(f"{source.place(at)}: dataset '{label}' appears twice; give one of them another 'name'")
        patterns = None if item.captures is None else tuple(item.captures)
        found.append(DatasetSource(label, item.use, item.params, patterns, tuple(roots)))
    return tuple(found)
