"""A configuration as a user gives it: the name of a shipped one, a file, or, from Python, a mapping."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uwbbench.api.locate import Folder, find_config
from uwbbench.api.yaml_file import YamlFile, read_yaml

Given = str | Path | Mapping[str, Any]
"""What a function that takes a configuration accepts."""


def read_given(folder: Folder, given: Given) -> tuple[Path, YamlFile]:
    """Configuration with the file that it stands for.

    Parameters
    ----------
    folder : {"detectors", "experiments", "scenes", "gates", "tuning"}
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
