"""Which classes were taken for which, as tables of text."""

from __future__ import annotations

from collections.abc import Iterator

from uwbbench.api.outcomes import PresenceOutcome
from uwbbench.measure.accuracy.metrics.presence import confusion
from uwbbench.results.report import Report
from uwbbench.show.text.numbers import number
from uwbbench.show.text.sheet import Sheet, shown


def class_sheets(report: Report) -> Iterator[Sheet]:
    """One table for each board and detector that tells classes apart: frames of each true class, by what was said.

    Parameters
    ----------
    report : Report
    """
    for (dataset, source, scoring, _), members in report.boards.items():
        for detector, scored in members.items():
            told = [one.outcome for one in scored if isinstance(one.outcome, PresenceOutcome) and one.outcome.classes]
            classes = tuple(dict.fromkeys(name for outcome in told for name in outcome.classes))
            if not classes:
                continue
            counts = [confusion(outcome) for outcome in told]
            rows = []
            for true in classes:
                frames = [sum(one.get(f"confusion_{true}_as_{said}", 0) for one in counts) for said in classes]
                share = frames[classes.index(true)] / sum(frames) if sum(frames) else float("nan")
                rows.append((true, *map(str, frames), number(share, 3)))
            yield Sheet(
                f"{shown(dataset)}, {source.upper()}: classes of {shown(detector)}, {scoring} scoring",
                ("true class", *(f"said {name}" for name in classes), "share right"),
                tuple(rows),
                ("Frames. A frame is of the class of its nearest visible obstacle, or empty.",),
            )
