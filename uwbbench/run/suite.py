"""Suites: experiments whose captures and rules are frozen, so that everybody's results under their name compare.

Conventions
-----------
* A suite is an experiment with a file ``NAME.lock.json`` beside it: the hash of each capture, and the suite's version,
  which is the hash of these and of the scoring rules. Captures of optional datasets are not in it.
* A capture is the suite's if it has the same content by its hash. On another processor the last bits may differ; then
  it must agree in its sketch: length and one fixed projection of its samples, and of its poses and outlines.
* A private half has the same scenes and rules, drawn from secret seeds: it belongs to a version, and its captures are
  not in the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.capture import PER_FRAME, Capture
from uwbbench.api.errors import ConfigError, nearest
from uwbbench.run.folder.files import read_json, write_json
from uwbbench.run.folder.identity import suite_version

SUFFIX = ".lock.json"
TOLERANCE = 1e-7
"""Of a sketch, relative to the length. Processors differ by 6e-10; one bit of 16 in one sample by more than this."""


class ChangedCapture(ConfigError):
    """A capture is not the one that the suite was frozen with."""


@dataclass(frozen=True)
class Mark:
    """What a capture of a suite is known by.

    Attributes
    ----------
    sha256 : str
        Of its content.
    sketch : tuple of float
        Of its samples, and of its poses and outlines: length and projection.
    """

    sha256: str
    sketch: tuple[float, ...]

    @classmethod
    def of(cls, capture: Capture) -> Mark:
        """Mark of a capture."""
        samples = [capture.preamble, capture.sts1, capture.sts2]
        objects = () if capture.truth is None else capture.truth.objects
        track = capture.trajectory
        places = [track.timestamp_s, track.position_m, track.yaw_rad, *(one.outline_m for one in objects)]
        places += [getattr(capture, name) for name in PER_FRAME]
        return cls(capture.sha256, (*_sketch(samples), *_sketch(places)))

    def fits(self, capture: Capture) -> bool:
        """Whether a capture is the marked one, give or take the last bits."""
        if capture.sha256 == self.sha256:
            return True
        mine, its = np.array(self.sketch), np.array(Mark.of(capture).sketch)
        scale = np.repeat(np.maximum(mine[::2], 1e-300), 2)
        return mine.shape == its.shape and bool(np.all(np.abs(mine - its) <= TOLERANCE * scale))


def _sketch(arrays: Iterable[Any]) -> tuple[float, float]:
    """Length of some arrays as one vector, and its projection on a fixed one of unit length a component."""
    parts = [np.ascontiguousarray(array).ravel() for array in arrays if array is not None]
    numbers = [part.view(part.real.dtype).astype(np.float64) for part in parts]
    values = np.nan_to_num(np.concatenate([np.zeros(0), *numbers]), nan=0.0, posinf=0.0, neginf=0.0)
    turned = np.sqrt(2) * np.cos(np.arange(len(values)))
    return float(np.linalg.norm(values)), float(values @ turned)


@dataclass(frozen=True)
class Frozen:
    """What a suite's lock file holds.

    Attributes
    ----------
    path : Path
    name, version : str
    captures : mapping
        Mark of each capture by dataset and name.
    """

    path: Path
    name: str
    version: str
    captures: Mapping[str, Mapping[str, Mark]]

    def only(self, dataset: str, name: str) -> Frozen | None:
        """The same with one capture, for the process that opens it; None where the capture is not frozen."""
        mark = self.captures.get(dataset, {}).get(name)
        return None if mark is None else replace(self, captures={dataset: {name: mark}})

    def check(self, dataset: str, name: str, capture: Capture) -> None:
        """Refuse a capture that is not the suite's.

        Parameters
        ----------
        dataset, name : str
            What it is called.
        capture : Capture
            As it was opened.

        Raises
        ------
        ChangedCapture
            Naming it.
        """
        mark = self.captures[dataset][name]
        if not mark.fits(capture):
            raise ChangedCapture(
                f"{self._place}: capture '{name}' of dataset '{dataset}' was changed: its content is "
                f"{capture.sha256[:12]}, that of the suite {mark.sha256[:12]}. {_NEW_VERSION}"
            )

    def check_names(self, dataset: str, names: Iterable[str], *, all_of_them: bool) -> None:
        """Refuse a dataset that has other captures than the suite's.

        Parameters
        ----------
        dataset : str
            Label.
        names : iterable of str
            Its captures now.
        all_of_them : bool
            Whether every capture of the suite must be among them.

        Raises
        ------
        ChangedCapture
            Naming the first capture that is new or missing.
        """
        known, given = self.captures.get(dataset, {}), list(names)
        for name in given:
            if name not in known:
                raise ChangedCapture(
                    f"{self._place}: dataset '{dataset}' has a capture '{name}', which the suite has not. "
                    f"{_NEW_VERSION}"
                )
        missing = [name for name in known if name not in given] if all_of_them else []
        if missing:
            raise ChangedCapture(
                f"{self._place}: capture '{missing[0]}' of dataset '{dataset}' is no longer there. {_NEW_VERSION}"
            )

    def check_rules(self, labels: Iterable[str], rules: Any) -> None:
        """Refuse other datasets or scoring rules than the suite's.

        Parameters
        ----------
        labels : iterable of str
            Datasets that are not optional.
        rules : object
            Scoring rules as plain values.

        Raises
        ------
        ConfigError
        """
        here = list(labels)
        for label in {*here} ^ {*self.captures}:
            said = "is not in the suite" if label in here else "of the suite is missing"
            raise ConfigError(f"{self._place}: dataset '{label}' {said}.{nearest(label, self.captures)} {_OWN_NAME}")
        if self.version_of(rules) != self.version:
            raise ConfigError(f"{self._place}: the scoring rules are not the suite's. {_OWN_NAME}")

    def version_of(self, rules: Any) -> str:
        """Version that the captures would have under some rules."""
        contents = {(label, name): sha for label, of in self.contents().items() for name, sha in of.items()}
        return suite_version(contents, rules)

    def contents(self) -> dict[str, dict[str, str]]:
        """Hash of each capture by dataset and name: what the version is made of."""
        return {label: {name: mark.sha256 for name, mark in marks.items()} for label, marks in self.captures.items()}

    @property
    def _place(self) -> str:
        return f"{self.path}: suite '{self.name}', version {self.version[:12]}"

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for the file."""
        captures = {
            label: {name: asdict(mark) for name, mark in marks.items()} for label, marks in self.captures.items()
        }
        return {"suite": self.name, "version": self.version, "captures": captures}

    def write(self) -> None:
        """Write the file."""
        write_json(self.path, self.to_dict())


_NEW_VERSION = "If that is meant, 'uwbbench freeze' makes it another version, whose results are compared anew."
_OWN_NAME = "An experiment of your own, with 'extends' and a name of its own, may have others."


def lock_of(experiment: Path) -> Path:
    """Where the lock file of an experiment's file lies."""
    return experiment.with_name(f"{experiment.stem}{SUFFIX}")


def read_frozen(experiment: Path) -> Frozen | None:
    """What an experiment's file was frozen with; None where it is no suite.

    Raises
    ------
    StoreError
        If the lock file cannot be read.
    ConfigError
        If it holds something else.
    """
    path = lock_of(experiment)
    if not path.is_file():
        return None
    data = read_json(path)
    try:
        captures = {
            str(label): {str(name): Mark(str(m["sha256"]), tuple(map(float, m["sketch"]))) for name, m in marks.items()}
            for label, marks in data["captures"].items()
        }
        return Frozen(path, str(data["suite"]), str(data["version"]), captures)
    except (KeyError, TypeError, ValueError, AttributeError):
        raise ConfigError(
            f"{path}: is no lock file of a suite; remove it: 'uwbbench freeze {experiment}' writes one"
        ) from None


@dataclass(frozen=True)
class SuitePart:
    """Which part of a suite a run is of.

    Attributes
    ----------
    version : str
        Of the frozen suite; empty where the experiment is not frozen.
    quick : bool
        Whether only some of the captures were taken.
    seeds : str
        Hash of the secret seeds; empty for the public half.
    """

    version: str = ""
    quick: bool = False
    seeds: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self)


WHOLE = SuitePart()
"""All of an experiment that is not frozen."""
