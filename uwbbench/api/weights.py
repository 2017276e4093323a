"""Weights files: what a stage has learned, as plain arrays, with what it was learned from.

A safetensors file (https://github.com/huggingface/safetensors): a header of JSON, then raw numbers. Nothing in it can
be code, and nothing is ever unpickled. Its metadata has one key, whose value is JSON of :class:`About`.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from uwbbench.api import registry
from uwbbench.api.arrays import locked
from uwbbench.api.errors import ConfigError, PluginError, nearest
from uwbbench.api.learning import PINNED, LearnedParams, Trainable, Weights
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Stage

SUFFIX = ".safetensors"
_KEY = "uwbbench"
_SAMPLING = ("samples", "taps", "sample_interval_s", "center_frequency_hz", "bandwidth_hz")
"""What two radars must have in common for features of one to mean the same for the other."""


class _Fact(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LearnedFrom(_Fact):
    """A capture that weights were learned from, or chosen by."""

    role: Literal["training", "validation"]
    dataset: str
    capture: str
    sha256: str
    recording: str


class StepBefore(_Fact):
    """A step of the detector before the stage that learns."""

    use: str
    params: dict[str, Any]


class About(_Fact):
    """Where weights come from."""

    format: Literal["uwbbench-weights"] = "uwbbench-weights"
    format_version: Literal[1] = 1
    plugin: str = Field(description="Registered name of the stage.")
    params: dict[str, Any] = Field(description="Its parameters that learning looks at.")
    before: tuple[StepBefore, ...] = Field(description="Steps that made what it learned from.")
    source: str = Field(description="SHA-256 of the sources of the stage.")
    radars: tuple[dict[str, str | int | float], ...] = Field(description="How the radars sampled.")
    captures: tuple[LearnedFrom, ...]
    seed: int
    versions: dict[str, str]


@dataclass(frozen=True)
class WeightsFile:
    """A weights file.

    Attributes
    ----------
    path : Path
    sha256 : str
        Of the file.
    about : About
    arrays : mapping of str to array
        Cannot be written to.
    """

    path: Path
    sha256: str
    about: About
    arrays: Weights


def sampling_of(radar: Radar) -> dict[str, str | int | float]:
    """What features of a radar's frames hang on."""
    return {name: getattr(radar, name) for name in _SAMPLING}


def contents(arrays: Weights, about: About) -> bytes:
    """Weights file as bytes: the same for the same arrays and facts."""
    from safetensors.numpy import save

    text = about.model_dump_json()  # one key, as the format does not keep several in order
    return bytes(save({name: np.ascontiguousarray(arrays[name]) for name in sorted(arrays)}, {_KEY: text}))


def read_weights(reference: str, stage: type[Any]) -> WeightsFile:
    """Read weights by reference.

    Parameters
    ----------
    reference : str
        ``NAME@SHA256`` or ``PATH@SHA256``.
    stage : type
        Class of the stage; named weights come with its package.

    Raises
    ------
    ConfigError
        If there is no such file, its content has another hash, or it is no weights file.
    """
    pinned = PINNED.fullmatch(reference)
    if pinned is None:
        raise ConfigError(f"weights '{reference}': expected NAME@SHA256")
    name, sha256 = pinned["name"], pinned["sha256"]
    return _read(Path(name) if name.endswith(SUFFIX) else _shipped(name, stage), sha256)


def _shipped(name: str, stage: type[Any]) -> Path:
    """Weights that come with the package of a stage."""
    package = stage.__module__.partition(".")[0]
    spec = importlib.util.find_spec(package)
    known = {
        path.stem: path
        for folder in (spec.submodule_search_locations or () if spec else ())
        for path in sorted((Path(folder) / "weights").glob(f"*{SUFFIX}"))
    }
    if name not in known:
        raise ConfigError(f"no weights '{name}' come with {package}.{nearest(name, known)}")
    return known[name]


@lru_cache(maxsize=8)
def _read(path: Path, sha256: str) -> WeightsFile:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: weights cannot be read: {error.strerror or error}") from None
    found = hashlib.sha256(content).hexdigest()
    if found != sha256:
        raise ConfigError(
            f"{path}: its content has the hash {found[:12]}, not {sha256[:12]}: these weights were changed"
        )
    return _parsed(path, sha256, content)


def _parsed(path: Path, sha256: str, content: bytes) -> WeightsFile:
    from safetensors import SafetensorError
    from safetensors.numpy import load

    try:
        arrays = load(content)
    except (SafetensorError, KeyError, ValueError) as error:
        raise ConfigError(f"{path}: is no safetensors file, or a damaged one ({error})") from None
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])  # well-formed, as it was just read
    try:
        about = About.model_validate_json(header.get("__metadata__", {}).get(_KEY, ""))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "metadata"
        raise ConfigError(f"{path}: was not written by 'uwbbench train' ({where}: {first['msg']})") from None
    return WeightsFile(path, sha256, about, {name: locked(array) for name, array in arrays.items()})


def weights_of(stage: Stage[Any]) -> WeightsFile | None:
    """Weights that the parameters of a stage name; None for a stage that learns nothing.

    Raises
    ------
    ConfigError
        If it learns and names none, or they cannot be read.
    """
    if not isinstance(stage.params, LearnedParams):
        return None
    if stage.params.weights is None:
        raise ConfigError("has no weights: train them with 'uwbbench train', and name their file in 'weights'")
    return read_weights(stage.params.weights, type(stage))


def load_weights(stage: Stage[Any], radar: Radar, before: Sequence[Mapping[str, Any]] | None = None) -> None:
    """Give a stage that learns its weights; any other stage stays as it is.

    Parameters
    ----------
    stage : Stage
        Not open yet.
    radar : Radar
        That it will be opened on.
    before : sequence of mapping, optional
        ``use`` and ``params`` of each step before it in its detector; None where it is examined alone.

    Raises
    ------
    ConfigError
        If the weights are missing, damaged, or of another stage, other parameters, other steps or another radar; the
        message names the file.
    """
    file = weights_of(stage)
    if file is None:
        return
    assert isinstance(stage, Trainable)  # noqa: S101 - its parameters say so
    about = file.about
    try:
        learned = registry.load_plugin("stages", about.plugin)
    except PluginError as error:
        raise ConfigError(f"{file.path}: {error}") from None
    if learned is not type(stage):
        raise ConfigError(f"{file.path}: these are weights of the stage '{about.plugin}'")
    _check_same(file, stage.params.learned_with, about.params, "was learned with")
    if before is not None:
        _check_steps(file, before)
    if not any(_alike(sampling_of(radar), one) for one in about.radars):
        known = "; or ".join(_described(one) for one in about.radars)
        raise ConfigError(
            f"{file.path}: was learned from radars with {known}; this one has {_described(sampling_of(radar))}"
        )
    try:
        stage.load(file.arrays)
    except ConfigError as error:
        raise ConfigError(f"{file.path}: {error}") from None


def _check_steps(file: WeightsFile, before: Sequence[Mapping[str, Any]]) -> None:
    """Refuse weights that were learned behind other steps: the features would be others."""
    learned = [one.use for one in file.about.before]
    here = [str(one["use"]) for one in before]
    if learned != here:
        raise ConfigError(
            f"{file.path}: was learned behind the steps {', '.join(learned) or 'none'}, and stands behind "
            f"{', '.join(here) or 'none'} here"
        )
    for one, mine in zip(file.about.before, before, strict=True):
        _check_same(file, mine["params"], one.params, f"was learned behind '{one.use}' with")


def _check_same(file: WeightsFile, mine: Mapping[str, Any], learned: Mapping[str, Any], what: str) -> None:
    for name in dict.fromkeys([*learned, *mine]):
        if mine.get(name) != learned.get(name):
            raise ConfigError(
                f"{file.path}: {what} {name} {learned.get(name)!r}, and {name} is {mine.get(name)!r} here"
            )


def _alike(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    return one.keys() == other.keys() and all(
        math.isclose(value, other[name], rel_tol=1e-6) if isinstance(value, float) else value == other[name]
        for name, value in one.items()
    )


def _described(sampling: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} {value:.6g}" if isinstance(value, float) else f"{name} {value}" for name, value in sampling.items()
    )
