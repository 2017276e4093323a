"""How every picture looks: print sizes, serif type, colours that colour-blind readers can distinguish, and plain text.

Sizes are those of a two-column paper: 3.5 inches a column, 7.16 the page, type of 7 to 8 points. Matplotlib is
imported here alone before a picture is drawn, so that it stays an extra.
"""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uwbbench.api.errors import UwbbenchError
from uwbbench.api.text import printable
from uwbbench.run.folder.files import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE_IN = 7.16
"""Width of a page of two columns, in inches."""

BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#F0E442",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
"""The palette of Okabe and Ito, Color Universal Design (2008)."""

SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
LINES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)), (0, (1, 3)))
"""Colours, markers and dashes of a series; with different lengths where they repeat, none is the only difference."""

GREY = "#777777"
CAPTION_POINTS = 7.0

_SETTINGS: dict[str, Any] = {
    "font.family": ["STIXGeneral", "DejaVu Serif"],
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "0.8",
    "legend.handlelength": 1.6,
    "legend.borderpad": 0.3,
    "legend.labelspacing": 0.3,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.linewidth": 0.4,
    "grid.color": "0.88",
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "patch.linewidth": 0.8,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "savefig.dpi": 300,
    "figure.dpi": 150,
    "pdf.fonttype": 42,  # journals refuse Type 3 fonts
    "svg.fonttype": "none",
    "svg.hashsalt": "uwbbench",
    "text.usetex": False,
    "text.parse_math": False,  # names of captures and materials may hold dollar signs
}


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the house style, without a screen.

    Raises
    ------
    UwbbenchError
        If matplotlib is not installed.
    """
    try:
        import matplotlib as mpl
    except ImportError as error:
        raise UwbbenchError("plots need matplotlib; install it with: pip install 'uwbbench[plot]'") from error
    with mpl.rc_context():
        settings: Any = {**mpl.rcParamsDefault, **_SETTINGS}
        del settings["backend"]  # no screen is used, and setting one could fail where there is none
        mpl.rcParams.update(settings)
        yield


def figure(width_in: float, height_in: float) -> Figure:
    """Empty figure that makes room for all labels by itself."""
    from matplotlib.figure import Figure  # without pyplot: nothing is global, and no screen is sought

    return Figure(figsize=(width_in, height_in), layout="constrained")


def caption(drawn: Figure, sentences: Iterable[str]) -> None:
    """Write what the picture shows under it, across its width."""
    columns = int(drawn.get_figwidth() * 72 / (CAPTION_POINTS * 0.47))
    text = " ".join(printable(sentence) for sentence in sentences if sentence)
    drawn.supxlabel(textwrap.fill(text, columns), x=0.01, ha="left", fontsize=CAPTION_POINTS, color="0.2")


def legend(axes: Axes, handles: Sequence[Any], labels: Sequence[str], **where: Any) -> None:
    """Legend of the given handles.

    A label that starts with an underscore is shown too, which matplotlib would leave out.

    Parameters
    ----------
    axes : Axes
    handles : sequence of Artist
        No legend is drawn where there are none.
    labels : sequence of str
        One for each handle.
    **where
        Keywords of :meth:`matplotlib.axes.Axes.legend`, such as its place.
    """
    shown = [f"\u200b{printable(label)}" if label.startswith("_") else printable(label) for label in labels]
    if handles:
        axes.legend(handles, shown, **where)


def save(drawn: Figure, path: Path) -> None:
    """Write a figure in the format of the suffix, whole or not at all.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    suffix = path.suffix.lower().removeprefix(".")
    # Without a date the same picture is the same file.
    stamp: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    with styled(), replacing(path) as partial, warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")  # shown as a box, which says it all
        drawn.savefig(partial, format=suffix, metadata=stamp.get(suffix))
