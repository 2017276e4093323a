"""The two halves of a suite on a page: one table, with detectors that lose from public to private captures first."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from uwbbench.measure.accuracy.boards import RANKED_UNITS
from uwbbench.results.leaderboard.halves import Change, changes
from uwbbench.results.leaderboard.suites import Suite
from uwbbench.results.verdicts import WORDS
from uwbbench.show.html.cell import Cell, Table
from uwbbench.show.site.cells import metric_cell, quantity
from uwbbench.show.text.numbers import interval, p_value
from uwbbench.show.text.sheet import shown

if TYPE_CHECKING:
    from uwbbench.show.site.content import Content

NOTE = (
    "The private half has the same scenes, drawn from secret seeds. A detector loses where it is worse on it by more "
    "than chance (paired over captures of the same name, adjusted for all detectors and datasets) and more than the "
    "margin; a detector that was tuned to the public captures does."
)


NEEDED = f"{RANKED_UNITS} of a dataset are needed"


def halves(content: Content) -> Iterator[tuple[Suite, Suite, list[Change]]]:
    """Each public half with each private one of the same suite, and what changes."""
    for private in content.suites:
        for public in content.suites:
            if public.is_public_half_of(private):
                mains = [[section.main for section in content.of_suite(suite)] for suite in (public, private)]
                yield public, private, changes(*mains)


def halves_shown(content: Content) -> Iterator[tuple[str, str, Table]]:
    """Title, sentence and table of each public half with a private one."""
    for public, private, found in halves(content):
        title = f"{content.names.suite(public)} and {content.names.suite(private)}"
        yield title, _sentence(content, found), _table(content, found)


def _table(content: Content, found: list[Change]) -> Table:
    """Public and private figures side by side; who loses comes first."""
    rows = []
    for change in sorted(found, key=lambda one: not one.loses):
        by, d = quantity(change.public, change.public.main), change.difference
        difference = interval(d.value, d.low, d.high, by.digits, by.factor)
        cells = [metric_cell(by, estimate) for estimate in change.estimates]
        word = "loses" if change.loses else "better" if change.verdict == "differs" else WORDS[change.verdict]
        named = (content.cell_of(change.contender), Cell(shown(change.public.board[0]), small=by.title), Cell(word))
        rows.append((*named, *cells, Cell(difference, key=f"{d.value:.6g}"), Cell(p_value(change.adjusted))))
    columns = ("detector", "dataset", "verdict", "public", "private", "private minus public", "adjusted p")
    return Table("Public and private half", columns, tuple(rows), (NOTE,))


def _sentence(content: Content, found: list[Change]) -> str:
    """Who loses, and where."""
    losers: dict[str, list[str]] = {}
    for change in found:
        if change.loses:
            losers.setdefault(content.labels[change.contender.key], []).append(change.public.board[0])
    if all(change.verdict == "too few" for change in found):
        return f"Too few scenes to decide whether a detector loses from the public to the private half: {NEEDED}."
    if not losers:
        return "No detector loses significantly from the public to the private half."
    said = "; ".join(f"{name} ({', '.join(datasets)})" for name, datasets in losers.items())
    return f"Worse on the private half by more than chance: {said}."


def halves_dict(content: Content) -> list[dict[str, Any]]:
    """The same for programs."""
    return [
        {
            "suite": public.name,
            "version": public.version,
            "seeds": private.part["seeds"],
            "changes": [
                {
                    "detector": change.contender.name,
                    "identity": change.contender.identity,
                    "dataset": change.public.board[0],
                    "metric": change.public.main,
                    "public": change.estimates[0].value,
                    "private": change.estimates[1].value,
                    "difference": change.difference.value,
                    "low": change.difference.low,
                    "high": change.difference.high,
                    "p_adjusted": change.adjusted,
                    "verdict": change.verdict,
                    "loses": change.loses,
                }
                for change in found
            ],
        }
        for public, private, found in halves(content)
    ]
