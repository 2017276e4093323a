"""Checking parsed YAML against a model, with messages that name file, line, key and the nearest valid one."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from uwbbench.api.errors import ConfigError, nearest
from uwbbench.api.text import quoted
from uwbbench.api.yaml_file import Path_, YamlFile

M = TypeVar("M", bound=BaseModel)


def checked(model: type[M], data: Any, source: YamlFile, at: Path_ = ()) -> M:
    """Model made of parsed YAML.

    Parameters
    ----------
    model : type
        Pydantic model.
    data : mapping
        Values.
    source : YamlFile
        Where they come from, for the message.
    at : tuple of str or int
        Keys that lead to them in that file.

    Raises
    ------
    ConfigError
        Naming every wrong key, each with its line.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problems = [_problem(model, data, source, at, item) for item in error.errors(include_url=False)]
        raise ConfigError("\n".join(dict.fromkeys(problems))) from None


def _problem(model: type[BaseModel], data: Any, source: YamlFile, at: Path_, item: Any) -> str:
    path: Path_ = tuple(item["loc"])
    shown = _known_part(data, path)
    place = source.place((*at, *shown))
    if item["type"] == "extra_forbidden":
        siblings = _fields(model, path[:-1])
        return f"{place}: unknown key '{path[-1]}'.{nearest(str(path[-1]), siblings)}"
    if item["type"] == "missing":
        return f"{source.place((*at, *path[:-1]))}: key '{path[-1]}' is missing"
    message = item["msg"].removeprefix("Value error, ")
    given = item.get("input")
    tail = "" if isinstance(given, dict | list) or item["type"] == "value_error" else f", found {quoted(given)}"
    return f"{place}: {message}{tail}"


def _known_part(data: Any, path: Path_) -> Path_:
    """Part of an error's path that really is in the data: unions add their own names to it."""
    kept: list[str | int] = []
    for part in path:
        if isinstance(data, dict) and part in data:
            data = data[part]
        elif isinstance(data, list) and isinstance(part, int) and part < len(data):
            data = data[part]
        else:
            continue
        kept.append(part)
    return tuple(kept)


def _fields(model: type[BaseModel], path: Path_) -> list[str]:
    """Names of the fields of the model at a path, as far as nested models can be followed."""
    here: Any = model
    for part in path:
        candidates = _models_in(here.model_fields[part].annotation) if part in getattr(here, "model_fields", {}) else []
        named = [candidate for candidate in candidates if candidate.__name__ == part]
        if isinstance(part, int) or named:
            here = named[0] if named else here
        elif candidates:
            here = candidates[0]
    fields = getattr(here, "model_fields", {})
    return [field.alias or name for name, field in fields.items()]


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models_in(part)]
