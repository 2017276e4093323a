"""The fit file: which parameters of scenes and their robot are free, and which figures they are fitted to."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from uwbbench.api.errors import ConfigError, UwbbenchError, nearest
from uwbbench.api.locate import find_config
from uwbbench.api.override import value_at
from uwbbench.api.yaml_file import YamlFile, read_yaml
from uwbbench.config.detector import DetectorConfig, read_detector
from uwbbench.config.extends import placed
from uwbbench.config.given import Given, read_model
from uwbbench.config.model import ConfigModel
from uwbbench.config.rules import GateRadius, RegionModel, Scoring, Surface
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.metrics.choice import check_applies, load_metric
from uwbbench.measure.accuracy.scoring import Region, ScoringRules
from uwbbench.results.chains import IN_CLUSTERS
from uwbbench.run.contenders import DetectorUse
from uwbbench.tools.fit.files import ROBOT, Changes, changed, open_cell
from uwbbench.tools.tune.config import Choices, Interval
from uwbbench.tools.tune.search import within

CHAIN = "chain"
"""Key of targets that count detections behind the steps of a detector, and of their tolerance."""

SMALLEST_SPAN = 1e-3


class CellModel(ConfigModel):
    """One scene as one figure of a source was measured on it."""

    scene: str = Field(description="Scene: a shipped name, or a YAML file.")
    set: dict[str, Any] = Field(
        default_factory=dict, description="Values to change in the scene, by path, such as radar.channel."
    )
    receiver: str | None = Field(default=None, description="Receiver that is scored, where the scene has several.")
    detector: str | DetectorUse | None = Field(default=None, description="Another detector than that of the file.")
    region: RegionModel | None = Field(default=None, description="Another score region than that of the file.")


class _Where(ConfigModel):
    """Where a free parameter stands."""

    inside: str | list[str] = Field(alias="in", description="Scenes as cells name them, or 'robot'.")
    path: str = Field(description="Path of the value in each of these files.")
    cells: list[str] = Field(
        default=["*"],
        min_length=1,
        description="Cells that it bears on, or patterns of them: the others are not simulated again for it.",
    )

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files."""
        return (self.inside,) if isinstance(self.inside, str) else tuple(self.inside)


class FreeInterval(_Where, Interval):
    """A number that is searched."""


class FreeChoice(_Where, Choices):
    """A value that is searched among a few."""


class ToleranceModel(ConfigModel):
    """How near to a target is near enough."""

    absolute: float | None = Field(default=None, gt=0, description="Largest difference, in the metric's own unit.")
    relative: float | None = Field(default=None, gt=0, description="Largest difference as a share of the target.")
    factor: float | None = Field(default=None, gt=1, description="Largest ratio, either way; for counts.")
    weight: float = Field(default=1.0, ge=0, description="Weight in the search.")
    judged: bool = Field(default=True, description="Whether the fit answers for it, or shows it beside the others.")

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if sum(kind is not None for kind in (self.absolute, self.relative, self.factor)) != 1:
            raise ValueError("expected one of absolute, relative and factor")
        return self


class DrawsModel(ConfigModel):
    """Random draws of each cell."""

    seeds: list[Annotated[int, Field(ge=0)]] = Field(min_length=1, description="Seeds of the scenes.")
    runs: int = Field(default=1, ge=1, le=1000, description="Runs of each seed.")

    @field_validator("seeds")
    @classmethod
    def _distinct(cls, value: list[int]) -> list[int]:
        if len(set(value)) < len(value):
            raise ValueError("a seed is given twice")
        return value


class StageModel(ConfigModel):
    """One stage of the search, which begins at the best values of the one before."""

    free: list[str] = Field(default=["*"], min_length=1, description="Parameters to search, or patterns of names.")
    trials: int = Field(default=100, ge=1, le=1_000_000)
    span: float = Field(
        default=1.0, ge=SMALLEST_SPAN, le=1, description="Part of each range that is searched, about the best so far."
    )


class FitSearchModel(ConfigModel):
    """The search; needs Optuna."""

    stages: list[StageModel] = Field(default=[StageModel()], min_length=1, description="One after the other.")
    sampler: Literal["tpe", "random"] = Field(default="tpe", description="How Optuna proposes values.")
    seeds: list[Annotated[int, Field(ge=0)]] = Field(
        default=[0], min_length=1, description="Of the sampler: each makes a search of its own, and the best counts."
    )
    timeout_s: float = Field(
        default=3600.0, gt=0, description="Time after which no trial begins, all searches together."
    )


class FitModel(ConfigModel):
    """A fit: scenes, what is free in them, and the figures that a detector is to give on them."""

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    name: str | None = Field(default=None, min_length=1, description="Name of the fit; the file's if left out.")
    description: str = ""
    source: str = Field(min_length=1, description="Whose figures the targets are; said in every calibrated file.")
    detector: str | DetectorUse = Field(description="Detector that gave the figures: a name, a file, or one changed.")
    scoring: Scoring = "frame"
    gate_m: GateRadius
    region: RegionModel = Field(default_factory=RegionModel)
    surface: Surface = "outline"
    robot: str | None = Field(default=None, description="Robot of all scenes: a shipped name, or a YAML file.")
    cells: dict[str, CellModel] = Field(min_length=1)
    parameters: dict[str, FreeInterval | FreeChoice] = Field(
        min_length=1, description="What is free, by a name for it."
    )
    targets: dict[str, dict[Literal["filtering", "mapping", "chain"], dict[str, float]]] = Field(
        min_length=1,
        description="Figures by cell, table and metric, in metres and shares of one; 'chain': counts by step.",
    )
    tolerances: dict[str, ToleranceModel] = Field(min_length=1, description="By metric, and 'chain' for counts.")
    fitting: DrawsModel = Field(description="Draws that the search sees.")
    checking: DrawsModel = Field(description="Draws that it does not see, on which residuals are taken.")
    search: FitSearchModel = Field(default_factory=FitSearchModel)

    @model_validator(mode="after")
    def _unseen(self) -> Self:
        if both := sorted({*self.fitting.seeds} & {*self.checking.seeds}):
            raise ValueError(
                f"seed {both[0]} is both for fitting and for checking: residuals on it would prove nothing"
            )
        return self


@dataclass(frozen=True)
class Cell:
    """A checked cell.

    Attributes
    ----------
    name, scene : str
        The scene as the file names it.
    set : dict
        What makes the cell of the scene.
    receiver : str or None
    detector : DetectorConfig
    rules : ScoringRules
    """

    name: str
    scene: str
    set: dict[str, Any]
    receiver: str | None
    detector: DetectorConfig
    rules: ScoringRules


@dataclass(frozen=True)
class Target:
    """One figure that a cell is to give.

    Attributes
    ----------
    cell : str
    table : {"filtering", "mapping", "chain"}
    metric : str
        Registered name of a metric; in a chain, a step of the detector.
    value : float
    tolerance : ToleranceModel
    """

    cell: str
    table: Literal["filtering", "mapping", "chain"]
    metric: str
    value: float
    tolerance: ToleranceModel

    @property
    def name(self) -> str:
        """What it is, in words."""
        return f"{self.cell}, {self.table}, {self.metric}"

    @property
    def judged(self) -> bool:
        """Whether the fit answers for it."""
        return self.tolerance.judged


@dataclass(frozen=True)
class Fit:
    """A checked fit file.

    Attributes
    ----------
    name : str
    model : FitModel
    cells : dict of str to Cell
    targets : tuple of Target
    files : dict of str to Path
        Scenes as cells name them, and the robot under :data:`~uwbbench.tools.fit.files.ROBOT`.
    start : dict
        Value of each parameter that the search begins with: the file's own where its range holds that.
    """

    name: str
    model: FitModel
    cells: dict[str, Cell]
    targets: tuple[Target, ...]
    files: dict[str, Path]
    start: dict[str, Any]

    def changes(self, values: Mapping[str, Any], cell: Cell | None = None) -> Changes:
        """What values of parameters change in each file, by path.

        Parameters
        ----------
        values : mapping
            By name of parameter.
        cell : Cell, optional
            Only what bears on it.
        """
        made: Changes = {name: {} for name in self.files if cell is None or name in (cell.scene, ROBOT)}
        for name, value in values.items():
            free = self.model.parameters[name]
            if cell is None or matches(cell.name, free.cells):
                for file in set(free.files) & set(made):
                    made[file][free.path] = value
        return made


def matches(name: str, patterns: list[str]) -> bool:
    """Whether a name is one of some names or patterns."""
    return any(name == pattern or fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def read_fit(name: Given, changes: Mapping[str, Any] | None = None) -> Fit:
    """Read a fit file.

    Parameters
    ----------
    name : str, Path or mapping
        Shipped name, a path to a YAML file, or the values of one.
    changes : mapping, optional
        Values to change, by path, before checking: ``{"search.timeout_s": 60}``.

    Returns
    -------
    Fit

    Raises
    ------
    ConfigError, PluginError
        If a file is missing or wrong; the message names file, line and key.
    """
    path, source, model = read_model(FitModel, "fits", name, changes)
    cells = {name: _cell(name, model, source, path.parent) for name in model.cells}
    files = {}
    for label, cell in model.cells.items():
        with placed(source, ("cells", label, "scene")):
            files[cell.scene] = find_config("scenes", cell.scene, path.parent).resolve()
    if model.robot is not None:
        with placed(source, ("robot",)):
            files[ROBOT] = find_config("robots", model.robot, path.parent).resolve()
    targets = tuple(_targets(model, cells, source))
    contents = {label: read_yaml(file).data for label, file in files.items()}
    start = {label: _start(label, model, contents, source) for label in model.parameters}
    _check_stages(model, source)
    made = Fit(model.name or path.stem, model, cells, targets, files, start)
    _check_paths(made, source)
    return made


def _cell(name: str, model: FitModel, source: YamlFile, folder: Path) -> Cell:
    given = model.cells[name]
    used = given.detector or model.detector
    use = used if isinstance(used, DetectorUse) else DetectorUse(use=used)
    with placed(source, ("cells", name, "detector") if given.detector else ("detector",)):
        config = read_detector(use.use, folder, use.set)
        Pipeline(config)  # checks that its steps fit together
    region = Region(**(given.region or model.region).limits)
    rules = ScoringRules(model.scoring, model.gate_m, region, surface=model.surface)
    return Cell(name, given.scene, given.set, given.receiver, config, rules)


def _targets(model: FitModel, cells: Mapping[str, Cell], source: YamlFile) -> list[Target]:
    made = []
    for cell, tables in model.targets.items():
        if cell not in cells:
            raise ConfigError(f"{source.place(('targets', cell))}: no cell '{cell}'.{nearest(cell, cells)}")
        for table, figures in tables.items():
            for metric, value in figures.items():
                at = ("targets", cell, table, metric)
                key = CHAIN if table == CHAIN else metric
                if table == CHAIN:
                    steps = [*(step.label for step in cells[cell].detector.steps), IN_CLUSTERS]
                    if metric not in steps:
                        raise ConfigError(f"{source.place(at)}: no step '{metric}'.{nearest(metric, steps)}")
                else:
                    with placed(source, at):
                        check_applies(metric, load_metric(metric), [model.scoring])
                if key not in model.tolerances:
                    raise ConfigError(f"{source.place(at)}: 'tolerances' says nothing of '{key}'")
                tolerance = model.tolerances[key]
                if value <= 0 and tolerance.absolute is None:
                    raise ConfigError(f"{source.place(at)}: a target of {value:g} needs an absolute tolerance")
                made.append(Target(cell, table, metric, value, tolerance))
    if not any(target.tolerance.weight for target in made):
        raise ConfigError(f"{source.place(('tolerances',))}: all weights are 0, so that nothing is fitted")
    return made


def _start(name: str, model: FitModel, files: Mapping[str, Mapping[str, Any]], source: YamlFile) -> Any:
    """Value that the search begins with."""
    free, at = model.parameters[name], ("parameters", name, "in")
    for file in free.files:
        if file not in files:
            hint = " (the file names no 'robot')" if file == ROBOT else nearest(file, files)
            raise ConfigError(f"{source.place(at)}: no cell uses '{file}'.{hint}")
    for pattern in free.cells:
        if not any(matches(cell, [pattern]) for cell in model.cells):
            place = source.place(("parameters", name, "cells"))
            raise ConfigError(f"{place}: no cell '{pattern}'.{nearest(pattern, model.cells)}")
    with placed(source, ("parameters", name, "path")):
        own = value_at(files[free.files[0]], free.path, "--set")
    if within(free, own):
        return own
    return free.choices[0] if isinstance(free, Choices) else free.middle


def _check_stages(model: FitModel, source: YamlFile) -> None:
    for index, stage in enumerate(model.search.stages):
        for pattern in stage.free:
            if not any(matches(name, [pattern]) for name in model.parameters):
                place = source.place(("search", "stages", index, "free"))
                raise ConfigError(f"{place}: no parameter '{pattern}'.{nearest(pattern, model.parameters)}")


def _check_paths(fit: Fit, source: YamlFile) -> None:
    """Open all scenes with the starting values; where that fails, with each alone, so that its line is named."""
    try:
        _open_all(fit, fit.start)
    except UwbbenchError as error:
        for name, value in fit.start.items():
            with placed(source, ("parameters", name, "path")):
                _open_all(fit, {name: value})
        raise ConfigError(f"{source.name}: the scenes cannot be opened: {error}") from None


def _open_all(fit: Fit, values: Mapping[str, Any]) -> None:
    with changed(fit.files, fit.changes(values)) as files:
        for cell in fit.cells.values():
            open_cell(files, cell, 0, 1)
