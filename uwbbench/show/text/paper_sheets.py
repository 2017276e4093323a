"""The two tables of arXiv 2512.01018 and its counts of peaks, as texts beside what the paper says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from uwbbench.results import published
from uwbbench.show.text.numbers import interval, number
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.sheet import Sheet, shown
from uwbbench.show.text.wording import TABLES

if TYPE_CHECKING:
    from uwbbench.results.report import Report

_UNKNOWN = "not known"
_COMPARED = ("precision", "recall", "mae")
"""Metrics of the small table; the others stand in the large ones."""
_PRINTED = frozenset(name for cells in published.FIGURES.values() for name in cells)
"""Metrics of the paper's own tables, which stand beside what is printed there however narrow a table should be."""


def published_sheets(report: Report) -> Iterator[Sheet]:
    """The small table that a run of the paper's rows opens with: published, here, difference."""
    cells = {(row["table"], row["channel"], row["material"], row["metric"]): row for row in report.published}
    if not cells:
        return
    quantities = Quantity.of_all(report.metrics.brief)
    shown_here = [(name, quantities[name]) for name in _COMPARED if name in quantities]
    rows = []
    for table, channel, material in published.FIGURES:
        texts = [text for name, by in shown_here for text in _difference(cells[table, channel, material, name], by)]
        rows.append((table, str(channel), material, *texts))
    first = next(iter(cells.values()))
    sources = sorted({row["source"].upper() for row in cells.values() if row["source"]})
    datasets = sorted({shown(row["dataset"]) for row in cells.values() if row["dataset"]})
    here = f"here ({', '.join(sources)})"
    heads = [head for _, by in shown_here for head in (f"{by.axis} published", here, "difference")]
    notes = [
        f"Published: reported by source, {published.NAME}, of its own recordings. Here: {shown(first['detector'])}, "
        f"{first['scoring']} scoring, on {', '.join(datasets)}. Difference: here minus published, "
        "with Student's interval over captures, which are taken to be drawn alike.",
    ]
    if "SIMULATED" in sources:
        notes.append("A difference to simulated captures says how model and recordings differ, not who is right.")
    yield Sheet("Published and here", ("after", "channel", "material", *heads), tuple(rows), tuple(notes))


def _difference(cell: Mapping[str, Any], by: Quantity) -> tuple[str, str, str]:
    """Published figure with its printed digits, the run's, and the difference with its sign and interval."""
    digits = by.digits + 1
    low, high = (cell[end] - cell["published"] for end in ("low", "high"))
    difference = interval(cell["difference"], low, high, digits, by.factor)
    signed = f"+{difference}" if cell["difference"] >= 0 else difference
    return number(cell["published"], digits, by.factor), number(cell["here"], digits, by.factor), signed


def paper_sheets(report: Report) -> Iterator[Sheet]:
    """Both tables; with the published figures, and peaks through the chain, where the run covers all their rows."""
    for kind, quantities, chosen in _alike(report):
        rows = [
            (
                shown(row["detector"]),
                row["scoring"],
                shown(row["dataset"]),
                number(row["channel"], 0),
                shown(row["material"]),
                row["source"],
                *(
                    interval(row[name], row[f"{name}_low"], row[f"{name}_high"], by.digits, by.factor)
                    for name, by in quantities.items()
                ),
                str(row["errors"]),
                str(row["frames"]),
            )
            for row in chosen
        ]
        notes: tuple[str, ...] = ()
        if report.repeats_the_paper and any(row["scoring"] == published.SCORING for row in chosen):
            rows = sorted([*rows, *_published(kind, quantities)], key=lambda row: row[3:5])  # channel, then material
            about = (
                f"'{published.NAME}': reported by source, of its own recordings; it gives no counts and no intervals."
            )
            notes = (about, *published.NOTES[kind])
        heads = [by.axis for by in quantities.values()]
        columns = ("detector", "scoring", "dataset", "channel", "material", "source", *heads, "n", "frames")
        yield Sheet(f"By channel and material, {TABLES[kind]}", columns, tuple(rows), notes)
    if report.repeats_the_paper:
        yield _chain(report)


def _alike(report: Report) -> Iterator[tuple[str, dict[str, Quantity], list[dict[str, Any]]]]:
    """Rows of each table whose scorings have the same metrics, with these."""
    groups: dict[tuple[str, tuple[str, ...]], list[dict[str, Any]]] = {}
    for row in report.paper_tables.to_dict("records"):
        chosen = report.metrics.of(row["scoring"])
        beside = _PRINTED if report.repeats_the_paper and row["scoring"] == published.SCORING else frozenset()
        names = tuple(
            dict.fromkeys([*(name for name in chosen if name in beside or name in chosen.brief), *chosen.brief])
        )
        groups.setdefault((row["table"], names), []).append(row)  # type: ignore[arg-type]
    for (kind, names), rows in groups.items():
        yield kind, Quantity.of_all({name: report.metrics[name] for name in names}), rows


def _published(kind: str, quantities: Mapping[str, Quantity]) -> Iterator[tuple[str, ...]]:
    for channel, material in published.ROWS:
        figures = [(published.known(kind, channel, material, name), by) for name, by in quantities.items()]
        cells = [_UNKNOWN if value is None else number(value, by.digits + 1, by.factor) for value, by in figures]
        yield (
            published.NAME,
            "peak",
            "its recordings",
            str(channel),
            material,
            "reported by source",
            *cells,
            _UNKNOWN,
            _UNKNOWN,
        )


def _chain(report: Report) -> Sheet:
    counts = report.chains
    steps = {title: published.STEPS.get(title, title) for title in published.CHAIN}
    rows = []
    for (detector, dataset), group in counts.groupby(["detector", "dataset"], sort=False):
        left = {row["step"]: interval(row["mean"], row["low"], row["high"], 0) for row in group.to_dict("records")}
        if next(iter(steps.values())) in left:
            texts = (left.get(step, "n/a") for step in steps.values())
            rows.append((shown(str(detector)), shown(str(dataset)), str(group["captures"].max()), *texts))
    rows.append((published.NAME, "its demonstration", "1", *map(str, published.CHAIN.values())))
    notes = (
        "Mean of one capture. Captures differ in length from the paper's, so compare the shares that are left, except "
        "on scenes made after its demonstration. A detector that keeps the "
        "strongest peak of a frame drops the others behind the phase difference.",
    )
    return Sheet("Peaks through the chain", ("detector", "dataset", "captures", *published.CHAIN), tuple(rows), notes)
