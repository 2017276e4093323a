"""What changed in what went into two runs: configuration, code, data and machine.

Conventions
-----------
* Detectors are matched by name, datasets by label, steps of a detector by label, captures by dataset and name.
* A detector whose identity changed while its configuration did not has other sources; the stages are named where both
  runs noted the hashes of their sources.
* Versions and machine are those of the last session of each run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.identity import canonical, plain

Kind = Literal["configuration", "code", "data", "machine"]
KEYS = {"detectors": "name", "datasets": "label", "pipeline": "as"}
"""Lists of the configuration whose items have names, and the key that holds the name."""


@dataclass(frozen=True)
class Change:
    """One difference in what went into two runs.

    Attributes
    ----------
    kind : {"configuration", "code", "data", "machine"}
    where : str
    before, after : object
        Plain values; None where there is none.
    """

    kind: Kind
    where: str
    before: Any
    after: Any


def changes(first: RunFolder, second: RunFolder) -> list[Change]:
    """All that differs between what went into two runs, the configuration first."""
    parts = (_configuration, _code, _data, _machine)
    return [change for part in parts for change in part(first, second)]


def _configuration(first: RunFolder, second: RunFolder) -> Iterator[Change]:
    yield from _nested("", first.manifest["experiment"], second.manifest["experiment"])
    rules = [[plain(rule.to_dict()) for rule in folder.rules] for folder in (first, second)]
    yield from _differing("configuration", {"rules of the scores": rules[0]}, {"rules of the scores": rules[1]})


def _nested(path: str, before: Any, after: Any) -> Iterator[Change]:
    """Differences of a configuration by their path; of what only one side has, the name alone."""
    if not (isinstance(before, dict) and isinstance(after, dict)):
        yield from _differing("configuration", {path: before}, {path: after})
        return
    for key in dict.fromkeys([*before, *after]):
        at, old, new = f"{path}.{key}".lstrip("."), before.get(key), after.get(key)
        name = KEYS.get(key)
        if name is None or not (isinstance(old, list) and isinstance(new, list)):
            yield from _nested(at, old, new)
            continue
        sides = [{item[name]: item for item in items} for items in (old, new)]
        yield from _differing("configuration", *({f"{at}, in order": list(side)} for side in sides))
        for label in sides[0]:
            if label in sides[1]:
                yield from _nested(f"{at}.{label}", sides[0][label], sides[1][label])


def _code(first: RunFolder, second: RunFolder) -> Iterator[Change]:
    sides = [folder.manifest for folder in (first, second)]
    for what, name in (("detectors", "identity of detector"), ("sources", "sources of")):
        yield from _shared("code", name, *(side.get(what) or {} for side in sides))
    references = [{"identity of the reference of times": side.get("reference")} for side in sides]
    yield from _differing("code", *references)
    yield from _differing(
        "code", *({f"version of {k}": v for k, v in _last(side)["versions"].items()} for side in sides)
    )


def _data(first: RunFolder, second: RunFolder) -> Iterator[Change]:
    contents = []
    for folder in (first, second):
        data = folder.manifest.get("data") or {}
        units = [entry for entry in folder.entries() if entry.kind == "accuracy"]
        known = {(e.dataset, e.capture): data[e.capture_id] for e in units if e.capture_id in data}
        contents.append({f"{e.dataset}, {e.capture}": known.get((e.dataset, e.capture), "not opened") for e in units})
    yield from _differing("data", *contents)


def _machine(first: RunFolder, second: RunFolder) -> Iterator[Change]:
    yield from _differing("machine", *(_last(folder.manifest)["machine"] for folder in (first, second)))


def _last(manifest: Mapping[str, Any]) -> Mapping[str, Any]:
    session: Mapping[str, Any] = manifest["sessions"][-1]
    return session


def _shared(kind: Kind, what: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[Change]:
    """Differences of what both have; that one lacks a detector is said by the configuration."""
    both = [name for name in before if name in after]
    sides: Sequence[dict[str, Any]] = [{f"{what} {name}": side[name] for name in both} for side in (before, after)]
    yield from _differing(kind, *sides)


def _differing(kind: Kind, before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[Change]:
    for where in dict.fromkeys([*before, *after]):
        old, new = before.get(where), after.get(where)
        if canonical(old) != canonical(new):
            yield Change(kind, where, old, new)
