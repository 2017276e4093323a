"""Cells of tables on pages: texts that may have a second line, a mark, and something to be sorted by."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from uwbbench.show.looks import Look
from uwbbench.show.text.sheet import Sheet

_VALUE_AND_MORE = re.compile(r"(?P<value>[-+<>]?\d\S*) (?P<more>[\[(].*[\])])")


@dataclass(frozen=True)
class Cell:
    """One cell of a table.

    Attributes
    ----------
    text : str
    small : str
        Second line: the interval.
    key : str
        What the cell is sorted by; the text if empty.
    title : str
        More about it.
    link : str
        Address, seen from the root of the site.
    look : Look or None
        Of the detector that it names.
    """

    text: str
    small: str = ""
    key: str = ""
    title: str = ""
    link: str = ""
    look: Look | None = None


@dataclass(frozen=True)
class Table:
    """A table of cells with what a reader must know."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()


def table_of(sheet: Sheet, looks: Mapping[str, Look]) -> Table:
    """Table of a sheet: intervals below their values, and detectors with their marks.

    Parameters
    ----------
    sheet : Sheet
    looks : mapping of str to Look
        Of detectors, by the texts that name them.
    """
    rows = (tuple(_cells(row, looks)) for row in sheet.rows)
    return Table(sheet.title, sheet.columns, tuple(rows), sheet.notes)


def _cells(row: Iterable[str], looks: Mapping[str, Look]) -> Iterable[Cell]:
    for place, text in enumerate(row):
        match = _VALUE_AND_MORE.fullmatch(text)
        if place == 0:
            yield Cell(text, look=looks.get(text))
        elif match:
            yield Cell(match["value"], small=match["more"], key=match["value"].lstrip("<>"))
        else:
            yield Cell(text)
