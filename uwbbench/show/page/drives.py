"""Runs to look at on the page: the map that each mapper has made, and how far its poses are off."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uwbbench.api.text import counted
from uwbbench.results.drive_cases import DriveCase
from uwbbench.show.charts import drive_charts
from uwbbench.show.charts.scene_charts import DETECTOR
from uwbbench.show.page.section import Section
from uwbbench.show.text.sheet import labels

if TYPE_CHECKING:
    from uwbbench.show.page.content import Content


def drives(content: Content) -> Section | None:
    """The run in the middle of each dataset that has mappers."""
    if not content.drives:
        return None
    note = (
        "Of each dataset the run that as many are better than as are worse. The start of each estimate lies on the "
        "true one. Ellipses and bands are what a mapper states of its own errors. Path and echoes are those up to the "
        "chosen time; cells, landmarks, points and lines are those at the end. Long runs are thinned."
    )
    return Section("drives", "Maps and trajectories", layout="drives", notes=(note,))


def drive_look(content: Content, case: DriveCase) -> dict[str, Any]:
    """Charts of a run, and the detectors that they can show.

    Parameters
    ----------
    content : Content
    case : DriveCase
    """
    quantity = content.quantities[case.metric]
    run = labels([case.run], 40)[case.run]
    of_runs = "The run" if case.runs == 1 else f"The middle one of {counted(case.runs, 'run')}"
    text = (
        f"{of_runs} of {content.detectors[case.leader]} on {content.datasets[case.dataset]}: {run}, "
        f"{quantity.title} {quantity.text(case.score)}."
    )
    shown = case.leader if case.leader in case.drives else next(iter(case.drives))
    names = content.detectors
    about = (case.drives, names, shown)
    map_title = content.title(f"Map of {DETECTOR}, {run}", case.dataset, case.source)
    error_title = content.title(f"Error of the position, {run}", case.dataset, case.source)
    return {
        "text": text,
        "detectors": [names[name] for name in content.report.detectors if name in case.drives],
        "shown": names[shown],
        "map": drive_charts.drive_map(map_title, *about),
        "errors": drive_charts.drive_errors(error_title, *about),
    }
