"""Type and colours of charts on light and on dark paper."""

from __future__ import annotations

from typing import Any

from uwbbench.show.looks import SERIES

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"


def config(*, ink: str, soft: str, line: str, paper: str) -> dict[str, Any]:
    """Vega-Lite configuration for one paper.

    Parameters
    ----------
    ink, soft, line, paper : str
        CSS colours of text, of secondary text and axes, of grid lines, and of the background.
    """
    return {
        "font": FONT,
        "background": None,
        "view": {"stroke": None},
        "padding": 4,
        "title": {
            "color": ink,
            "subtitleColor": soft,
            "fontSize": 13,
            "fontWeight": 600,
            "subtitleFontSize": 11.5,
            "offset": 18,
            "subtitlePadding": 4,
        },
        "axis": {
            "labelColor": soft,
            "titleColor": ink,
            "titleFontWeight": 500,
            "titleFontSize": 11.5,
            "labelFontSize": 11,
            "gridColor": line,
            "domainColor": soft,
            "tickColor": soft,
            "titlePadding": 8,
        },
        "legend": {
            "labelColor": ink,
            "titleColor": ink,
            "labelFontSize": 11.5,
            "symbolSize": 70,
            "symbolStrokeWidth": 2,
            "symbolOpacity": 1,
        },
        "style": {
            "label": {"color": ink, "fontSize": 11.5},
            "note": {"color": soft, "fontSize": 11},
            "deadline": {"color": soft, "strokeWidth": 1.2},
            "bound": {"color": ink, "strokeWidth": 2.4, "strokeDash": [7, 4]},
            "asked": {"color": ink},
            "front": {"color": soft, "strokeWidth": 1.2},
            "halo": {"color": paper, "strokeWidth": 3.2},
            "range": {"color": SERIES[2], "strokeWidth": 1.6},
            "truth": {"color": SERIES[2], "strokeWidth": 2.2},
            "structure": {"color": soft, "strokeWidth": 1.0},
            "path": {"color": soft, "strokeWidth": 1.2, "strokeDash": [4, 3]},
            "cell": {"color": soft, "opacity": 0.45},
            "echo": {"color": soft},
        },
    }


PRINT = config(ink="#1b1f24", soft="#59636e", line="#e6e8eb", paper="#ffffff")
PAGE = config(ink="var(--ink)", soft="var(--soft)", line="var(--grid)", paper="var(--paper)")
"""On the page, colours are those of its style sheet, so that a switch of theme, and printing, draw nothing again."""
