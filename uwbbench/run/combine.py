"""Experiments made of others: the detectors and datasets of all, each scored as in its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uwbbench.api.errors import ConfigError
from uwbbench.api.locate import find_config
from uwbbench.api.yaml_file import YamlFile, read_yaml
from uwbbench.config.extends import Anchor, extended, placed
from uwbbench.run.contenders import named_detectors

KEY = "experiments"

SHARED: Mapping[str, Any] = {"strongest": None, "surface": "outline"}
"""What all detections of a run are scored by, and its default: it must be the same in experiments that are combined."""


def combined(data: dict[str, Any], source: YamlFile, path: Path, anchor: Anchor) -> dict[str, Any]:
    """Values of an experiment with those of the experiments that it names put in; any other as it is.

    Datasets keep the detectors, scorings, region and gate of their experiment, and are timed where it times anything.

    Parameters
    ----------
    data : dict
        Values of the experiment's file.
    source : YamlFile
        The file, for messages.
    path : Path
        Where it lies.
    anchor : callable
        Makes the paths in values of another file absolute.

    Raises
    ------
    ConfigError
        If there is no such experiment, two of them are scored by different rules, or it also lists detectors or
        datasets of its own.
    """
    if KEY not in data:
        return data
    data = dict(data)
    names = data.pop(KEY)
    at = (KEY,)
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise ConfigError(f"{source.place(at)}: expected a list of names or paths of experiments")
    for key in {"detectors", "datasets", "scoring", "region"} & data.keys():
        raise ConfigError(f"{source.place((key,))}: '{key}' comes from the experiments that are combined")
    detectors: dict[str, Any] = {}
    datasets: list[dict[str, Any]] = []
    scorings: list[str] = []
    for place, name in enumerate(names):
        with placed(source, (KEY, place)):
            file = find_config("experiments", name, path.parent)
            part = anchor(extended(read_yaml(file), "experiments", file, anchor), file.parent)
            if KEY in part:
                raise ConfigError(f"'{name}' is itself made of experiments; name these")
            for key, default in SHARED.items():
                mine = data.setdefault(key, part.get(key, default))
                if part.get(key, default) != mine:
                    raise ConfigError(f"'{name}' has {key} {part.get(key, default)}, but {mine} is to hold for all")
            own = named_detectors(part.get("detectors") or [], file.parent)
            for label, item in own.items():
                if detectors.setdefault(label, item) != item:
                    raise ConfigError(f"'{name}' has another detector of the name '{label}' than an experiment before")
            scoring = part.get("scoring", ["frame", "object"])
            scoring = [scoring] if isinstance(scoring, str) else list(scoring)
            scorings += [one for one in scoring if one not in scorings]
            places: dict[str, Any] = {key: part[key] for key in ("region", "gate_m") if key in part}
            if part.get("latency") is False:
                places["latency"] = False
            usual: dict[str, Any] = {**places, "detectors": list(own), "scoring": scoring}
            datasets += [usual | dataset for dataset in part.get("datasets") or []]
            metrics = part.get("metrics", [])
            if isinstance(metrics, list):
                data["metrics"] = list(dict.fromkeys([*data.get("metrics", []), *metrics]))
    return {**data, "detectors": list(detectors.values()), "datasets": datasets, "scoring": scorings}
