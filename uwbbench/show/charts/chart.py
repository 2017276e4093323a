"""What all charts share: the specification around their layers, and how a detector looks.

Conventions
-----------
* A specification holds its data and its title, and nothing about colours of paper and ink: those are the theme's.
* Every chart of simulated captures says so in its title.
* A detector has the colour and the mark that :mod:`uwbbench.show.looks` gives it.
* Numbers are in the units that people read: cm, us, per cent.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from uwbbench.show.looks import looks

Spec = dict[str, Any]

SCHEMA = "https://vega.github.io/schema/vega-lite/v6.json"
HEIGHT = 400


def chart(title: str, subtitle: str, layers: list[Spec], **more: Any) -> Spec:
    """Chart of several layers, as wide as the element around it.

    Parameters
    ----------
    title, subtitle : str
        The subtitle may be empty.
    layers : list of dict
        Vega-Lite layers, the lowest first.
    **more
        Further keys of the specification, such as ``data`` or ``params``.

    Returns
    -------
    dict
        Vega-Lite specification without colours of paper and ink.
    """
    head = {"text": title, "subtitle": subtitle} if subtitle else {"text": title}
    return {
        "$schema": SCHEMA,
        "title": {**head, "anchor": "start", "frame": "bounds"},
        "width": "container",
        "height": HEIGHT,
        "autosize": {"type": "fit", "contains": "padding"},
        "layer": layers,
        **more,
    }


class Series:
    """How the detectors of a chart look: each as in every other chart and table of the report.

    Parameters
    ----------
    names : mapping of str to str
        Labels of all detectors, in the order of their looks.
    shown : collection of str
        Labels of those in this chart.
    """

    def __init__(self, names: Mapping[str, str], shown: Iterable[str]) -> None:
        present = set(shown)
        self._looks = {label: look for label, look in looks(names.values()).items() if label in present}

    @property
    def detectors(self) -> list[str]:
        """Labels in the order of their looks."""
        return list(self._looks)

    def encoding(self, *, legend: bool = True) -> Spec:
        """Encoding of a detector by its colour and its mark.

        Parameters
        ----------
        legend : bool
            Whether the layer has a part in the legend.
        """
        scales = {
            "color": [look.colour for look in self._looks.values()],
            "shape": [look.shape for look in self._looks.values()],
        }
        return {
            channel: {
                "field": "detector",
                "type": "nominal",
                "title": None,
                "legend": LEGEND if legend else None,
                "scale": {"domain": self.detectors, "range": values},
            }
            for channel, values in scales.items()
        }


LEGEND: Spec = {"orient": "bottom", "direction": "horizontal", "columns": 5, "labelLimit": 220, "title": None}

PLAIN_NUMBERS = ",.6~r"
"""Format of axes: 2 and 0.05, never 2e+0."""


def axis(field: str, title: str, **more: Any) -> Spec:
    """Encoding of a number by a place."""
    return {"field": field, "type": "quantitative", "title": title, **more}


def limits(values: Sequence[float], *, share: float = 0.06) -> list[float]:
    """Limits of a linear axis around values."""
    known = [value for value in values if math.isfinite(value)]
    low, high = min(known, default=0.0), max(known, default=1.0)
    room = share * (high - low) or max(abs(high) * share, 1e-3)
    return [low - room, high + room]


def deadline(at: float, text: str, x: Spec) -> Spec:
    """Layer that marks the radar's frame period.

    Parameters
    ----------
    at : float
        Place on the axis of times, in its unit; nothing is drawn where it is not finite.
    text : str
        Written above the line, outside the plot: no curve can cover it.
    x : dict
        Scale and other keys of that axis, so that the layer shares it.
    """
    return {
        "data": {"values": [{"at": at, "text": text}] if math.isfinite(at) else []},
        "layer": [
            {
                "mark": {"type": "rule", "strokeDash": [5, 4], "style": "deadline"},
                "encoding": {"x": axis("at", "", **x)},
            },
            {
                "mark": {"type": "text", "align": "right", "dx": 3, "baseline": "bottom", "style": "note"},
                "encoding": {"x": axis("at", "", **x), "y": {"value": -4}, "text": {"field": "text"}},
            },
        ],
    }
