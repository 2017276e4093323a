"""Safe YAML with the value rules of YAML 1.2 and the line of every key.

Only ``true`` and ``false`` are booleans, so ``on``, ``no`` and ``10:30`` stay text and ``1e-3`` is a number. A key
given twice is an error. Nothing but mappings, lists, text, numbers, booleans and null can come out.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from uwbbench.api.errors import ConfigError
from uwbbench.api.text import LONGEST_VALUE, printable

Path_ = tuple[str | int, ...]
MOST_BYTES = 1 << 18
"""Longest file: ten times the longest that are shipped. It takes seconds to be parsed."""
_MAX_NODES, _MAX_DEPTH, _MAX_DIGITS = 100_000, 50, 100


class _Loader(yaml.SafeLoader):
    """PyYAML's safe loader with the scalar rules of the YAML 1.2 core schema."""

    depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Node with all below it, as long as they are not nested too deeply."""
        if self.depth == _MAX_DEPTH:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem=f"nested more than {_MAX_DEPTH} deep", problem_mark=mark)
        self.depth += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


_Loader.yaml_implicit_resolvers = {}
for _tag, _pattern, _starts in (
    ("bool", r"^(?:true|True|TRUE|false|False|FALSE)$", "tTfF"),
    ("null", r"^(?:~|null|Null|NULL|)$", ["~", "n", "N", ""]),
    ("int", r"^(?:[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)$", "-+0123456789"),
    (
        "float",
        r"^(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$",
        "-+0123456789.",
    ),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(_pattern), list(_starts))
_SCALARS = frozenset(f"tag:yaml.org,2002:{tag}" for tag in ("str", "bool", "null", "int", "float"))


def _integer(text: str) -> int:
    """Value of an integer; a leading zero does not make it octal, as it did in YAML 1.1."""
    if len(text) > _MAX_DIGITS:
        raise ValueError(f"more than {_MAX_DIGITS} digits")
    return int(text, 0) if text[:2] in ("0o", "0x") else int(text)


@dataclass(frozen=True)
class YamlFile:
    """A parsed file.

    Attributes
    ----------
    name : str
        File name for messages.
    data : dict
        Its mapping.
    lines : dict
        Line number of each key, by its path.
    """

    name: str
    data: dict[str, Any]
    lines: dict[Path_, int]

    def place(self, path: Path_) -> str:
        """``file:line: key`` of a path, as near as it exists."""
        for length in range(len(path), 0, -1):
            if path[:length] in self.lines:
                return f"{self.name}:{self.lines[path[:length]]}: {dotted(path)}"
        return f"{self.name}: {dotted(path)}" if path else self.name


def dotted(path: Path_) -> str:
    """Path as people write it: ``pipeline[2].params.minimum``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def read_yaml(path: Path) -> YamlFile:
    """Read one YAML file.

    Raises
    ------
    ConfigError
        If it cannot be read or is not a mapping.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_fifo()):  # a pipe of a shell is read like a file
            raise ConfigError(f"{path}: cannot be read: is no file")
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        text = content.decode("utf-8", "strict" if len(content) <= MOST_BYTES else "replace")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text ({error.reason} at byte {error.start})") from error
    return parse_yaml(text, str(path))


def parse_yaml(text: str, name: str) -> YamlFile:
    """Parse YAML text; ``name`` is that of the file in messages.

    Raises
    ------
    ConfigError
        If it is too long, no mapping, or no YAML of plain values.
    """
    if len(text.encode(errors="surrogatepass")) > MOST_BYTES:
        raise ConfigError(f"{name}: is longer than {MOST_BYTES // 1024} KiB, which no configuration needs")
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        lines: dict[Path_, int] = {}
        data = _Builder(loader, name, lines).value(node, ()) if node is not None else {}
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{name}:{mark.line + 1}" if mark else name
        problem = getattr(error, "problem", None) or str(error) or "nested too deeply"
        raise ConfigError(f"{where}: not valid YAML: {problem}") from error
    if not isinstance(data, dict):
        raise ConfigError(f"{name}: expected keys and values, found {type(data).__name__}")
    return YamlFile(name, data, lines)


def parse_value(text: str) -> Any:
    """Value of one option such as ``--set a.b=VALUE``, by the same rules."""
    return parse_yaml(f"value: {text}" if text.strip() else "value: ''", "--set").data["value"]


class _Builder:
    """Turns the node tree into plain values, noting the line of each key."""

    def __init__(self, loader: _Loader, name: str, lines: dict[Path_, int]) -> None:
        self.loader, self.name, self.lines, self.count = loader, name, lines, 0

    def value(self, node: Any, path: Path_) -> Any:
        self.count += 1
        if self.count > _MAX_NODES:
            raise ConfigError(f"{self.name}: more than {_MAX_NODES} values; aliases multiply them")
        self.lines.setdefault(path, node.start_mark.line + 1)
        if isinstance(node, yaml.SequenceNode):
            return [self.value(item, (*path, index)) for index, item in enumerate(node.value)]
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        return self._scalar(node)

    def _scalar(self, node: Any) -> Any:
        line = node.start_mark.line + 1
        if node.tag not in _SCALARS:
            raise ConfigError(f"{self.name}:{line}: tag '{node.tag}' is not allowed; only plain values are")
        try:
            return _integer(node.value) if node.tag.endswith(":int") else self.loader.construct_object(node)
        except (ValueError, KeyError) as error:
            kind = node.tag.rpartition(":")[2]
            raise ConfigError(
                f"{self.name}:{line}: '{printable(node.value, LONGEST_VALUE)}' is not a valid {kind}"
            ) from error

    def _mapping(self, node: Any, path: Path_) -> dict[Any, Any]:
        values: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                raise ConfigError(f"{self.name}:{line}: a key must be a single word or number")
            key = self._scalar(key_node)
            key = key_node.value if key is None or isinstance(key, bool | float) else key
            if key in values:
                raise ConfigError(f"{self.name}:{line}: key '{dotted((*path, key))}' is given twice")
            self.lines[(*path, key)] = line
            values[key] = self.value(value_node, (*path, key))
        return values
