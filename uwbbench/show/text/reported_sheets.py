"""What sources report of their methods, as a table beside what a run gives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from uwbbench.results.reported import Reported, reported
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.sheet import Sheet, sentence, shown

if TYPE_CHECKING:
    from uwbbench.results.report import Report

_NOTE = (
    "Reported by source: of other radars, other scenes and mostly another metric, as named; no target, and no "
    "validation of what is here. Such detectors are reconstructions, unless their fidelity says otherwise."
)


def reported_sheets(report: Report) -> Iterator[Sheet]:
    """One table, where any detector of the run has such figures.

    Parameters
    ----------
    report : Report
    """
    rows = [_row(one, report) for one in reported(report)]
    columns = ("detector", "reported by source", "there", "source", "here", "dataset", "scoring", "captures")
    if rows:
        yield Sheet("Reported by source, and here", columns, tuple(rows), (_NOTE,))


def _row(one: Reported, report: Report) -> tuple[str, ...]:
    texts = []
    for name, estimate in one.here.items():
        quantity = Quantity.of(name, report.metrics.of(one.board["scoring"])[name])
        texts.append(f"{quantity.title} {quantity.value_of(estimate)}")
    said = tuple(sentence(text) for text in (one.figures, one.of, one.source))
    if not one.board:
        return (shown(one.detector), *said, "no like metric", "", "", "")
    marked = one.board["source"].upper() if one.board["source"] == "simulated" else one.board["source"]
    here = f"{marked}: {'; '.join(texts)}"
    where = shown(one.board["dataset"]), one.board["scoring"], str(one.board["captures"])
    return (shown(one.detector), *said, here, *where)
