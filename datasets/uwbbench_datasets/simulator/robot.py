"""Robots: what belongs to one robot and stays with it from scene to scene, read from a file of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from uwbbench.api import (
    ConfigError,
    Params,
    PluginError,
    Term,
    YamlFile,
    checked,
    find_config,
    load_plugin,
    read_yaml,
)
from uwbbench_datasets.simulator.radar import CHIP_S, PulseModel, RadarModel

_SAME_INTERVAL = 1e-3
"""Relative difference of two sample intervals up to which they are one that was rounded."""


class RobotRadar(Params):
    """The radar that a robot carries: its parameters say nothing about another one."""

    sample_interval_ns: float = Field(gt=0, description="Time between two taps.")
    taps: int | None = Field(None, ge=8, le=4096, description="Samples of one frame; any number if left out.")


class RobotChannel(Params):
    """What a robot is on one channel."""

    pulse: PulseModel | None = Field(None, description="Pulse shape; that of the scene if left out.")
    gain_dbi: float | None = Field(None, description="Receiving antenna's gain for echoes.")
    array_spacing_mm: float | None = Field(None, gt=0, description="Distance of the two antennas.")
    terms: dict[str, dict[str, Any]] = Field(
        default_factory=dict, description="Parameters of terms that belong to the robot, by the term's name."
    )


class RobotModel(Params):
    """A robot: the same in all runs and scenes that name it."""

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    name: str = Field(min_length=1)
    description: str = ""
    radar: RobotRadar
    seed: int = Field(ge=0, description="Of what is drawn once for the robot.")
    channels: dict[int, RobotChannel] = Field(min_length=1, description="By number of the channel.")


@dataclass(frozen=True)
class Robot:
    """A robot's file, checked.

    Attributes
    ----------
    model : RobotModel
    path : Path
    """

    model: RobotModel
    path: Path

    def __str__(self) -> str:
        """Name and file, for messages."""
        return f"robot '{self.model.name}' ({self.path})"

    def check_fits(self, radar: RadarModel, place: str) -> None:
        """Refuse the robot of another radar.

        Parameters
        ----------
        radar : RadarModel
            Radar of the scene.
        place : str
            Where the scene names the robot, for the message.

        Raises
        ------
        ConfigError
        """
        if radar.device is not None:
            raise ConfigError(f"{place}: {self} is the robot of another radar: the scene's has a device of its own")
        mine, interval_ns = self.model.radar, CHIP_S / 2 * 1e9
        if radar.channel not in self.model.channels:
            known = ", ".join(map(str, sorted(self.model.channels)))
            raise ConfigError(f"{place}: {self} has no channel {radar.channel}; it has {known}")
        if not math.isclose(mine.sample_interval_ns, interval_ns, rel_tol=_SAME_INTERVAL):
            found = f"samples every {mine.sample_interval_ns:g} ns, a scene's every {interval_ns:.4f} ns"
            raise ConfigError(f"{place}: {self} is the robot of another radar: it {found}")
        if mine.taps not in (None, radar.taps):
            found = f"its frames have {mine.taps} taps, the scene's {radar.taps}"
            raise ConfigError(f"{place}: {self} is the robot of another radar: {found}")

    def radar(self, radar: RadarModel, source: YamlFile) -> RadarModel:
        """Radar of a scene with what belongs to the robot.

        Raises
        ------
        ConfigError
            If both say the same.
        """
        mine = self.model.channels[radar.channel]
        given = {name: getattr(mine, name) for name in ("pulse", "gain_dbi", "array_spacing_mm")}
        given = {name: value for name, value in given.items() if value is not None}
        self._refuse_both(given, radar.model_fields_set, source, ("radar",))
        return radar.model_copy(update=given)

    def params(
        self, term: str, channel: int, params: Mapping[str, Any], source: YamlFile, at: tuple[str | int, ...]
    ) -> dict[str, Any]:
        """Parameters of one term of a scene with what belongs to the robot.

        Parameters
        ----------
        term : str
            Name of the term's use in the scene.
        channel : int
        params : mapping
            What the scene says.
        source : YamlFile
            The scene, for messages.
        at : tuple of str and int
            Keys that lead to ``params`` in it.

        Raises
        ------
        ConfigError
            If both say the same.
        """
        mine = self.model.channels[channel].terms.get(term, {})
        self._refuse_both(mine, params, source, at)
        return {**params, **mine}

    def _refuse_both(self, mine: Mapping[str, Any], scene: Any, source: YamlFile, at: tuple[str | int, ...]) -> None:
        for name in mine:
            if name in scene:
                place = source.place((*at, name))
                raise ConfigError(f"{place}: {self} says what this is; leave it out here, or in the robot's file")

    def check_used(self, terms: Sequence[str], channel: int, place: str) -> None:
        """Refuse parameters that nothing in a scene would take.

        Parameters
        ----------
        terms : sequence of str
            Names of the scene's terms.
        channel : int
        place : str
            Where the scene names the robot, for the message.

        Raises
        ------
        ConfigError
        """
        for name in self.model.channels[channel].terms:
            if name not in terms:
                raise ConfigError(
                    f"{place}: {self} describes the term '{name}', which the scene lacks: add {{use: {name}}}"
                )


def read_robot(name: str, folder: Path, place: str) -> Robot:
    """Robot that a scene names.

    Parameters
    ----------
    name : str
        A shipped name, or the path of a file from the scene's folder, which it must not leave.
    folder : Path
        The scene's folder.
    place : str
        Where the scene names the robot, for messages.

    Raises
    ------
    ConfigError, PluginError
        If there is no such file, or it is wrong.
    """
    return read_robot_file(_file(name, folder, place))


def read_robot_file(path: Path) -> Robot:
    """Robot of a file.

    Raises
    ------
    ConfigError, PluginError
        If the file is wrong, or gives parameters of a term that does not belong to a robot.
    """
    source = read_yaml(path)
    model = checked(RobotModel, source.data, source)
    for key in source.data["channels"]:
        for term, params in model.channels[int(key)].terms.items():
            at = ("channels", key, "terms", term)
            try:
                kind: type[Term[Any]] = load_plugin("terms", term)
            except PluginError as error:
                raise PluginError(f"{source.place(at)}: {error}") from error
            if not kind.of_robot:
                raise ConfigError(f"{source.place(at)}: '{term}' is no part of a robot; it belongs to the scene")
            checked(kind.params_type(), params, source, at)
    return Robot(model, path)


def _file(name: str, folder: Path, place: str) -> Path:
    if not name.endswith((".yaml", ".yml")):
        try:
            return find_config("robots", name)
        except ConfigError as error:
            raise ConfigError(f"{place}: {error} A file of your own ends in .yaml.") from error
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise ConfigError(f"{place}: the robot's file '{name}' must lie in the scene's folder")
    return path
