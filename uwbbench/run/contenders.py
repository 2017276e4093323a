"""The detectors of an experiment: shipped ones, files, changed ones, and results of other programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from uwbbench.api.errors import ConfigError
from uwbbench.api.locate import is_path
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.detector import DetectorConfig, read_detector
from uwbbench.config.extends import placed
from uwbbench.config.model import ConfigModel, DetectorName
from uwbbench.detect.tum import SUFFIX as TUM


class DetectorUse(ConfigModel):
    """A detector with another name or other values."""

    use: DetectorName = Field(description="Name, or path to a detector YAML.")
    name: str | None = Field(default=None, min_length=1, description="Name in tables and reports.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values to change in the detector, by path.")


class ResultsUse(ConfigModel):
    """What another program has found, in a folder of results files: of captures, or, as TUM files, of runs."""

    results: str = Field(
        min_length=1, description="Folder with CAPTURE.csv or .parquet for each capture, or RUN.tum for each run."
    )
    name: str | None = Field(default=None, min_length=1, description="Name in tables; the folder's if left out.")


def _kind(item: Any) -> str:
    """Form that an item of ``detectors`` has, so that a mistake is explained by that form alone."""
    if item is None:
        return "null"
    if isinstance(item, dict):
        return ResultsUse.__name__ if "results" in item else DetectorUse.__name__
    return type(item).__name__ if isinstance(item, DetectorUse | ResultsUse) else "name"


DetectorItem = Annotated[
    Annotated[str, Tag("name")]
    | Annotated[None, Tag("null")]
    | Annotated[DetectorUse, Tag(DetectorUse.__name__)]
    | Annotated[ResultsUse, Tag(ResultsUse.__name__)],
    Discriminator(_kind),
]


def with_absolute_paths(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Values of an extended experiment whose detectors are found from anywhere."""
    if isinstance(values.get("detectors"), list):
        values["detectors"] = [_anchored(item, folder) for item in values["detectors"]]
    return values


def _anchored(item: Any, folder: Path) -> Any:
    """Detector of an extended experiment: its path starts from that experiment's folder."""
    if isinstance(item, dict) and isinstance(item.get("results"), str):
        return {**item, "results": str((folder / item["results"]).resolve())}
    if isinstance(item, dict):
        return {**item, "use": _anchored(item.get("use"), folder)}
    here = isinstance(item, str) and is_path(item) and (folder / item).is_file()
    return str((folder / item).resolve()) if here else item


def read_detectors(items: Sequence[DetectorItem], source: YamlFile, folder: Path) -> tuple[DetectorConfig, ...]:
    """Detectors of an experiment, with distinct names, each checked.

    Parameters
    ----------
    items : sequence
        As they stand under ``detectors``.
    source : YamlFile
        The file, for messages.
    folder : Path
        Paths start from it.

    Raises
    ------
    ConfigError, PluginError
        If a file is missing or wrong, or a name appears twice.
    """
    from uwbbench.detect.pipeline import Pipeline

    configs: dict[str, DetectorConfig] = {}
    for index, item in enumerate(items):
        at = ("detectors", index)
        if isinstance(item, ResultsUse):
            config = _stored(item, source.place((*at, "results")), folder)
        else:
            use = item if isinstance(item, DetectorUse) else DetectorUse(use="null" if item is None else item)
            with placed(source, at):
                config = read_detector(use.use, folder, use.set)
                config = replace(config, name=use.name or config.name)
                Pipeline(config)  # checks that its steps fit together
        if config.name in configs:
            raise ConfigError(
                f"{source.place(at)}: detector '{config.name}' appears twice; give one of them another 'name'"
            )
        configs[config.name] = config
    return tuple(configs.values())


def _stored(use: ResultsUse, place: str, folder: Path) -> DetectorConfig:
    """Detector of a folder of results, which is seen from the folder of the experiment."""
    results = folder / use.results
    if not results.is_dir():
        raise ConfigError(f"{place}: {results}: no such folder")
    trajectories = next(results.rglob(f"*{TUM}"), None) is not None
    return DetectorConfig.of_results(use.name or results.resolve().name, results, trajectories=trajectories)


def named_detectors(items: Sequence[Any], folder: Path) -> dict[str, Any]:
    """Detectors of an experiment by the names that they have in tables."""
    named: dict[str, Any] = {}
    for item in items:
        if isinstance(item, dict) and (item.get("name") or "results" in item):
            named[item.get("name") or Path(item["results"]).name] = item
        else:
            use = item.get("use") if isinstance(item, dict) else "null" if item is None else item
            named[read_detector(str(use), folder).name] = item
    return named
