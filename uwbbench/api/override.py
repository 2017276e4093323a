"""Changing values of a parsed file: ``extends``, ``set`` and ``--set a.b=c``."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from typing import Any

from uwbbench.api.errors import ConfigError, nearest


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Mapping with the values of ``over`` on top; nested mappings merge, lists and scalars replace."""
    result = dict(base)
    for key, value in over.items():
        mine = result.get(key)
        result[key] = merged(mine, value) if isinstance(mine, dict) and isinstance(value, Mapping) else value
    return result


def with_values(data: Mapping[str, Any], changes: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Copy of parsed YAML with single values changed.

    Parameters
    ----------
    data : mapping
        Parsed file.
    changes : mapping
        Value by dotted path. An item of a list is addressed by its number, or by the value of its ``as``, ``use`` or
        ``id`` key, even where that holds dots: ``pipeline.filter.width.params.minimum``.
    where : str
        File or option that asks for the changes, for messages.

    Raises
    ------
    ConfigError
        If a path leads nowhere.
    """
    result: dict[str, Any] = copy.deepcopy(dict(data))
    for path, value in changes.items():
        _set(result, path, value, where)
    return result


def _set(data: dict[str, Any], path: str, value: Any, where: str) -> None:
    here: Any = data
    rest = path
    key: str | int
    while rest:
        if isinstance(here, list):
            key, rest = _item(here, rest, path, where)
        elif isinstance(here, dict):
            name, _, rest = rest.partition(".")
            key = _key(here, name)
        else:
            raise ConfigError(f"{where}: '{path}' leads into a single value")
        if not rest:
            here[key] = value
            return
        if isinstance(here, dict):
            if key in here and not isinstance(here[key], dict | list):
                raise ConfigError(f"{where}: '{path}': '{key}' is a single value")
            here.setdefault(key, {})
        here = here[key]


def value_at(data: Mapping[str, Any], path: str, where: str) -> Any:
    """Value that a path leads to, by the rules of :func:`with_values`; None where there is none yet.

    Parameters
    ----------
    data : mapping
        Parsed file.
    path : str
    where : str
        File or option that asks for it, for messages.

    Raises
    ------
    ConfigError
        If an item of a list on the way is unknown.
    """
    here: Any = data
    rest = path
    while rest:
        if isinstance(here, list):
            index, rest = _item(here, rest, path, where)
            here = here[index]
        elif isinstance(here, Mapping):
            name, _, rest = rest.partition(".")
            here = here.get(_key(here, name))
        else:
            return None
    return here


def _key(data: Mapping[Any, Any], name: str) -> str | int:
    """Key of a mapping as its file has it: a number, such as that of a channel, may be one there."""
    return int(name) if name not in data and name.isdecimal() and int(name) in data else name


def _item(items: list[Any], rest: str, path: str, where: str) -> tuple[int, str]:
    names = {}
    for index, item in enumerate(items):
        names[str(index)] = index
        if isinstance(item, dict):
            names.setdefault(str(item.get("as") or item.get("use") or item.get("id")), index)
    for name in sorted(names, key=len, reverse=True):
        if rest == name or rest.startswith(f"{name}."):
            return names[name], rest[len(name) + 1 :]
    raise ConfigError(f"{where}: '{path}': no item '{rest}'.{nearest(rest, names)}")


def parse_settings(texts: Iterable[str]) -> dict[str, Any]:
    """Options ``a.b=value`` as changes by path; values follow the YAML rules."""
    from uwbbench.api.yaml_file import parse_value

    changes = {}
    for text in texts:
        path, equals, value = text.partition("=")
        if not equals or not path.strip():
            raise ConfigError(f"--set {text}: expected key=value, for example --set gate_m=0.1")
        changes[path.strip()] = parse_value(value)
    return changes
