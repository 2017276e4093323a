"""A section of the page: what it is made of, whatever it is about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uwbbench.show.charts.chart import Spec
from uwbbench.show.text.sheet import Sheet


@dataclass(frozen=True)
class Section:
    """One section; what it holds is shown in the order of its attributes.

    Attributes
    ----------
    id, title : str
        Anchor of its link, and heading.
    sentences : tuple of str
        What it says, first of all.
    warnings : tuple of str
        What must be known before a number of it is used.
    layout : {"plain", "leaderboard", "looks", "drives", "manifest"}
        A part that the template writes for this section alone.
    charts : tuple of dict
        Vega-Lite, the same whatever board is chosen.
    of_board : tuple of str
        Kinds of charts that follow the chosen board, keys of
        :data:`~uwbbench.show.page.board_charts.BOARD_CHARTS`.
    sheets : tuple of Sheet
    notes : tuple of str
        How to read it.
    folded : tuple of Sheet
        Tables that are opened on demand.
    """

    id: str
    title: str
    sentences: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    layout: Literal["plain", "leaderboard", "looks", "drives", "manifest"] = "plain"
    charts: tuple[Spec, ...] = ()
    of_board: tuple[str, ...] = ()
    sheets: tuple[Sheet, ...] = ()
    notes: tuple[str, ...] = ()
    folded: tuple[Sheet, ...] = ()

    @property
    def follows_choice(self) -> bool:
        """Whether it shows the board that the reader has chosen."""
        return self.layout == "leaderboard" or bool(self.of_board)
