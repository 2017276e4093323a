"""What a detector is, as one hash and as a name in tables: its resolved file, and the sources of what it is made of."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

RESULTS_FILE = "results file"
"""Fidelity of a detector that is known by what it has written alone, and how tables mark its rows."""

MAPPER = "mapper "
"""What the names of mappers begin with among the names of sources."""

KERNEL = "kernel "
"""What the names of kernels begin with among the names of sources."""

RESULTS = "results of "
"""What the names of such detectors begin with among the names of sources."""


def from_results(config: Mapping[str, Any]) -> bool:
    """Whether a resolved detector is known by what it has written alone."""
    return bool(config.get("fidelity") == RESULTS_FILE)


def detector_identity(config: Mapping[str, Any], sources: Mapping[str, str]) -> str:
    """SHA-256 over a resolved detector and the sources of its stages.

    Parameters
    ----------
    config : mapping
        As :meth:`DetectorConfig.to_dict` gives it.
    sources : mapping of str to str
        SHA-256 of the sources of each stage by its name, and of each kernel, which may stand for some, by its name
        behind ``KERNEL``. Those of other stages do not count. For a detector that is known by what it has written
        alone: SHA-256 of that by its name behind ``RESULTS``, and nothing else. That of a mapper by its name behind
        ``MAPPER``, and those of mappers inside it by :func:`inside`; runs of older versions have none of these.
    """
    if from_results(config):
        name = f"{RESULTS}{config['name']}"
        used = {name: sources[name]}
    else:
        used = {step["use"]: sources[step["use"]] for step in config["pipeline"]}
        used |= {name: sha256 for name, sha256 in sources.items() if name.startswith(KERNEL)}
        if "mapper" in config:
            use, params = config["mapper"]["use"], config["mapper"].get("params", {})
            used[f"{MAPPER}{use}"] = sources[f"{MAPPER}{use}"]
            within = {inside(use, other) for other in named_within(params)}
            used |= {name: sha256 for name, sha256 in sources.items() if name in within}
    text = json.dumps({"detector": config, "sources": used}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def inside(outer: str, inner: str) -> str:
    """Name among the names of sources of a mapper that another one has at work inside it."""
    return f"{MAPPER}{outer} with {inner}"


def named_within(params: Mapping[str, Any]) -> Iterator[str]:
    """Names of plugins that parameters name as ``{use: NAME}``, at any depth."""
    for value in params.values():
        if isinstance(value, Mapping):
            if isinstance(value.get("use"), str):
                yield value["use"]
            yield from named_within(value)


BOUND = "bound"
"""How tables mark the rows of what is no detector, but bounds what detectors can reach."""


def marked(name: str, *, results_file: bool = False, bound: bool = False) -> str:
    """Name of a detector as tables show it.

    Parameters
    ----------
    name : str
    results_file : bool
        Whether its rows are read from a file.
    bound : bool
        Whether it bounds what detectors can reach, and is none.
    """
    marks = [*([RESULTS_FILE] if results_file else []), *([BOUND] if bound else [])]
    return f"{name} ({', '.join(marks)})" if marks else name
