"""The scene file: radar, trajectory, objects and terms, and the variants that ``vary`` makes of them."""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import (
    CHANNEL_CENTER_HZ,
    ConfigError,
    Params,
    PluginError,
    Pulse,
    Radar,
    Term,
    YamlFile,
    checked,
    load_plugin,
    read_yaml,
    with_values,
)
from uwbbench_datasets.simulator.pulses import GaussianPulse, RaisedCosinePulse
from uwbbench_datasets.simulator.shapes import ObjectModel
from uwbbench_datasets.simulator.trajectory import Point, TrajectoryModel, in_space

CHIP_S = 1 / 499.2e6
"""Chip duration of IEEE 802.15.4 HRP UWB: two taps."""
_MOST_VARIANTS = 10_000


class PulseModel(Params):
    """Pulse shape."""

    shape: Literal["gauss", "raised_cosine"] = Field(
        default="gauss", description="raised_cosine: that of IEEE 802.15.4."
    )
    fwhm_ns: float = Field(
        default=3.2, gt=0, description="Width of the Gaussian at half height; unused by raised_cosine."
    )

    def pulse(self) -> Pulse:
        """The pulse itself."""
        return RaisedCosinePulse(CHIP_S) if self.shape == "raised_cosine" else GaussianPulse(self.fwhm_ns * 1e-9)


class RadarModel(Params):
    """What all receivers of the scene share."""

    channel: Literal[5, 9] = Field(default=9, description="IEEE 802.15.4 channel.")
    taps: int = Field(default=50, ge=8, le=4096, description="Samples of one frame, half a chip (1.0016 ns) apart.")
    frame_rate_hz: float = Field(default=48.0, gt=0)
    crest_tap: float = Field(default=7.0, ge=0, description="Tap of the direct path's crest.")
    noise_taps: int = Field(default=4, ge=0, description="Leading taps that precede any arrival.")
    pulse: PulseModel = PulseModel()
    array_spacing_mm: float = Field(
        default=17.8, gt=0, description="Distance of the two antennas, the same on all channels."
    )
    gain_dbi: float = Field(
        default=6.0, description="Receiving antenna's gain for echoes; the direct path is without it."
    )
    sts: bool = Field(default=True, description="Whether frames hold the two STS responses.")

    @model_validator(mode="after")
    def _taps_fit(self) -> RadarModel:
        if not self.noise_taps <= self.crest_tap < self.taps:
            raise ValueError("crest_tap must lie behind the noise_taps and before the last tap")
        return self


class ReceiverModel(Params):
    """One receiver on the robot, and the transmitter that it listens to."""

    mount_position_m: Point = Field(default=[0.0, 0.0], description="Receiver in the robot frame.")
    mount_yaw_deg: float = Field(default=0.0, description="Boresight in the robot frame.")
    tx_position_m: Point = Field(default=[0.0, -0.25], description="Transmitter in the robot frame.")

    @model_validator(mode="after")
    def _apart(self) -> ReceiverModel:
        if np.array_equal(in_space(self.mount_position_m), in_space(self.tx_position_m)):
            raise ValueError("tx_position_m and mount_position_m are equal: a direct path needs a distance to fly")
        return self


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


class SceneModel(Params):
    """A scene."""

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    name: str | None = Field(None, min_length=1, description="Name of the captures; the file's name if left out.")
    description: str = ""
    seed: int = Field(1, ge=0, description="Of all random draws.")
    runs: int = Field(1, ge=1, le=10_000, description="Captures of each variant, with other draws.")
    radar: RadarModel = RadarModel()
    receivers: dict[Annotated[str, Field(pattern=r"^[\w-]+$")], ReceiverModel] = Field(
        default={"front": ReceiverModel()}, min_length=1
    )
    trajectory: TrajectoryModel
    objects: list[ObjectModel] = Field(default_factory=list)
    terms: list[TermUse] = Field(min_length=1, description="What frames are made of; the order counts in each hook.")
    fidelity: FidelityModel = FidelityModel()
    vary: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field(
        default_factory=dict, description="Values by path; each combination is a variant of its own."
    )
    draw: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(
        default_factory=dict, description="Values by path that each run draws anew, evenly between two ends."
    )

    @model_validator(mode="after")
    def _names_differ(self) -> SceneModel:
        for kind, names in (("object", [one.id for one in self.objects]), ("term", [one.name for one in self.terms])):
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
    terms : tuple of (TermUse, type, Params)
        Each term with its class and checked parameters.
    folder : Path
        Where files that the scene names lie.
    """

    name: str
    model: SceneModel
    terms: tuple[tuple[TermUse, type[Term[Any]], Params], ...]
    folder: Path

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
        for path, (low, high) in self.model.draw.items():
            stream = np.random.SeedSequence(self.model.seed, spawn_key=(run, zlib.crc32(path.encode())))
            drawn[path] = float(np.random.Generator(np.random.SFC64(stream)).uniform(low, high))
        source = YamlFile(f"scene '{self.name}', draw", {}, {})
        data = with_values(self.model.model_dump(by_alias=True), drawn, source.name)
        model = checked(SceneModel, data, source)
        return replace(self, model=model, terms=_terms(model, source))

    def radar(self, receiver: str) -> Radar:
        """Radar of one receiver."""
        shared, mount = self.model.radar, self.model.receivers[receiver]
        return Radar(
            model="simulated DW3000",
            center_frequency_hz=CHANNEL_CENTER_HZ[shared.channel],
            bandwidth_hz=1 / CHIP_S,
            sample_interval_s=CHIP_S / 2,
            frame_rate_hz=shared.frame_rate_hz,
            taps=shared.taps,
            channel=shared.channel,
            receiver=receiver,
            mount_position_m=_triple(mount.mount_position_m),
            mount_yaw_rad=float(np.radians(mount.mount_yaw_deg)),
            tx_position_m=_triple(mount.tx_position_m),
            noise_taps=shared.noise_taps,
            array_spacing_m=shared.array_spacing_mm * 1e-3,
            has_sts=shared.sts,
        )


def _triple(point: list[float]) -> tuple[float, float, float]:
    x, y, z = in_space(point)
    return float(x), float(y), float(z)


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
    base = checked(SceneModel, data, source)
    name = base.name or path.stem
    count = int(np.prod([float(len(values)) for values in base.vary.values()]))
    if count > _MOST_VARIANTS:
        raise ConfigError(f"{source.place(('vary',))}: {count} variants are more than {_MOST_VARIANTS}")
    labels = _short_names(list(base.vary))
    scenes = []
    for values in itertools.product(*base.vary.values()):
        chosen = dict(zip(base.vary, values, strict=True))
        model = checked(SceneModel, with_values(data, chosen, source.place(("vary",))), source) if chosen else base
        parts = [f"{labels[key]}-{_text(base.vary[key], value)}" for key, value in chosen.items()]
        whole = "/".join([name, *(["_".join(parts)] if parts else [])])
        scenes.append(Scene(whole, model, _terms(model, source), path.parent))
        scenes[-1].of_run(1)  # so that a path that leads nowhere is found before anything is simulated
    return scenes


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
    """Value as part of a name; its number in the list where it is no single value."""
    return str(values.index(value) + 1) if isinstance(value, list | dict) else str(value).replace("/", "-")


def _terms(model: SceneModel, source: YamlFile) -> tuple[tuple[TermUse, type[Term[Any]], Params], ...]:
    terms = []
    for index, item in enumerate(model.terms):
        try:
            term: type[Term[Any]] = load_plugin("terms", item.use)
        except PluginError as error:
            raise PluginError(f"{source.place(('terms', index, 'use'))}: {error}") from error
        params = checked(term.params_type(), item.params, source, ("terms", index, "params"))
        terms.append((item, term, params))
    return tuple(terms)
