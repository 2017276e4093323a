"""A configuration as a user gives it: the name of a shipped one, a file, or, from Python, a mapping."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from uwbbench.api.check import checked
from uwbbench.api.locate import Folder, find_config
from uwbbench.api.override import with_values
from uwbbench.api.yaml_file import YamlFile, read_yaml

M = TypeVar("M", bound=BaseModel)

Given = str | Path | Mapping[str, Any]
"""What a function that takes a configuration accepts."""


def read_given(folder: Folder, given: Given) -> tuple[Path, YamlFile]:
    """Configuration with the file that it stands for.

    Parameters
    ----------
    folder : {"detectors", "experiments", "suites", "scenes", "robots", "gates", "tuning", "training", "fits"}
        Kind of configuration.
    given : str, Path or mapping
        A mapping has the keys of the file; ``schema`` may be left out, as it is of this version. It is named after its
        kind where it has no ``name``, and paths in it start from the current folder.

    Raises
    ------
    ConfigError
        If there is no such file, or it is no YAML.
    """
    if isinstance(given, Mapping):
        kind = folder.removesuffix("s")
        return Path(kind), YamlFile(kind, {"schema": 1, **copy.deepcopy(dict(given))}, {})
    path = find_config(folder, str(given))
    return path, read_yaml(path)


def read_model(
    model: type[M], folder: Folder, given: Given, changes: Mapping[str, Any] | None
) -> tuple[Path, YamlFile, M]:
    """Configuration with the file that it stands for, checked.

    Parameters
    ----------
    model : type of pydantic model
        What the file must hold.
    folder, given
        As in :func:`read_given`.
    changes : mapping or None
        Values to change, by path, before checking.

    Raises
    ------
    ConfigError
        If there is no such file, or it is wrong; the message names file, line and key.
    """
    path, source = read_given(folder, given)
    data = with_values(source.data, changes, "--set") if changes else source.data
    return path, source, checked(model, data, source)
