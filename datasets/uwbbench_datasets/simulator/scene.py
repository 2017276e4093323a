"""The scene file: radar, trajectory, objects and terms, and the variants that ``vary`` makes of them."""

from __future__ import annotations

import hashlib
import itertools
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, field_validator, model_validator

from uwbbench.api import (
    ConfigError,
    Params,
    PluginError,
    Radar,
    Term,
    YamlFile,
    checked,
    load_plugin,
    read_yaml,
    with_values,
)
from uwbbench_datasets.simulator.anchors import AnchorModel
from uwbbench_datasets.simulator.by_channel import for_channel
from uwbbench_datasets.simulator.radar import RadarModel, ReceiverModel
from uwbbench_datasets.simulator.robot import Robot, read_robot
from uwbbench_datasets.simulator.shapes import ObjectModel
from uwbbench_datasets.simulator.trajectory import TrajectoryModel

_MOST_VARIANTS = 10_000


class TermUse(Params):
    """One term of a scene."""

    use: str = Field(description="Registered name of the term.")
    label: str | None = Field(default=None, alias="as", description="Another name, where a term is used twice.")
    params: dict[str, Any] = Field(default_factory=dict, description="Parameters of the term.")

    @property
    def name(self) -> str:
        """Name of this use: what its random stream follows from."""
        return self.label or self.use


class FidelityModel(Params):
    """Which terms may be left out."""

    mode: Literal["auto", "all"] = Field(
        default="auto", description="auto: leave out what noise covers; all: keep all terms."
    )
    margin_db: float = Field(default=10.0, ge=0, description="How far below the noise a term must stay to be left out.")
    force: list[str] = Field(default_factory=list, description="Terms that are kept in any case.")


class SceneNames(Params):
    """What a scene file says before its variants are told apart."""

    model_config = ConfigDict(extra="ignore")

    name: str | None = Field(None, min_length=1, description="Name of the captures; the file's name if left out.")
    vary: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field(
        default_factory=dict, description="Values by path; each combination is a variant of its own."
    )


class SceneModel(SceneNames):
    """A scene. A value that depends on the channel is written ``{by_channel: {5: 1.0, 9: 0.2}}``."""

    model_config = ConfigDict(extra="forbid")

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    description: str = ""
    seed: int = Field(1, ge=0, description="Of all random draws but those that belong to the robot.")
    robot: str | None = Field(
        None, description="The robot: a shipped name, or a file from the scene's folder. Its ringing is then its own."
    )
    robot_seed: int | None = Field(
        None, ge=0, description="Of what is drawn once for the robot, in place of the seed in its file."
    )
    runs: int = Field(1, ge=1, le=10_000, description="Captures of each variant, with other draws.")
    radar: RadarModel = RadarModel()
    receivers: dict[Annotated[str, Field(pattern=r"^[\w-]+$")], ReceiverModel] = Field(
        default={"front": ReceiverModel()}, min_length=1
    )
    trajectory: TrajectoryModel
    objects: list[ObjectModel] = Field(default_factory=list)
    anchors: list[AnchorModel] = Field(
        default_factory=list, description="Radios of known identity, which the term anchor.messages hears."
    )
    terms: list[TermUse] = Field(min_length=1, description="What frames are made of; the order counts in each hook.")
    fidelity: FidelityModel = FidelityModel()
    draw: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(
        default_factory=dict, description="Values by path that each run draws anew, evenly between two ends."
    )
    draw_seed: int | None = Field(
        None,
        ge=0,
        description="Of these draws, in place of 'seed': a run's values are then the same in all variants, each of "
        "which has noise of its own.",
    )

    @field_validator("objects", mode="before")
    @classmethod
    def _without_nulls(cls, value: Any) -> Any:
        return [one for one in value if one is not None] if isinstance(value, list) else value

    @model_validator(mode="after")
    def _names_differ(self) -> SceneModel:
        named: dict[str, list[Any]] = {"object": [one.id for one in self.objects]}
        named |= {"anchor": [one.id for one in self.anchors], "term": [one.name for one in self.terms]}
        for kind, names in named.items():
            twice = {name for name in names if names.count(name) > 1}
            if twice:
                hint = "; name one of them with 'as'" if kind == "term" else ""
                raise ValueError(f"{kind} '{sorted(twice)[0]}' appears twice{hint}")
        unknown = set(self.fidelity.force) - {one.name for one in self.terms}
        if unknown:
            raise ValueError(f"fidelity.force names '{sorted(unknown)[0]}', which is no term of the scene")
        return self


@dataclass(frozen=True)
class Scene:
    """One variant of a scene file, checked.

    Attributes
    ----------
    name : str
        ``scene`` or ``scene/variant``.
    model : SceneModel
        With the radar as it is on the robot.
    terms : tuple of (TermUse, type, Params)
        Each term with its class and checked parameters.
        With parameters that belong to the robot.
    folder : Path
        Where files that the scene names lie.
    robot_seed : int or None
        Of what is drawn once for the robot; None where each run draws it anew.
    robot : str
        Name of the robot; empty where the scene names none.
    source : YamlFile
        Its file, with the values of this variant.
    """

    name: str
    model: SceneModel
    terms: tuple[tuple[TermUse, type[Term[Any]], Params], ...]
    folder: Path
    robot_seed: int | None = None
    robot: str = ""
    source: YamlFile = field(default_factory=lambda: YamlFile("scene", {}, {}), repr=False, compare=False)

    def seeded(self, seed: int) -> Scene:
        """The scene with draws that follow from a number, those of each variant from another one.

        What ``draw_seed`` decides follows from it too, alike for all variants of a file.
        """
        seeds = {"seed": _number(seed, self.name)}
        if self.model.draw_seed is not None:
            seeds["draw_seed"] = _number(seed, f"draw {self.name.partition('/')[0]} {self.model.draw_seed}")
        return replace(self, model=self.model.model_copy(update=seeds))

    def of_run(self, run: int) -> Scene:
        """The scene with what a run draws anew; each path has a random stream of its own.

        Raises
        ------
        ConfigError, PluginError
            If a path leads nowhere, or to a value that may not be so.
        """
        if not self.model.draw:
            return self
        drawn = {}
        seed = self.model.seed if self.model.draw_seed is None else self.model.draw_seed
        for path, (low, high) in self.model.draw.items():
            stream = np.random.SeedSequence(seed, spawn_key=(run, zlib.crc32(path.encode())))
            drawn[path] = float(np.random.Generator(np.random.SFC64(stream)).uniform(low, high))
        seeds = {"seed": self.model.seed, "draw_seed": self.model.draw_seed}
        data = with_values(self.source.data, {**drawn, **seeds}, self.source.place(("draw",)))
        robot_named = partial(read_robot, folder=self.folder, place=self.source.place(("robot",)))
        return _scene(self.name, data, self.source, self.folder, robot_named)

    @property
    def robot_identity(self) -> str:
        """What tells one robot from others: its name and seed; empty where each run has a robot of its own."""
        return "" if self.robot_seed is None else f"{self.robot or 'without a file'}, seed {self.robot_seed}"

    def radar(self, receiver: str) -> Radar:
        """Radar of one receiver."""
        return self.model.radar.radar(receiver, self.model.receivers[receiver])


def _number(seed: int, text: str) -> int:
    """Seed that follows from another one and a name."""
    return int.from_bytes(hashlib.sha256(f"{seed} {text}".encode()).digest()[:16])


def read_scenes(path: Path, changes: Mapping[str, Any] | None = None) -> list[Scene]:
    """All variants of a scene file.

    Parameters
    ----------
    path : Path
    changes : mapping, optional
        Values by path, put on top of the file; a path that ``vary`` would vary is then fixed.

    Raises
    ------
    ConfigError, PluginError
        If the file is wrong or names a term that is not installed.
    """
    source = read_yaml(path)
    changes = dict(changes or {})
    data = with_values(source.data, changes, "--set")
    if isinstance(data.get("vary"), dict):
        data["vary"] = {key: values for key, values in data["vary"].items() if key not in changes}
    names = checked(SceneNames, data, source)
    name, vary = names.name or path.stem, names.vary
    count = int(np.prod([float(len(values)) for values in vary.values()]))
    if count > _MOST_VARIANTS:
        raise ConfigError(f"{source.place(('vary',))}: {count} variants are more than {_MOST_VARIANTS}")
    labels = _short_names(list(vary))
    robot_named = cache(partial(read_robot, folder=path.parent, place=source.place(("robot",))))
    scenes = []
    for values in itertools.product(*vary.values()):
        chosen = dict(zip(vary, values, strict=True))
        variant = with_values(data, chosen, source.place(("vary",))) if chosen else data
        parts = [f"{labels[key]}-{_text(vary[key], value)}" for key, value in chosen.items()]
        whole = "/".join([name, *(["_".join(parts)] if parts else [])])
        scene = _scene(whole, variant, source, path.parent, robot_named)
        if scene.model.draw_seed is not None:  # equal noise in two variants would tell one by the other
            scene = replace(scene, model=scene.model.model_copy(update={"seed": _number(scene.model.seed, whole)}))
        scenes.append(scene)
        scenes[-1].of_run(1)  # so that a path that leads nowhere is found before anything is simulated
    return scenes


def scene_of(name: str, data: Mapping[str, Any]) -> Scene:
    """Scene of values that no file holds, such as those of one that was drawn.

    Parameters
    ----------
    name : str
        Of the captures, and in messages.
    data : mapping
        As a scene file has it, without ``vary``.

    Raises
    ------
    ConfigError, PluginError
        As :func:`read_scenes`.
    """
    source = YamlFile(name, dict(data), {})
    return _scene(name, data, source, Path(), partial(read_robot, folder=Path(), place=source.place(("robot",))))


def _scene(
    name: str, data: Mapping[str, Any], source: YamlFile, folder: Path, robot_named: Callable[[str], Robot]
) -> Scene:
    """One variant, from the values that the file has in it."""
    radar = data.get("radar")
    channel = (radar if isinstance(radar, dict) else {}).get("channel", RadarModel().channel)
    fixed = {key: value for key, value in data.items() if key != "vary"}
    model = checked(SceneModel, for_channel(fixed, channel, source), source)
    robot, place = None, source.place(("robot",))
    if model.robot is not None:
        robot = robot_named(model.robot)
        robot.check_fits(model.radar, place)
        robot.check_used([item.name for item in model.terms], model.radar.channel, place)
        model = model.model_copy(update={"radar": robot.radar(model.radar, source)})
    own_seed = robot.model.seed if robot else None
    seed = own_seed if model.robot_seed is None else model.robot_seed
    terms, called = _terms(model, robot, source), robot.model.name if robot else ""
    return Scene(name, model, terms, folder, seed, called, replace(source, data=dict(data)))


def _short_names(paths: list[str]) -> dict[str, str]:
    """Last part of each path, with as much in front as separates them."""
    names = {}
    for path in paths:
        parts = path.split(".")
        for length in range(1, len(parts) + 1):
            short = ".".join(parts[-length:])
            if not any(other != path and other.endswith(f".{short}") for other in paths):
                break
        names[path] = short
    return names


def _text(values: list[Any], value: Any) -> str:
    """Value as part of a name: an object's own name, or the number in the list, where it is no single value."""
    if isinstance(value, dict) and isinstance(value.get("id"), str):
        return str(value["id"])
    return str(values.index(value) + 1) if isinstance(value, list | dict) else str(value).replace("/", "-")


def _terms(
    model: SceneModel, robot: Robot | None, source: YamlFile
) -> tuple[tuple[TermUse, type[Term[Any]], Params], ...]:
    terms = []
    for index, item in enumerate(model.terms):
        try:
            term: type[Term[Any]] = load_plugin("terms", item.use)
        except PluginError as error:
            raise PluginError(f"{source.place(('terms', index, 'use'))}: {error}") from error
        at = ("terms", index, "params")
        given = robot.params(item.name, model.radar.channel, item.params, source, at) if robot else item.params
        params = checked(term.params_type(), given, source, at)
        terms.append((item, term, params))
    return tuple(terms)
