"""Weights as detector files name them: found from anywhere, and bound to their content."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError, PluginError
from uwbbench.api.learning import PINNED, LearnedParams
from uwbbench.api.weights import SUFFIX

KEY = "weights"


def anchored_weights(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Values of a detector file whose weights are found from anywhere, and known by the hash of their content.

    Parameters
    ----------
    values : mapping
        As parsed; relative paths of weights start from ``folder``.
    folder : Path

    Raises
    ------
    ConfigError
        If a path leads out of the folder, or cannot be read. One at which there is no file yet stays as it is.
    """
    return _changed(values, lambda text: _anchored(text, folder))


def portable_weights(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of a detector whose weights are named without the folders of this machine."""
    return _changed(values, _portable)


def _changed(values: Mapping[str, Any], change: Callable[[str], str]) -> dict[str, Any]:
    """Values with each reference to weights changed, those that hang on the channel included."""
    steps = values.get("pipeline")
    return {**values, "pipeline": [_step(item, change) for item in steps]} if isinstance(steps, list) else {**values}


def _step(item: Any, change: Callable[[str], str]) -> Any:
    params = item.get("params") if isinstance(item, dict) else None
    if not isinstance(params, dict) or KEY not in params or not _learns(item.get("use")):
        return item
    given = params[KEY]
    if isinstance(given, dict):
        tables = {key: table for key, table in given.items() if isinstance(table, dict)}
        new: Any = {**given, **{key: {c: _one(v, change) for c, v in table.items()} for key, table in tables.items()}}
    else:
        new = _one(given, change)
    return {**item, "params": {**params, KEY: new}}


def _one(value: Any, change: Callable[[str], str]) -> Any:
    return change(value) if isinstance(value, str) else value


def _learns(use: Any) -> bool:
    with suppress(PluginError):  # whoever checks the file says what is wrong with it
        return isinstance(use, str) and issubclass(registry.load_plugin("stages", use).params_type(), LearnedParams)
    return False


def _anchored(text: str, folder: Path) -> str:
    if PINNED.fullmatch(text) or not text.endswith(SUFFIX):
        return text
    if Path(text).is_absolute() or ".." in Path(text).parts:
        raise ConfigError(
            f"weights '{text}' must lie beside the file that names them, or below it; or add '@' and their hash"
        )
    path = (folder / text).resolve()
    if not path.is_file():
        return text
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: weights cannot be read: {error.strerror or error}") from None
    return f"{path}@{hashlib.sha256(content).hexdigest()}"


def _portable(text: str) -> str:
    pinned = PINNED.fullmatch(text)
    if pinned is None or not pinned["name"].endswith(SUFFIX):
        return text
    return f"{Path(pinned['name']).stem}@{pinned['sha256']}"
