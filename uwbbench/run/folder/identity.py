"""What results are called and what they depend on, for whoever writes a run folder and whoever verifies it.

Conventions
-----------
* Everything is known by its content: SHA-256 of canonical JSON, never a repr or a file name.
* The *name* of a unit, and of its files, follows from what it is about: the same in every run of the same experiment.
* The *identity* of a unit follows from all that its result depends on: a resumed run repeats what has another one, and
  a stored unit whose identity does not follow from its manifest was made otherwise than the manifest says. The identity
  of a detector is :func:`uwbbench.config.detector.detector_identity`.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from uwbbench.measure.accuracy.scoring import ScoringRules


_PLAIN = frozenset({str, int, bool, type(None)})


def plain(value: Any) -> Any:
    """Value made of JSON's types only.

    Keys become text, tuples and arrays lists, NumPy scalars Python's. NaN and infinities, which JSON lacks, become
    null: a number that is undefined.
    """
    kind = type(value)
    if kind is float:  # most values of a report are plain already
        return value if math.isfinite(value) else None
    if kind in _PLAIN:
        return value
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def canonical(value: Any) -> str:
    """JSON text that is equal for equal content: sorted keys, no spaces, ASCII only."""
    return json.dumps(plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest(value: Any) -> str:
    """SHA-256 of the canonical JSON of a value, in hexadecimal.

    Examples
    --------
    >>> digest({"b": 1, "a": (2.5, None)}) == digest({"a": [2.5, None], "b": 1})
    True
    """
    return hashlib.sha256(canonical(value).encode()).hexdigest()


def file_id(value: Any) -> str:
    """File name, without suffix, for results about ``value``: safe whatever names it holds."""
    return digest(value)[:20]


def suite_version(captures: Mapping[tuple[str, str], str], rules: Any) -> str:
    """Version of a suite: what is measured on the same captures under the same rules.

    Parameters
    ----------
    captures : mapping
        Content of each capture by dataset and name; empty where nobody could open it.
    rules : object
        Scoring rules as plain values.
    """
    return digest([sorted([*key, content] for key, content in captures.items()), rules])


def capture_name(dataset: str, params: Mapping[str, Any], capture: str, run: Sequence[str] = ()) -> str:
    """Name of the files of a capture, or of a run.

    Parameters
    ----------
    dataset : str
        Registered name of the dataset.
    params : mapping
        Its parameters as written.
    capture : str
        Name of the capture, or of the run, in the dataset.
    run : sequence of str
        Captures of the run.
    """
    several = {} if tuple(run) in ((), (capture,)) else {"run": list(run)}
    return file_id([dataset, {**params, **several}, capture])


def listing_name(dataset: str) -> str:
    """Name of a unit that stands for the captures of a dataset, by its label."""
    return file_id(["listing", dataset])


def stability_name(detector: str) -> str:
    """Name of the unit of a detector's hard cases."""
    return file_id(["stability", detector])


def unit_name(kind: str, detector: str, dataset: str, capture: str) -> str:
    """Name of the unit, and of the files, of a detector on a capture.

    Parameters
    ----------
    kind : {"accuracy", "latency"}
    detector : str
        Name of the detector.
    dataset : str
        Label of the dataset.
    capture : str
        Name of the capture's files.
    """
    return file_id([kind, detector, dataset, capture])


def accuracy_identity(detector: str, sha256: str, rules: Sequence[ScoringRules]) -> str:
    """Identity of scores.

    Parameters
    ----------
    detector : str
        Identity of the detector.
    sha256 : str
        Of the capture's content.
    rules : sequence of ScoringRules
    """
    return digest(["accuracy", detector, sha256, [_facts_of(rule) for rule in rules]])


def _facts_of(rule: ScoringRules) -> dict[str, Any]:
    """Rules as plain values, without a choice that earlier versions lacked where it is what they did."""
    facts = rule.to_dict()
    return facts if facts.pop("surface") == "outline" else rule.to_dict()


def latency_identity(detector: str, sha256: str, settings: Mapping[str, Any], machine: Mapping[str, Any]) -> str:
    """Identity of times, which depend on the machine.

    Parameters
    ----------
    detector : str
        Identity of the detector.
    sha256 : str
        Of the capture's content; empty where it could not be opened for its scores.
    settings : mapping
        How calls are timed, as the manifest holds it.
    machine : mapping
        The machine, as a session of the manifest holds it.
    """
    return digest(["latency", detector, sha256, [settings, machine]])


def stability_identity(detector: str, version: str, case_packages: Sequence[str] = ()) -> str:
    """Identity of what the hard cases gave.

    Parameters
    ----------
    detector : str
        Identity of the detector.
    version : str
        Version of uwbbench, which has most of the cases.
    case_packages : sequence of str
        Names and versions of other packages that bring cases.

    Returns
    -------
    str
    """
    return digest(["stability", detector, version, *case_packages])
