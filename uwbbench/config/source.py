"""Captures as a configuration names them: a dataset, its parameters, and a name inside it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uwbbench.api import registry
from uwbbench.api.capture import Capture
from uwbbench.api.check import checked
from uwbbench.api.dataset import Dataset
from uwbbench.api.drive import Drive
from uwbbench.api.yaml_file import Path_, YamlFile


def data_roots(data_dir: Path | None = None, config_file: Path | None = None) -> tuple[Path, ...]:
    """Folders in which datasets are searched.

    In this order: ``--data-dir``, the environment's ``UWBBENCH_DATA``, the folder of the configuration file, the
    current folder, and the cache that ``uwbbench fetch`` fills.
    """
    named = os.environ.get("UWBBENCH_DATA")
    folders = [
        data_dir,
        Path(named) if named else None,
        config_file.parent if config_file else None,
        Path(),
        cache_folder(),
    ]
    return tuple(dict.fromkeys(folder.resolve() for folder in folders if folder is not None))


def cache_folder() -> Path:
    """Folder of downloaded datasets: ``UWBBENCH_CACHE``, or ``uwbbench`` in the user's cache folder."""
    named = os.environ.get("UWBBENCH_CACHE")
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "uwbbench"


def open_dataset(
    use: str,
    params: Mapping[str, Any],
    roots: Sequence[Path],
    source: YamlFile | None = None,
    at: Path_ = (),
) -> Dataset[Any]:
    """Dataset adapter with checked parameters.

    Parameters
    ----------
    use : str
        Registered name of the adapter.
    params : mapping
        Its parameters as written.
    roots : sequence of Path
        Folders to search for its files.
    source : YamlFile, optional
        The file that names the dataset, for messages.
    at : tuple of str and int
        Keys and indices that lead to ``params`` in that file.

    Raises
    ------
    PluginError, ConfigError
        If the adapter is unknown or a parameter wrong; messages name ``source`` and the place in it.
    """
    adapter = registry.load_plugin("datasets", use)
    place = source or YamlFile(f"dataset '{use}'", dict(params), {})
    dataset: Dataset[Any] = adapter(checked(adapter.params_type(), dict(params), place, at), roots)
    return dataset


@dataclass(frozen=True)
class CaptureRef:
    """A capture that can be opened here or in another process.

    Attributes
    ----------
    dataset : str
        Name of the adapter.
    params : dict
        Its parameters as written.
    roots : tuple of str
        Folders to search.
    name : str
        Name of the capture in the dataset.
    secret : dict
        Parameters that are put over the written ones when the capture is opened, and are stored nowhere.
    """

    dataset: str
    params: dict[str, Any]
    roots: tuple[str, ...]
    name: str
    secret: dict[str, Any] = field(default_factory=dict, repr=False)

    def open(self) -> Capture:
        """Open the capture.

        Raises
        ------
        CaptureError
            If its files are missing or broken.
        """
        params = {**self.params, **self.secret}
        return open_dataset(self.dataset, params, [Path(root) for root in self.roots]).open(self.name)

    @classmethod
    def of_file(cls, path: Path, receiver: str | None = None) -> CaptureRef:
        """Reference to a capture file."""
        absolute = path.resolve()
        params = {"files": [str(absolute)], **({"receiver": receiver} if receiver else {})}
        name = absolute.stem if receiver is None else f"{absolute.stem}/{receiver}"
        return cls(registry.default("dataset.files"), params, (str(absolute.parent),), name)


@dataclass(frozen=True)
class RunRef:
    """Captures of a run that can be opened together, here or in another process.

    Attributes
    ----------
    dataset, params, roots, secret
        As of a :class:`CaptureRef`.
    name : str
        Name of the run in the dataset.
    captures : tuple of str
        Names of its captures that are taken.
    """

    dataset: str
    params: dict[str, Any]
    roots: tuple[str, ...]
    name: str
    captures: tuple[str, ...]
    secret: dict[str, Any] = field(default_factory=dict, repr=False)

    def open(self) -> Drive:
        """Open the captures, merged by time.

        Raises
        ------
        CaptureError
            If files are missing or broken, or the captures do not fit together.
        """
        params = {**self.params, **self.secret}
        dataset = open_dataset(self.dataset, params, [Path(root) for root in self.roots])
        return dataset.open_run(self.name, self.captures)
