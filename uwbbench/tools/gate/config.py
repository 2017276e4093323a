"""The gate file: what is let in, compared with what, on which captures, within which limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError, nearest
from uwbbench.api.locate import find_config, is_path
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.datasets import DatasetSource, DatasetUse, dataset_sources
from uwbbench.config.detector import read_detector
from uwbbench.config.extends import placed
from uwbbench.config.given import Given, read_model
from uwbbench.config.model import ConfigModel, DetectorName, NamedNull
from uwbbench.config.rules import GateRadius, IntervalModel, RegionModel, Scoring, Strongest, Table
from uwbbench.config.source import data_roots
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.metrics.choice import check_applies, load_metric

Captures = Literal["first", "all"]


class SideModel(ConfigModel):
    """A detector, changed or in another Python environment."""

    detector: DetectorName = Field(description="Name, or path to a detector YAML.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values to change in the detector, by path.")
    python: str | None = Field(
        default=None, min_length=1, description="Interpreter of the environment it lives in, such as base/bin/python."
    )


class LatencyGateModel(ConfigModel):
    """How much slower than the base the head may be, from raw samples to rows."""

    maximum_ratio: float = Field(default=1.05, gt=1, description="Largest time of the head, relative to the base.")
    captures: Captures = Field(default="first", description="Captures of each dataset that are timed.")
    frames: int = Field(default=2000, ge=1, description="Frames used at most, from the start of a capture.")
    blocks: int = Field(default=61, ge=31, description="ABBA blocks at least, for each pair of processes.")
    processes: int = Field(default=5, ge=3, description="Fresh pairs of processes at least, for two environments.")
    patience: int = Field(default=4, ge=1, description="As many times as much is measured where nothing is decided.")
    warmup_windows: int = Field(default=10, ge=2, description="Windows of warm-up at most, if they never agree.")


class DeadlineModel(ConfigModel):
    """How many frames may be answered later than the next one comes, from raw samples to rows."""

    maximum_missed_share: float = Field(default=0.01, ge=0, lt=1, description="Largest share of missed deadlines.")
    maximum_burst: int | None = Field(default=None, ge=0, description="Most missed in a row; null: any.")
    captures: Captures = Field(default="first", description="Captures of each dataset that are timed.")
    rate_hz: float | None = Field(default=None, gt=0, description="Rate of the radar; null: the capture's own.")
    paced: bool = Field(default=True, description="Hand out frames at that rate, as on a robot, or one by one.")
    frames: int = Field(default=500, ge=1, description="Frames at least; a shorter capture is repeated.")
    patience: int = Field(default=4, ge=1, description="As many times as much is measured where nothing is decided.")
    warmup_windows: int = Field(default=10, ge=2, description="Windows of warm-up at most, if they never agree.")


class AccuracyModel(ConfigModel):
    """A limit of one metric, for each dataset."""

    metric: str = Field(description="Registered metric, such as f1, recall, mae or p95.")
    scoring: Scoring = Field(description="How detections are counted.")
    table: Table = Field(default="filtering", description="After which half of the chain.")
    dataset: str | None = Field(default=None, description="Only this dataset, by its name; null: each.")
    minimum: float | None = Field(default=None, description="Least value, in the metric's unit (metres for errors).")
    maximum: float | None = Field(default=None, description="Largest value, in the metric's unit.")
    no_worse_than: str | None = Field(default=None, description="Run folder that holds the values to keep up with.")
    detector: str | None = Field(default=None, description="Detector of that run; null: the head's name, or the only.")
    tolerance: float = Field(default=0.0, ge=0, description="Loss against the run that is allowed, besides chance.")

    @model_validator(mode="after")
    def _one_limit(self) -> AccuracyModel:
        given = [name for name in ("minimum", "maximum", "no_worse_than") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(
                f"expected one of minimum, maximum and no_worse_than, found {' and '.join(given) or 'none'}"
            )
        if self.no_worse_than is None and (self.detector is not None or self.tolerance):
            raise ValueError("detector and tolerance belong to no_worse_than, which is missing")
        return self


class GateModel(ConfigModel):
    """A gate: a detector, captures, and limits."""

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    name: str | None = Field(default=None, min_length=1, description="Name of the gate; the file's name if left out.")
    description: str = ""
    head: Annotated[str | SideModel | None, NamedNull] = Field(
        description="Detector under test: name, path, or with an environment."
    )
    base: str | SideModel | None = Field(default=None, description="What its speed is compared with.")
    datasets: list[DatasetUse] = Field(default_factory=list, description="Captures, as in an experiment.")
    captures: list[str] = Field(
        default_factory=list, description="Capture files, by path or pattern, seen from this file; one dataset more."
    )
    latency: LatencyGateModel | None = Field(default=None, description="Speed against the base; null: not checked.")
    deadline: DeadlineModel | None = Field(default=None, description="Missed deadlines; null: not checked.")
    accuracy: list[AccuracyModel] = Field(default_factory=list)
    gate_m: GateRadius
    region: RegionModel = Field(default_factory=RegionModel)
    strongest: Strongest
    seed: int = Field(default=0, ge=0, description="Of the resampling behind the intervals of accuracy.")
    intervals: IntervalModel = Field(default_factory=IntervalModel)
    timeout_s: float = Field(default=600.0, gt=0, description="A single answer that takes longer has failed.")


@dataclass(frozen=True)
class Side:
    """One of the two that are compared.

    Attributes
    ----------
    label : {"base", "head"}
    detector : str
        Name, or absolute path of a detector YAML.
    set : dict
        Values to change in it.
    python : Path or None
        Interpreter of its environment; None for this one.
    """

    label: str
    detector: str
    set: dict[str, Any]
    python: Path | None

    @property
    def text(self) -> str:
        """The side for people."""
        changed = f" with {', '.join(f'{key}={value}' for key, value in self.set.items())}" if self.set else ""
        where = f" in {self.python}" if self.python else ""
        return f"{self.detector}{changed}{where}"


@dataclass(frozen=True)
class Gate:
    """A checked gate file.

    Attributes
    ----------
    name : str
    model : GateModel
        Values of the file.
    head : Side
    base : Side or None
    datasets : tuple of DatasetSource
    folder : Path
        Folder of the file, from which paths start.
    """

    name: str
    model: GateModel
    head: Side
    base: Side | None
    datasets: tuple[DatasetSource, ...]
    folder: Path


def read_gate(name: Given, changes: Mapping[str, Any] | None = None, data_dir: Path | None = None) -> Gate:
    """Read a gate file.

    Detectors of this environment are checked; those of others can only be checked there, when the gate runs.

    Parameters
    ----------
    name : str, Path or mapping
        Shipped name, a path to a YAML file, or the values of one.
    changes : mapping, optional
        Values to change, by path, before checking: ``{"latency.maximum_ratio": 1.1}``.
    data_dir : Path, optional
        First folder in which datasets are searched.

    Returns
    -------
    Gate

    Raises
    ------
    ConfigError, PluginError
        If a file is missing or wrong; the message names file, line and key.
    """
    path, source, model = read_model(GateModel, "gates", name, changes)
    base = None if model.base is None else _side("base", model.base, source, path.parent)
    if model.latency is None and model.deadline is None and not model.accuracy:
        raise ConfigError(f"{source.name}: nothing to check: expected latency, deadline or accuracy")
    if model.latency is not None and base is None:
        raise ConfigError(f"{source.place(('latency',))}: needs a 'base' that the head is compared with")
    uses = list(model.datasets)
    if model.captures:
        uses.append(
            DatasetUse(use=registry.default("dataset.files"), name="captures", params={"files": model.captures})
        )
    if not uses:
        raise ConfigError(f"{source.name}: no captures: expected 'datasets' or 'captures'")
    datasets = dataset_sources(uses, source, [str(root) for root in data_roots(data_dir, path)])
    for index, rule in enumerate(model.accuracy):
        _check_rule(rule, {one.label for one in datasets}, source, index)
    head = _side("head", model.head, source, path.parent)
    return Gate(model.name or path.stem, model, head, base, datasets, path.parent)


def _side(label: str, given: str | SideModel | None, source: YamlFile, folder: Path) -> Side:
    use = given if isinstance(given, SideModel) else SideModel(detector=given)  # type: ignore[arg-type]  # null is one
    with placed(source, (label,)):
        detector = (
            str(find_config("detectors", use.detector, folder).absolute()) if is_path(use.detector) else use.detector
        )
        if use.python is None:
            Pipeline(read_detector(detector, None, use.set))
    # Not resolved: the interpreter of a virtual environment is a link, and finds its packages by where that lies.
    python = None if use.python is None else (folder / Path(use.python).expanduser()).absolute()
    return Side(label, detector, use.set, python)


def _check_rule(rule: AccuracyModel, labels: set[str], source: YamlFile, index: int) -> None:
    """Refuse a limit that can mean nothing."""
    at = ("accuracy", index)
    with placed(source, (*at, "metric")):
        metric = load_metric(rule.metric)
        check_applies(rule.metric, metric, [rule.scoring])
    wrong = {"higher": "maximum", "lower": "minimum"}.get(metric.better, "")
    if wrong and getattr(rule, wrong) is not None:
        raise ConfigError(
            f"{source.place((*at, wrong))}: of '{rule.metric}' {metric.better} is better: limit the other end"
        )
    if metric.better == "zero" and rule.no_worse_than is not None:
        raise ConfigError(f"{source.place((*at, 'no_worse_than'))}: of '{rule.metric}' neither end is better")
    if rule.dataset is not None and rule.dataset not in labels:
        place = source.place((*at, "dataset"))
        raise ConfigError(f"{place}: no dataset '{rule.dataset}' in this gate.{nearest(rule.dataset, labels)}")
