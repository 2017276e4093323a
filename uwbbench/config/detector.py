"""The detector file: stages in order, each with checked parameters."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from uwbbench.api import registry
from uwbbench.api.check import checked
from uwbbench.api.errors import ConfigError, PluginError, nearest
from uwbbench.api.locate import find_config
from uwbbench.api.override import with_values
from uwbbench.api.yaml_file import YamlFile, parse_yaml, read_yaml
from uwbbench.config.extends import extended, placed
from uwbbench.config.identity import RESULTS_FILE
from uwbbench.config.mapper import MapperModel, MapperUse, check_mapper
from uwbbench.config.reported import ReportedFigures
from uwbbench.config.weights import anchored_weights, portable_weights

BY_CHANNEL = "by_channel"
"""Key of a parameter whose value depends on the capture's channel: ``{by_channel: {5: 1.0, 9: 0.2, other: 0.2}}``."""


class StepModel(BaseModel):
    """One stage of a detector file."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    use: str = Field(description="Registered name of the stage.")
    label: str | None = Field(None, alias="as", description="Another name for this step, where a stage is used twice.")
    params: dict[str, Any] = Field(default_factory=dict, description="Parameters of the stage.")
    optional: bool = Field(
        False, description="Leave the stage out, with a note, where the capture lacks what it needs (such as STS)."
    )
    unless: str | None = Field(
        None,
        description="Name of an optional step before this one, in whose place it stands: left out where that one is "
        "in use.",
    )


class DetectorModel(BaseModel):
    """A detector: an ordered list of stages."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    name: str = Field(min_length=1, description="Name in tables and reports.")
    description: str = ""
    citation: str = ""
    fidelity: Literal["from-source", "reconstruction", "baseline", "reference"] = "baseline"
    reported: list[ReportedFigures] = Field(
        default_factory=list, description="What the source of the method reports of it; no part of the detector."
    )
    score: str | None = Field(
        None,
        description="Column that orders its candidates in curves without a threshold, larger first; the first of "
        "score_db, prominence and amplitude that they have if left out.",
    )
    extends: str | None = Field(None, description="Detector (name or file) that this one changes.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values to change in the extended detector, by path.")
    pipeline: list[StepModel] = Field(min_length=1)
    mapper: MapperModel | None = Field(
        None, description="What makes poses and a map of a run; the pipeline is then the front end of each receiver."
    )


@dataclass(frozen=True)
class Step:
    """One stage of a detector, with parameters as written.

    Attributes
    ----------
    use, label : str
        Stage name, and the name of this step.
    params : dict
        Raw parameters; values may depend on the channel.
    optional : bool
        May be left out where the capture lacks what the stage needs.
    unless : str
        Label of the optional step before it in whose place it stands; empty for none.
    place : str
        File, line and key it was read from, for messages.
    implied_by : str
        Label of the step that this one was put in for; empty where the file names it.
    """

    use: str
    label: str
    params: dict[str, Any] = field(default_factory=dict)
    optional: bool = False
    unless: str = ""
    place: str = field(default="", compare=False)
    implied_by: str = field(default="", compare=False)

    def params_for(self, channel: int | None) -> tuple[dict[str, Any], list[str]]:
        """Parameters for a channel, and the names of those that fell back to ``other``."""
        resolved, fallen = {}, []
        for name, value in self.params.items():
            if isinstance(value, dict) and set(value) == {BY_CHANNEL}:
                table = value[BY_CHANNEL]
                if str(channel) in table:
                    value = table[str(channel)]
                elif "other" in table:
                    value = table["other"]
                    fallen.append(name)
                else:
                    raise ConfigError(
                        f"{self.label}: '{name}' has values for channels {', '.join(map(str, table))} and no 'other'; "
                        f"the capture's channel is {channel}"
                    )
            resolved[name] = value
        return resolved, fallen


@dataclass(frozen=True)
class DetectorConfig:
    """A validated detector file.

    Attributes
    ----------
    name, description, citation, fidelity : str
    steps : tuple of Step
    score : str
        Column that orders candidates in curves without a threshold; empty where the file names none.
    results : Path or None
        Folder in which another program has stored what it found; there are no steps then, and ``fidelity`` says so.
        What is in it counts, not where it is: it is no part of the resolved file.
    reported : tuple of ReportedFigures
        What the source of the method reports of it; no part of the resolved file either.
    mapper : MapperUse or None
        What makes poses and a map of a run; the steps are then the front end of each receiver.
    fronts : dict of tuples of Step
        Steps of the receivers whose front end differs; no part of the resolved file, whose mapper says how it does.
    trajectories : bool
        Whether ``results`` holds trajectories of runs.
    """

    name: str
    steps: tuple[Step, ...]
    description: str = ""
    citation: str = ""
    fidelity: str = "baseline"
    score: str = ""
    results: Path | None = field(default=None, compare=False)
    reported: tuple[ReportedFigures, ...] = field(default=(), compare=False)
    mapper: MapperUse | None = None
    fronts: dict[str, tuple[Step, ...]] = field(default_factory=dict, compare=False, repr=False)
    trajectories: bool = field(default=False, compare=False)

    def front(self, receiver: str) -> DetectorConfig:
        """Front end of a receiver of a run: a detector without the mapper."""
        return dataclasses.replace(self, steps=self.fronts.get(receiver, self.steps), mapper=None, fronts={})

    @property
    def of_runs(self) -> bool:
        """Whether it answers for whole runs, with poses and perhaps a map, and not for single captures."""
        return self.mapper is not None or self.trajectories

    @classmethod
    def of_results(cls, name: str, folder: Path, *, trajectories: bool = False) -> DetectorConfig:
        """Detector that is known by what it has written alone.

        Parameters
        ----------
        name : str
        folder : Path
        trajectories : bool
            Whether it has written the trajectories of runs.
        """
        return cls(name, (), fidelity=RESULTS_FILE, results=folder, trajectories=trajectories)

    def to_dict(self) -> dict[str, Any]:
        """Resolved file as plain values: what a manifest stores and an identity is made of."""
        return portable_weights(self.here())

    def here(self) -> dict[str, Any]:
        """Resolved file as plain values that another process on this machine can read, files that it names included."""
        steps = [
            {"use": s.use, "as": s.label, "params": s.params, "optional": s.optional}
            | ({"unless": s.unless} if s.unless else {})
            for s in self.steps
        ]
        score = {"score": self.score} if self.score else {}
        mapper = {} if self.mapper is None else {"mapper": self.mapper.to_dict()}
        return {"schema": 1, "name": self.name, "fidelity": self.fidelity, **score, "pipeline": steps, **mapper}


REFERENCE = "reference"
"""Fidelity of what stands beside detectors for comparison."""


def is_bound(config: DetectorConfig) -> bool:
    """Whether it only bounds what detectors can reach: it or a stage of it is a reference, or reads the truth."""
    steps = [step for steps in (config.steps, *config.fronts.values()) for step in steps]
    stages = [registry.load_plugin("stages", step.use) for step in steps]
    if config.mapper is not None:
        stages.append(registry.load_plugin("mappers", config.mapper.use))
    seeing = any("truth" in stage.needs or stage.fidelity == REFERENCE for stage in stages)
    return seeing or config.fidelity == REFERENCE


def read_detector(
    name: str, relative_to: Path | None = None, changes: Mapping[str, Any] | None = None
) -> DetectorConfig:
    """Read a detector by name or path.

    Parameters
    ----------
    name : str
        Shipped or registered name, or a path to a YAML file.
    relative_to : Path, optional
        Folder that a relative path starts from.
    changes : mapping, optional
        Values to change, by path, before checking.

    Raises
    ------
    ConfigError, PluginError
        If the file is missing or wrong, or names a stage that is not installed.
    """
    path = find_config("detectors", name, relative_to)
    source = read_yaml(path)
    data = anchored_weights(extended(source, "detectors", path, anchored_weights), path.parent)
    if changes:
        data = anchored_weights(with_values(data, changes, "--set"), relative_to or Path())
    return check_detector(data, source)


def detector_from_text(text: str, name: str = "detector") -> DetectorConfig:
    """Detector from YAML text, as :func:`read_detector` does from a file."""
    source = parse_yaml(text, name)
    return check_detector(anchored_weights(extended(source, "detectors", None, anchored_weights), Path()), source)


def check_detector(data: Mapping[str, Any], source: YamlFile) -> DetectorConfig:
    """Detector from resolved values; every stage is looked up and every parameter checked."""
    model = checked(DetectorModel, data, source)
    if model.set:
        raise ConfigError(f"{source.place(('set',))}: 'set' changes an extended detector, but 'extends' is missing")
    steps = _checked_steps(model.pipeline, source)
    for place, figures in enumerate(model.reported):
        for at, name in enumerate(figures.metrics):
            if name not in registry.entries("metrics"):
                where = source.place(("reported", place, "metrics", at))
                raise ConfigError(f"{where}: no metric '{name}'.{nearest(name, registry.entries('metrics'))}")
    _check_score(model.score, steps, source)
    about = model.description, model.citation, model.fidelity
    mapper = check_mapper(model.mapper, source)
    fronts = {} if mapper is None else {name: _front(name, mapper, data, source) for name in mapper.front}
    return DetectorConfig(
        model.name, steps, *about, model.score or "", reported=tuple(model.reported), mapper=mapper, fronts=fronts
    )


def _front(receiver: str, mapper: MapperUse, data: Mapping[str, Any], source: YamlFile) -> tuple[Step, ...]:
    """Steps of a receiver whose front end differs."""
    at = ("mapper", "front", receiver)
    changes = {f"pipeline.{path}": value for path, value in mapper.front[receiver].items()}
    with placed(source, at):
        changed = with_values({"pipeline": data["pipeline"]}, changes, source.place(at))
        model = checked(DetectorModel, {**data, **changed}, source)
        return _checked_steps(model.pipeline, source)


def _checked_steps(pipeline: list[StepModel], source: YamlFile) -> tuple[Step, ...]:
    """Steps of a pipeline; every stage is looked up and every parameter checked."""
    steps: list[Step] = []
    for index, item in enumerate(pipeline):
        label = item.label or item.use
        if label in {step.label for step in steps}:
            raise ConfigError(
                f"{source.place(('pipeline', index))}: step '{label}' appears twice; name one of them with 'as'"
            )
        params = _with_named_channels(item.params, source, index)
        step = Step(item.use, label, params, item.optional, item.unless or "", source.place(("pipeline", index)))
        _check_unless(step, steps)
        _check_params(step, source, index)
        steps.append(step)
    return tuple(_completed(steps))


def _check_unless(step: Step, before: list[Step]) -> None:
    """Check that a step stands in the place of one that may be left out."""
    if not step.unless:
        return
    optional = [one.label for one in before if one.optional]
    if step.unless not in optional:
        known = f"{nearest(step.unless, optional)} There are: {', '.join(optional) or 'none'}"
        raise ConfigError(f"{step.place}: unless: no optional step '{step.unless}' before '{step.label}'.{known}")


def _check_score(score: str | None, steps: Sequence[Step], source: YamlFile) -> None:
    """Check that a step makes the column that orders candidates."""
    made = {port for step in steps for port in registry.load_plugin("stages", step.use).produces}
    parts = {"first_path", "noise", "profile", "aligned", "window_mean", "window_sd", "detections", "cluster"}
    columns = sorted(made - parts)
    if score is not None and score not in columns:
        known = f"{nearest(score, columns)} They make: {', '.join(columns) or 'no column'}"
        raise ConfigError(f"{source.place(('score',))}: no step makes the column '{score}'.{known}")


def _completed(steps: list[Step]) -> list[Step]:
    """Steps with the implied ones put in directly before their first user."""
    produced = {"frames"}
    for step in steps:
        produced |= registry.load_plugin("stages", step.use).produces
    taken = {step.label for step in steps}
    completed: list[Step] = []

    def put(step: Step) -> None:
        for port in sorted(registry.load_plugin("stages", step.use).consumes - produced):
            use = _implied(port)
            if use is not None and use not in taken:
                produced.update(registry.load_plugin("stages", use).produces)
                taken.add(use)
                put(Step(use, use, place=step.place, implied_by=step.label))
        completed.append(step)

    for step in steps:
        put(step)
    return completed


def _implied(port: str) -> str | None:
    """Stage that is put in, with its defaults and a note, where no step of a file makes a port; None for none."""
    use = registry.makers().get(port)
    return use if use in registry.entries("stages") and registry.load_plugin("stages", use).implied else None


def _with_named_channels(params: Mapping[str, Any], source: YamlFile, index: int) -> dict[str, Any]:
    """Parameters whose channels are text, whether the file has numbers or text."""
    named = {}
    for name, value in params.items():
        if isinstance(value, dict) and BY_CHANNEL in value:
            table = value[BY_CHANNEL]
            wrong = set(value) != {BY_CHANNEL} or not isinstance(table, dict) or not table
            if wrong or any(key != "other" and not str(key).isdecimal() for key in table):
                place = source.place(("pipeline", index, "params", name))
                raise ConfigError(f"{place}: by_channel expects channel numbers and 'other' as keys")
            value = {BY_CHANNEL: {str(key): choice for key, choice in table.items()}}
        named[name] = value
    return named


def _check_params(step: Step, source: YamlFile, index: int) -> None:
    """Check a step's parameters for each channel that they distinguish."""
    at = ("pipeline", index)
    try:
        stage = registry.load_plugin("stages", step.use)
    except PluginError as error:
        raise PluginError(f"{source.place((*at, 'use'))}: {error}") from error
    tables = [value[BY_CHANNEL] for value in step.params.values() if isinstance(value, dict) and BY_CHANNEL in value]
    named = {int(key) for table in tables for key in table if key != "other"}
    channels: list[int | None] = [*sorted(named)]
    if all("other" in table for table in tables):
        channels.append(None)
    for channel in channels:
        try:
            params, _ = step.params_for(channel)
        except ConfigError as error:
            raise ConfigError(f"{source.place((*at, 'params'))}: {error}") from error
        checked(stage.params_type(), params, source, (*at, "params"))
