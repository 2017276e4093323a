"""How each detector looks: its colour and its mark, the same in every chart and table of a report or a site.

Conventions
-----------
* Colour and mark change together from place to place, so that none of forty detectors looks like another, and neither
  is the only difference for readers who see few colours.
* In a report places are those of the experiment; in a site those of its runs, the oldest first. So the site of one run
  looks like its report.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

SERIES = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#7A7A7A",
    "#9A6AD6",
    "#A0522D",
    "#B8336A",
)
"""The palette of Okabe and Ito, Color Universal Design (2008), without its yellow and black; grey and three more."""

SHAPES = {
    "circle": "M-6 0A6 6 0 1 1 6 0A6 6 0 1 1-6 0Z",
    "square": "M-5.5-5.5H5.5V5.5H-5.5Z",
    "triangle-up": "M0-6.5L6.5 5.5H-6.5Z",
    "diamond": "M0-7L6 0L0 7L-6 0Z",
    "triangle-down": "M0 6.5L6.5-5.5H-6.5Z",
    "cross": "M-6-2H-2V-6H2V-2H6V2H2V6H-2V2H-6Z",
    "triangle-right": "M6.5 0L-5.5 6.5V-6.5Z",
    "triangle-left": "M-6.5 0L5.5 6.5V-6.5Z",
}
"""Marks by the names that Vega gives them, each as an SVG path within 7 units of its middle, for tables."""


@dataclass(frozen=True)
class Look:
    """Colour and mark of a detector.

    Attributes
    ----------
    colour : str
        CSS.
    shape : str
        Mark, as Vega names it.
    """

    colour: str
    shape: str

    @property
    def path(self) -> str:
        """The mark as an SVG path."""
        return SHAPES[self.shape]


def looks(names: Iterable[str]) -> dict[str, Look]:
    """Look of each name, by its place.

    Examples
    --------
    >>> looks(["first", "second"])["second"]
    Look(colour='#D55E00', shape='square')
    """
    shapes = list(SHAPES)
    return {
        name: Look(SERIES[place % len(SERIES)], shapes[place % len(shapes)])
        for place, name in enumerate(dict.fromkeys(names))
    }
