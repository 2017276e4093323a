"""Files that change other files, and mistakes named by their place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from uwbbench.api.errors import ConfigError, PluginError, UwbbenchError
from uwbbench.api.locate import Folder, find_config
from uwbbench.api.override import merged, with_values
from uwbbench.api.yaml_file import Path_, YamlFile, read_yaml

Anchor = Callable[[dict[str, Any], Path], dict[str, Any]]
"""Makes the paths in values of a file absolute, as seen from the file's folder."""


@contextmanager
def placed(source: YamlFile, at: Path_) -> Iterator[None]:
    """Name the place ``at`` in a file for whatever is found wrong inside, unless that names a place in it already."""
    try:
        yield
    except UwbbenchError as error:
        text = str(error).removeprefix("--set: ")
        kind = PluginError if isinstance(error, PluginError) else ConfigError
        raise (error if text.startswith(source.name) else kind(f"{source.place(at)}: {text}")) from None


def extended(
    source: YamlFile,
    folder: Folder,
    path: Path | None = None,
    anchor: Anchor = lambda values, _: values,
    seen: tuple[Path, ...] = (),
) -> dict[str, Any]:
    """Values of a file on top of those of the file that it extends, if it does.

    Parameters
    ----------
    source : YamlFile
    folder : {"detectors", "experiments"}
        Kind of file.
    path : Path, optional
        Where the file lies; text that is no file has none.
    anchor : callable
        Makes the paths of an extended file absolute.
    seen : tuple of Path
        Files that extend this one.

    Raises
    ------
    ConfigError
        If there is no file to extend, files extend each other in a circle, or a value of ``set`` leads nowhere; the
        message names file, line and key.
    """
    data = dict(source.data)
    parent = data.pop("extends", None)
    if parent is None:
        return data
    kind = folder.removesuffix("s")
    if not isinstance(parent, str):
        a = "an" if kind[0] in "aeiou" else "a"
        raise ConfigError(f"{source.place(('extends',))}: expected the name or path of {a} {kind}, found {parent!r}")
    with placed(source, ("extends",)):
        file = find_config(folder, parent, path and path.parent)
    seen = (*seen, path.resolve()) if path else seen
    if file.resolve() in seen:
        raise ConfigError(f"{source.place(('extends',))}: {folder} extend each other in a circle")
    changes = data.pop("set", None) or {}
    if not isinstance(changes, dict):
        raise ConfigError(f"{source.place(('set',))}: expected values by path")
    base = anchor(extended(read_yaml(file), folder, file, anchor, seen), file.parent)
    return merged(with_values(base, changes, source.place(("set",))), data)
