"""The kinds of picture by name, and what each is drawn from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from uwbbench.api.errors import ConfigError, nearest
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.results.drives import Frame
from uwbbench.run.folder import RunFolder
from uwbbench.show.figures.cdf import draw_cdf
from uwbbench.show.figures.chain import draw_pipeline
from uwbbench.show.figures.cir import draw_cir
from uwbbench.show.figures.drive import draw_drive_map, draw_trajectories
from uwbbench.show.figures.environment import draw_map
from uwbbench.show.figures.properties import draw_properties
from uwbbench.show.figures.radargram import draw_radargram
from uwbbench.show.figures.source import Result, from_capture, from_run, one_of, rules_of_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from uwbbench.api.capture import Capture
    from uwbbench.detect.pipeline import Pipeline

KINDS = {
    "cir": "one frame: response, first path, noise floor, peaks with prominence, width and fate",
    "radargram": "a capture over time and range, with truth and detections",
    "properties": "peak prominence and width against distance, by material",
    "pipeline": "from all peaks through the filters to clusters, from above",
    "cdf": "distribution of the absolute errors",
    "map": "clustered points, or the map of a mapper, with true outlines and robot path",
    "trajectory": "paths of mappers on a run, and their errors over time",
}


@dataclass(frozen=True)
class Choices:
    """What may be chosen about a picture; None where nobody did.

    Attributes
    ----------
    frame : int or None
        For ``cir``.
    scoring, gate_m : str, float or None
        For ``cdf``; the gate for ``properties`` too.
    table : {"filtering", "mapping"} or None
        For ``cdf``; which poses for ``trajectory`` and ``map``.
    aligned : bool or None
        For ``trajectory`` and the ``map`` of a mapper: whether the estimate is laid over the truth as fits best, and
        not by its start.
    """

    frame: int | None = None
    scoring: str | None = None
    gate_m: float | None = None
    table: Table | None = None
    aligned: bool | None = None


_USED_BY = {
    "frame": ("cir",),
    "scoring": ("cdf",),
    "table": ("cdf", "trajectory", "map"),
    "gate_m": ("cdf", "properties"),
    "aligned": ("trajectory", "map"),
}


def check_kind(kind: str, choices: Choices) -> None:
    """Refuse a kind that does not exist, and a choice that would change nothing.

    Raises
    ------
    ConfigError
        With the nearest kind, or the kinds that the choice is for.
    """
    if kind not in KINDS:
        raise ConfigError(f"no kind of plot '{kind}'.{nearest(kind, KINDS)}")
    for name, kinds in _USED_BY.items():
        if getattr(choices, name) is not None and kind not in kinds:
            option = name.replace("_", "-")
            raise ConfigError(f"--{option} is for the kind {' and '.join(kinds)}; it changes nothing in '{kind}'")


def draw_capture(kind: str, capture: Capture, detector: Pipeline | None, choices: Choices) -> Figure:
    """Draw a capture, with a detector that runs on it now.

    Parameters
    ----------
    kind : str
        A key of :data:`KINDS`.
    capture : Capture
    detector : Pipeline or None
        None is enough for ``radargram`` alone.
    choices : Choices

    Raises
    ------
    ConfigError
        If the kind or a choice is wrong, or the kind needs a detector.
    """
    check_kind(kind, choices)
    if kind == "radargram":
        return draw_radargram(capture, detector)
    if detector is None:
        raise ConfigError(f"the kind '{kind}' shows what a detector does: give one with --detector")
    if kind == "trajectory":
        raise ConfigError(f"the kind '{kind}' shows what a mapper made of a run: plot it from a run folder")
    if kind == "cir":
        return draw_cir(capture, detector, choices.frame)
    gate_m = 0.20 if choices.gate_m is None else choices.gate_m
    # By name only: an unknown scoring is refused by the rules themselves.
    rules = ScoringRules(choices.scoring or "frame", gate_m)  # type: ignore[arg-type]
    return _draw_results(kind, [from_capture(capture, detector)], rules, choices, capture.name)


def draw_run(
    kind: str,
    folder: RunFolder,
    choices: Choices,
    detector: str | None = None,
    capture: str | None = None,
    dataset: str | None = None,
) -> Figure:
    """Draw what a run folder holds; nothing is run.

    Parameters
    ----------
    kind : str
        A key of :data:`KINDS`.
    folder : RunFolder
    choices : Choices
        The scoring is the run's first, and the gate the run's, unless chosen.
    detector, capture, dataset : str, optional
        Names; everything in the run by default.

    Raises
    ------
    ConfigError
        If the kind or a choice is wrong, or the kind shows samples, which a run folder does not hold.
    """
    check_kind(kind, choices)
    if kind in ("cir", "radargram"):
        raise ConfigError(f"{folder.path}: a run folder holds no samples; plot '{kind}' from the capture file")
    rules = rules_of_run(folder, choices.scoring)
    if choices.gate_m is not None:
        rules = replace(rules, gate_m=choices.gate_m)
    return _draw_results(kind, from_run(folder, detector, capture, dataset), rules, choices, str(folder.path))


def _draw_results(kind: str, results: list[Result], rules: ScoringRules, choices: Choices, where: str) -> Figure:
    if kind == "cdf":
        return draw_cdf(results, rules, choices.table or "filtering")
    if kind == "properties":
        detectors = list(dict.fromkeys(result.detector for result in results))
        if len(detectors) > 1:
            raise ConfigError(f"{where}: choose one with --detector: {', '.join(detectors)}")
        return draw_properties(results, rules.gate_m)
    frame: Frame = "aligned" if choices.aligned else "start"
    if kind == "trajectory":
        return draw_trajectories(results, choices.table or "filtering", frame)
    result = one_of(results, where)
    if kind == "map" and result.detections.mapped is not None:
        return draw_drive_map(result, choices.table or "filtering", frame)
    return draw_map(result) if kind == "map" else draw_pipeline(result)
