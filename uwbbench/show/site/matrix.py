"""One table of a whole site: detectors by datasets, to be filtered and sorted on the page, and as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from uwbbench.results.leaderboard.ranking import Standing
from uwbbench.show.html.cell import Cell, Table
from uwbbench.show.site.cells import metric_cell, quantity
from uwbbench.show.text.formats import csv_text
from uwbbench.show.text.numbers import times

if TYPE_CHECKING:
    from uwbbench.show.site.content import Content, Section

CSV = "matrix.csv"
"""Address of the table as a file."""

NOTE = (
    "Each cell: the metric that ranks on the first board of the dataset, its interval, and the time a frame in times "
    "of the reference. Columns are not comparable with each other: another dataset is another task."
)


def matrix(content: Content) -> Table:
    """Every detector in a row, every dataset in a column."""
    columns = [_head(content, section) for section in content.sections]
    rows = []
    contenders = {one.key: one for suite in content.suites for one in suite.contenders}
    for key in content.labels:
        cells = [_cell(section, _standing(section, key)) for section in content.sections]
        rows.append((content.cell_of(contenders[key]), *cells))
    return Table("All detectors on all datasets", ("detector", *columns), tuple(rows), (NOTE,))


def matrix_csv(content: Content) -> str:
    """The same for programs: value, ends of the interval and time ratio in columns of their own, in SI units."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    parts = ("", " low", " high", " time ratio")
    heads = [f"{_head(content, section)}{part}" for section in content.sections for part in parts]
    writer.writerow(map(csv_text, ["detector", "identity", *heads]))
    identities = {one.key: one.identity for suite in content.suites for one in suite.contenders}
    for key, label in content.labels.items():
        numbers = [text for section in content.sections for text in _numbers(section, _standing(section, key))]
        writer.writerow([csv_text(label), identities[key], *numbers])
    return out.getvalue()


def _head(content: Content, section: Section) -> str:
    several = len({one.suite.name for one in content.sections}) > 1 or len(content.suites) > 1
    suite = f"{content.names.suite(section.suite)}: " if several else ""
    return f"{suite}{section.title}: {quantity(section.main, section.main.main).title}"


def _standing(section: Section, key: str) -> Standing | None:
    return next((one for one in section.main.standings if one.contender.key == key), None)


def _cell(section: Section, standing: Standing | None) -> Cell:
    if standing is None:
        return Cell("–", key="n/a", title="not scored on this dataset")
    by = quantity(section.main, section.main.main)
    cell = metric_cell(by, standing.estimates[by.name])
    time = "" if standing.speed is None else times(standing.speed.ratio)
    more = ", ".join(text for text in (cell.small, time) if text)
    return Cell(cell.text, small=more, key=cell.key, title=cell.title, link=section.address)


def _numbers(section: Section, standing: Standing | None) -> Iterator[str]:
    estimate = None if standing is None else standing.estimates[section.main.main]
    for name in ("value", "low", "high"):
        number = math.nan if estimate is None else getattr(estimate, name)
        yield "" if math.isnan(number) else f"{number:.9g}"
    yield "" if standing is None or standing.speed is None else f"{standing.speed.ratio:.9g}"
