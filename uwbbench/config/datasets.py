"""Datasets as experiments, gates and tunings name them, and the captures that are chosen from them."""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import Field

from uwbbench.api import registry
from uwbbench.api.errors import CaptureError, ConfigError, nearest
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.extends import placed
from uwbbench.config.model import ConfigModel
from uwbbench.config.source import CaptureRef, open_dataset


class DatasetUse(ConfigModel):
    """Captures of one dataset."""

    use: str = Field(description="Registered name of the dataset.")
    name: str | None = Field(default=None, min_length=1, description="Name in tables and reports.")
    params: dict[str, Any] = Field(default_factory=dict, description="Parameters of the dataset.")
    captures: list[str] | None = Field(
        default=None, min_length=1, description="Names, or patterns such as 'ch9-*'; all if left out."
    )


@dataclass(frozen=True)
class DatasetSource:
    """One dataset of a file.

    Attributes
    ----------
    label : str
        Its name in tables: the given one, or the adapter's, with a number where several entries use the same.
    use : str
    params : dict
        Parameters as written.
    captures : tuple of str or None
        Patterns of the names to take; None for all.
    roots : tuple of str
        Folders to search.
    """

    label: str
    use: str
    params: dict[str, Any] = field(default_factory=dict)
    captures: tuple[str, ...] | None = None
    roots: tuple[str, ...] = ()

    def references(self) -> list[CaptureRef]:
        """References to the chosen captures.

        Raises
        ------
        CaptureError
            If the dataset has no captures, or a pattern fits none of them.
        """
        names = open_dataset(self.use, self.params, [Path(root) for root in self.roots]).names()
        if not names:
            raise CaptureError(f"dataset '{self.label}' holds no captures")
        for pattern in self.captures or ():
            if not any(_fits(name, (pattern,)) for name in names):
                raise CaptureError(f"dataset '{self.label}' has no capture '{pattern}'.{nearest(pattern, names)}")
        chosen = [name for name in names if self.captures is None or _fits(name, self.captures)]
        return [CaptureRef(self.use, self.params, self.roots, name) for name in chosen]


def _fits(name: str, patterns: tuple[str, ...]) -> bool:
    return any(name == pattern or fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def dataset_sources(
    uses: Sequence[DatasetUse], source: YamlFile, roots: list[str], key: str = "datasets"
) -> tuple[DatasetSource, ...]:
    """Checked datasets of a file, with distinct labels.

    Parameters
    ----------
    uses : sequence of DatasetUse
        As they stand under ``key``.
    source : YamlFile
        The file, for messages.
    roots : list of str
        Folders to search.
    key : str
        Key of the file.

    Raises
    ------
    ConfigError, PluginError
        If an adapter is unknown, a parameter wrong, or a label given twice.
    """
    sources: list[DatasetSource] = []
    for index, item in enumerate(uses):
        at = (key, index)
        with placed(source, (*at, "use")):
            registry.load_plugin("datasets", item.use)
        open_dataset(item.use, item.params, [Path(root) for root in roots], source, (*at, "params"))
        same = sum(other.use == item.use for other in sources)
        label = item.name or (f"{item.use} {same + 1}" if same else item.use)
        if label in {other.label for other in sources}:
            raise ConfigError(f"{source.place(at)}: dataset '{label}' appears twice; give one of them another 'name'")
        patterns = None if item.captures is None else tuple(item.captures)
        sources.append(DatasetSource(label, item.use, item.params, patterns, tuple(roots)))
    return tuple(sources)
