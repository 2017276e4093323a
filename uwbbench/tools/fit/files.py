"""Scenes of a fit, and their robot, with values changed: written side by side, as the dataset of scenes opens them.

A scene and its robot lie in one folder, as scenes may name no file elsewhere; other files that a scene names, such as
recorded poses, are copied to it. What a search tries and what a fit leaves behind is written in the same way.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError
from uwbbench.api.override import with_values
from uwbbench.api.yaml_file import read_yaml
from uwbbench.config.source import open_dataset
from uwbbench.run.folder.files import disk_errors, write_text

if TYPE_CHECKING:
    from uwbbench.api.dataset import Dataset
    from uwbbench.tools.fit.config import Cell

ROBOT = "robot"
"""Name of the robot's file among those of a fit, and key of a scene that names its robot."""

Files = Mapping[str, Path]
"""Scenes by the names that cells use; under :data:`ROBOT` the robot of all of them, if it is fitted too."""

Changes = dict[str, dict[str, Any]]
"""Changed values by file and path."""


def write_changed(
    files: Files, changes: Changes, folder: Path, header: Callable[[str], str] = lambda _: ""
) -> dict[str, Path]:
    """Write files with values changed.

    Parameters
    ----------
    files : mapping of str to Path
    changes : Changes
    folder : Path
        Where they are written, under their own names.
    header : callable
        Comment that a file begins with, by its name among them.

    Returns
    -------
    dict of str to Path
        The written files.

    Raises
    ------
    ConfigError
        If a path leads nowhere.
    StoreError
        If a file cannot be written.
    """
    written = {name: folder / path.name for name, path in files.items()}
    for name, path in files.items():
        data = with_values(read_yaml(path).data, changes.get(name, {}), str(path))
        if name != ROBOT:
            _copy_named(data, path.parent, folder)
            if ROBOT in files:
                data[ROBOT] = written[ROBOT].name
        write_text(written[name], header(name) + as_yaml(data))
    return written


def _copy_named(value: Any, source: Path, folder: Path) -> None:
    """Copy the files beside a scene that its values name."""
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            _copy_named(item, source, folder)
    elif isinstance(value, str) and Path(value).suffix and (source / value).is_file():
        with disk_errors(folder / value, "written"):
            (folder / value).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / value, folder / value)


def as_yaml(values: Mapping[str, Any]) -> str:
    """Values of a file as YAML, in their order."""
    import yaml

    text: str = yaml.safe_dump(dict(values), sort_keys=False, allow_unicode=True, width=116, default_flow_style=None)
    return text


@contextmanager
def changed(files: Files, changes: Changes) -> Iterator[dict[str, Path]]:
    """Files with values changed, for as long as it is open."""
    with TemporaryDirectory(prefix="uwbbench-fit-") as folder:
        yield write_changed(files, changes, Path(folder))


def open_cell(files: Files, cell: Cell, seed: int, runs: int) -> Dataset[Any]:
    """Dataset of the draws of a cell.

    Parameters
    ----------
    files : mapping of str to Path
    cell : Cell
    seed : int
        Of all random draws of the scene.
    runs : int

    Raises
    ------
    ConfigError
        If the scene is wrong, or is still several.
    """
    path = files[cell.scene]
    params = {"scenes": [str(path)], "set": {**cell.set, "seed": seed}, "runs": runs}
    dataset: Dataset[Any] = open_dataset(registry.default("dataset.scenes"), params, [path.parent])
    several = len(dataset.runs()) // runs
    if several != 1:
        raise ConfigError(f"cell '{cell.name}': its scene varies into {several}; fix what 'vary' lists by 'set'")
    return dataset
