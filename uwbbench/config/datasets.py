"""Datasets as experiments, gates and tunings name them, and the captures that are chosen from them."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, field_validator

from uwbbench.api import registry
from uwbbench.api.errors import CaptureError, ConfigError, nearest
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.extends import placed
from uwbbench.config.model import ConfigModel
from uwbbench.config.rules import RegionModel
from uwbbench.config.source import CaptureRef, RunRef, open_dataset


class DatasetUse(ConfigModel):
    """Captures of one dataset."""

    use: str = Field(description="Registered name of the dataset.")
    name: str | None = Field(default=None, min_length=1, description="Name in tables and reports.")
    params: dict[str, Any] = Field(default_factory=dict, description="Parameters of the dataset.")
    captures: list[str] | None = Field(
        default=None, min_length=1, description="Names, or patterns such as 'ch9-*'; all if left out."
    )
    repeats: str | list[Annotated[list[str], Field(min_length=1)]] | None = Field(
        default=None,
        description=(
            "Which captures repeat a scene: a regular expression of the part of their names by which repeats differ, "
            "such as '-run[0-9]+$', or lists of names or patterns; [] if none does; as the dataset says if left out."
        ),
    )

    @field_validator("repeats")
    @classmethod
    def _compiles(cls, value: str | list[list[str]] | None) -> str | list[list[str]] | None:
        if isinstance(value, str):
            try:
                re.compile(value)
            except re.error as error:
                raise ValueError(f"is no regular expression: {error}") from None
        return value


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
    repeats : str, tuple of tuples of str, or None
        Part of names by which repeats of a scene differ, or lists of captures that repeat one another; None where the
        dataset says it.
    at_most : int or None
        Captures to take, spread evenly over those that are chosen; None for all.
    optional : bool
        Whether it may be left out where its files are not there.
    timed : bool
        Whether detectors are timed on it.
    secret : dict
        Parameters that are put over the written ones when a capture is opened, and are stored nowhere.
    region : RegionModel or None
        Where its captures are scored; None for the region of all.
    gate_m : float or None
        Largest error of a true detection on them; None for that of all.
    scoring : tuple of str
        How they are scored; empty for all scorings.
    detectors : tuple of str
        Names of the detectors that run on them; empty for all.
    """

    label: str
    use: str
    params: dict[str, Any] = field(default_factory=dict)
    captures: tuple[str, ...] | None = None
    roots: tuple[str, ...] = ()
    repeats: str | tuple[tuple[str, ...], ...] | None = None
    at_most: int | None = None
    optional: bool = False
    timed: bool = True
    secret: dict[str, Any] = field(default_factory=dict, repr=False)
    region: RegionModel | None = None
    gate_m: float | None = None
    scoring: tuple[str, ...] = ()
    detectors: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """As plain values, without the folders of this machine and without what is secret."""
        about: dict[str, Any] = {"label": self.label, "use": self.use, "params": self.params, "captures": self.captures}
        about |= {} if self.repeats is None else {"repeats": self.repeats}
        about |= {} if self.at_most is None else {"at_most": self.at_most}
        about |= {"optional": True} if self.optional else {}
        about |= {} if self.timed else {"latency": False}
        about |= {} if self.gate_m is None else {"gate_m": self.gate_m}
        about |= {"scoring": self.scoring} if self.scoring else {}
        about |= {"detectors": self.detectors} if self.detectors else {}
        return about if self.region is None else {**about, "region": self.region.model_dump()}

    def scenes(self, names: Sequence[str]) -> dict[str, str]:
        """Scene or set-up of each chosen capture, by name: captures of one scene repeat one another.

        Raises
        ------
        CaptureError
            If ``repeats`` fits no capture.
        """
        if self.repeats is None:
            dataset = open_dataset(self.use, self.params, [Path(root) for root in self.roots])
            return {name: str(dataset.scene(name)) for name in names}
        if isinstance(self.repeats, str):
            part = re.compile(self.repeats)
            if not any(part.search(name) for name in names):
                raise CaptureError(f"dataset '{self.label}': 'repeats: {self.repeats}' fits no capture name")
            return {name: part.sub("", name) for name in names}
        scenes = {name: name for name in names}
        for group in self.repeats:
            for pattern in group:
                if not any(_fits(name, (pattern,)) for name in names):
                    raise CaptureError(
                        f"dataset '{self.label}': 'repeats' names no capture '{pattern}'.{nearest(pattern, names)}"
                    )
            members = [name for name in names if _fits(name, group)]
            scenes.update(dict.fromkeys(members, members[0]))
        return scenes

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
        if self.at_most is not None and self.at_most < len(chosen):
            chosen = [chosen[place * len(chosen) // self.at_most] for place in range(self.at_most)]
        return [CaptureRef(self.use, self.params, self.roots, name, self.secret) for name in chosen]

    def runs(self) -> list[RunRef]:
        """References to the runs that chosen captures belong to, each with those of its captures that are chosen.

        Raises
        ------
        CaptureError
            As :meth:`references`.
        """
        chosen = {ref.name for ref in self.references()}
        dataset = open_dataset(self.use, self.params, [Path(root) for root in self.roots])
        runs = {name: tuple(c for c in captures if c in chosen) for name, captures in dataset.runs().items()}
        return [
            RunRef(self.use, self.params, self.roots, name, captures, self.secret)
            for name, captures in runs.items()
            if captures
        ]


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
        repeats = tuple(map(tuple, item.repeats)) if isinstance(item.repeats, list) else item.repeats
        sources.append(DatasetSource(label, item.use, item.params, patterns, tuple(roots), repeats))
    return tuple(sources)
