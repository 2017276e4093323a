"""JSON Schema of the files that people write, for editors that complete and check while typing.

The schemas are made from the models that check the files, with the parameters of every installed plugin. Editors know
what a file looks like, not what is in other files: only ``uwbbench validate`` follows ``extends`` and ``set``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from uwbbench.api import registry
from uwbbench.api.errors import PluginError
from uwbbench.config.datasets import DatasetUse
from uwbbench.config.detector import BY_CHANNEL, DetectorModel, StepModel
from uwbbench.config.mapper import MapperModel
from uwbbench.run.experiment import ExperimentModel, ScoredDataset
from uwbbench.tools.fit.config import FitModel
from uwbbench.tools.gate.config import GateModel
from uwbbench.tools.train.config import TrainModel
from uwbbench.tools.tune.config import TuneModel

Schema = dict[str, Any]


@dataclass(frozen=True)
class Choice:
    """Part of a file that chooses a plugin of a kind by ``use``.

    Attributes
    ----------
    part : type
        Its model.
    kind : str
    by_channel : bool
        Whether parameters may depend on the channel.
    """

    part: type[BaseModel]
    kind: Literal["stages", "mappers", "datasets", "terms"]
    by_channel: bool = False


@dataclass(frozen=True)
class _Found:
    """Parameters of the plugins of a kind; beside those that cannot be loaded, which take no others' schema away."""

    params: dict[str, type[BaseModel]]
    broken: dict[str, str]

    @classmethod
    def of(cls, kind: Literal["stages", "mappers", "datasets", "terms"]) -> _Found:
        found = cls({}, {})
        for name in registry.entries(kind):
            try:
                found.params[name] = registry.load_plugin(kind, name).params_type()
            except PluginError as error:
                found.broken[name] = str(error)
        return found


DIALECT = "https://json-schema.org/draft/2020-12/schema"
_ABOUT = ("title", "description", "default")


def detector_schema() -> Schema:
    """JSON Schema of a detector file; each step's parameters follow from its ``use`` and may depend on the channel."""
    steps, mapper = Choice(StepModel, "stages", by_channel=True), Choice(MapperModel, "mappers")
    return _file_schema(DetectorModel, steps, mapper)


def experiment_schema() -> Schema:
    """JSON Schema of an experiment file; each dataset's parameters follow from its ``use``."""
    schema = _file_schema(ExperimentModel, Choice(ScoredDataset, "datasets"))
    properties = schema["properties"]
    # The two short forms that the model accepts: `scoring: frame` and `latency: false`.
    properties["scoring"] = _or(properties["scoring"], properties["scoring"]["items"])
    properties["latency"] = _or(properties["latency"], {"type": "boolean"})
    return schema


def gate_schema() -> Schema:
    """JSON Schema of a gate file; each dataset's parameters follow from its ``use``."""
    return _file_schema(GateModel, Choice(DatasetUse, "datasets"))


def tuning_schema() -> Schema:
    """JSON Schema of a tuning file; each dataset's parameters follow from its ``use``."""
    return _file_schema(TuneModel, Choice(DatasetUse, "datasets"))


def training_schema() -> Schema:
    """JSON Schema of a training file; each dataset's parameters follow from its ``use``."""
    return _file_schema(TrainModel, Choice(DatasetUse, "datasets"))


def fit_schema() -> Schema:
    """JSON Schema of a fit file."""
    return {"$schema": DIALECT, **FitModel.model_json_schema()}


def scene_schema() -> Schema:
    """JSON Schema of a scene file; each term's parameters follow from its ``use``.

    Raises
    ------
    PluginError
        If the dataset that reads scenes cannot be loaded.
    """
    simulator = registry.load_plugin("datasets", registry.default("dataset.scenes"))
    schema = _file_schema(simulator.scene_model, Choice(simulator.term_model, "terms", by_channel=True))
    for part in (schema, *schema["$defs"].values()):
        own = part.get("properties", {})
        own |= {key: _or_by_channel(value) for key, value in own.items() if _may_differ(key, value)}
    return schema


def robot_schema() -> Schema:
    """JSON Schema of a robot's file, with the parameters of the terms that belong to robots.

    Raises
    ------
    PluginError
        If the dataset that reads scenes, or a term, cannot be loaded.
    """
    model = registry.load_plugin("datasets", registry.default("dataset.scenes")).robot_model
    kinds = {name: registry.load_plugin("terms", name) for name in registry.entries("terms")}
    params = {name: kind.params_type() for name, kind in kinds.items() if kind.of_robot}
    models = dict.fromkeys([model, *params.values()])
    places, whole = models_json_schema([(one, "validation") for one in models], by_alias=True)
    definitions: dict[str, Schema] = whole["$defs"]
    owned = {name: places[one, "validation"] for name, one in params.items()}
    for part in definitions.values():
        if "terms" in part.get("properties", {}):
            part["properties"]["terms"] |= {"properties": owned, "additionalProperties": False}
    return {"$schema": DIALECT, **definitions.pop(model.__name__), "$defs": definitions}


def _may_differ(key: str, value: Schema) -> bool:
    """Whether a scene may give the key a value for each channel, and that is not said yet."""
    said = any(BY_CHANNEL in one.get("properties", {}) for one in value.get("anyOf", ()))
    return not said and "const" not in value and key not in ("schema", "name", "vary", "channel")


def _file_schema(model: type[BaseModel], *choices: Choice) -> Schema:
    """Schema of a file, parts of which choose a plugin by ``use`` and hold its ``params``."""
    found = {choice: _Found.of(choice.kind) for choice in choices}
    models = dict.fromkeys([model, *(params for each in found.values() for params in each.params.values())])
    places, whole = models_json_schema([(one, "validation") for one in models], by_alias=True)
    definitions: dict[str, Schema] = whole["$defs"]
    for choice, each in found.items():
        given = {name: places[params, "validation"] for name, params in each.params.items()}
        _let_choose(definitions, choice, given, each.broken)
    file = definitions.pop(model.__name__)
    required = file.pop("required")
    if "extends" not in model.model_fields:
        return {"$schema": DIALECT, **file, "required": required, "$defs": definitions}
    others: list[Schema] = [{"required": [key]} for key in ("extends", "experiments") if key in model.model_fields]
    inherits: Schema = {"if": {"anyOf": others}, "else": {"required": required}}
    inherits["dependentRequired"] = {"set": ["extends"]}
    return {"$schema": DIALECT, **file, **inherits, "$defs": definitions}


def _let_choose(
    definitions: dict[str, Schema], choice: Choice, given: dict[str, Schema], broken: dict[str, str]
) -> None:
    """Let a part of a file have the parameters of the plugin that its ``use`` names.

    Parameters
    ----------
    definitions : dict
        Of all models; changed in place.
    choice : Choice
    given : dict
        Reference to the parameters of each plugin.
    broken : dict
        Why plugins cannot be loaded.
    """
    names = {name: reference["$ref"].rsplit("/", 1)[1] for name, reference in given.items()}
    for name in set(names.values()) if choice.by_channel else ():
        own = definitions[name].get("properties", {})
        own |= {key: _or_by_channel(value) for key, value in own.items()}
    rules = []
    for name, reference in given.items():
        chosen: Schema = {"properties": {"params": reference}}
        if definitions[names[name]].get("required"):
            chosen["required"] = ["params"]
        rules.append({"if": {"properties": {"use": {"const": name}}, "required": ["use"]}, "then": chosen})
    part = definitions[choice.part.__name__]
    part["properties"]["use"] |= {"enum": [*given, *broken]}
    if broken:
        part["properties"]["use"]["description"] += " " + " ".join(broken.values())
    if rules:
        part["allOf"] = rules


def _or_by_channel(value: Schema) -> Schema:
    """Schema of a parameter that may also be ``{by_channel: {5: ..., 9: ..., other: ...}}``."""
    plain = {key: part for key, part in value.items() if key not in _ABOUT}
    table: Schema = {"type": "object", "patternProperties": {r"^([0-9]+|other)$": plain}}
    table |= {"additionalProperties": False, "minProperties": 1}
    channels = {"type": "object", "properties": {BY_CHANNEL: table}, "required": [BY_CHANNEL]}
    return _or(value, {**channels, "additionalProperties": False})


def _or(value: Schema, other: Schema) -> Schema:
    """Schema of what may also have another form; what is said about it stays outside."""
    about = {key: value[key] for key in _ABOUT if key in value}
    return {**about, "anyOf": [{key: part for key, part in value.items() if key not in _ABOUT}, other]}
