"""What was compared on, as tables of text: captures of one description in one row, and each with its own details."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from uwbbench.show.text.sheet import Sheet, sentence, shown

DETAILS = " | "
"""What stands behind it in a description is of that capture alone, as simulated scenes write it."""

MOST_NAMED = 3
"""Captures that are all named; of more, the first and the last."""


def captures_sheet(captures: Sequence[Mapping[str, Any]]) -> Sheet:
    """One row for all captures of a dataset that share licence and description.

    Parameters
    ----------
    captures : sequence of mapping
        :attr:`uwbbench.results.report.Report.captures`.
    """
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = defaultdict(list)
    for one in captures:
        about = one["description"].split(DETAILS)[0]
        groups[one["dataset"], one["source"], one["license"], about].append(one)
    rows = []
    for (dataset, source, licence, about), members in groups.items():
        names = [shown(one["capture"]) for one in members]
        named = ", ".join(names) if len(names) <= MOST_NAMED else f"{names[0]} to {names[-1]}"
        counts = str(len(members)), str(sum(one["frames"] for one in members))
        rows.append((sentence(dataset), named, *counts, sentence(source), sentence(licence), sentence(about)))
    columns = ("dataset", "captures", "captures (n)", "frames", "source", "license", "description")
    return Sheet("Captures", columns, tuple(rows))


def each_capture_sheet(captures: Sequence[Mapping[str, Any]]) -> Sheet:
    """Every capture, with the part of its description that is its own.

    Parameters
    ----------
    captures : sequence of mapping
        :attr:`uwbbench.results.report.Report.captures`.
    """
    rows = tuple(
        (
            shown(one["capture"]),
            sentence(one["dataset"]),
            str(one["frames"]),
            sentence(DETAILS.join(one["description"].split(DETAILS)[1:])),
        )
        for one in captures
    )
    return Sheet("Each capture", ("capture", "dataset", "frames", "details"), rows)
