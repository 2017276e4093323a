"""Figures of the paper whose detector ``paper`` is, to be shown beside those of a run.

They are read from ``configs/published``, where each has its place in the paper. They are what the authors report of
their recordings; nothing here measured them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from uwbbench.api.locate import config_folder
from uwbbench.api.yaml_file import read_yaml

if TYPE_CHECKING:
    import pandas as pd

Row = tuple[Literal["filtering", "mapping"], int, str]

_PAPER = read_yaml(config_folder() / "published" / "arxiv-2512-01018.yaml").data

NAME: str = _PAPER["name"]

SCORING = "peak"
"""How the paper counts: no other scoring repeats its tables."""

ROWS: tuple[tuple[int, str], ...] = tuple(product((5, 9), ("metal", "concrete", "plywood")))
"""Channel and material of the rows of both tables."""

METRICS: tuple[str, ...] = tuple(_PAPER["columns"][2:-1])
"""Metrics of both tables, by their registered names."""

FIGURES: Mapping[Row, Mapping[str, float]] = MappingProxyType(
    {
        (table, row[0], row[1]): {name: round(value / 100, 6) for name, value in zip(METRICS, row[2:-1], strict=True)}
        for table, rows in _PAPER["figures"].items()
        for row in rows
    }
)
"""All cells by table, channel and material; metres and shares of one."""

NOTES: Mapping[str, tuple[str, ...]] = {table: tuple(notes) for table, notes in _PAPER["notes"].items()}
"""What its text says otherwise, by table."""

CHAIN: Mapping[str, int] = MappingProxyType({row["title"]: row["left"] for row in _PAPER["chain"]})
"""Peaks left behind each step of the paper's demonstration."""

STEPS: Mapping[str, str] = MappingProxyType({row["title"]: row["step"] for row in _PAPER["chain"] if "step" in row})
"""Step of a pipeline behind which the same count is taken; clusters are counted in the detections themselves."""


def known(table: str, channel: int | None, material: str, metric: str) -> float | None:
    """Published figure of a cell, or None where the paper has none.

    Parameters
    ----------
    table : {"filtering", "mapping"}
    channel : int or None
    material, metric : str

    Examples
    --------
    >>> known("filtering", 5, "plywood", "mae"), known("mapping", 9, "steel", "mae")
    (0.3074, None)
    """
    for row, figures in FIGURES.items():
        if row == (table, channel, material):
            return figures.get(metric)
    return None


def beside(table: pd.DataFrame, datasets: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Every cell of the paper with the figure of a run, and the difference.

    Parameters
    ----------
    table : DataFrame
        Rows of one detector and scoring by table, dataset, channel and material, with a column for each metric.
    datasets : sequence of str
        The first of them that has the channel and material is taken.

    Yields
    ------
    dict
        ``table``, ``channel``, ``material``, ``metric``; ``published``, ``here`` with Student's interval over captures
        (``low``, ``high``), and ``difference`` (here minus published), in metres or shares, NaN where the run has no
        such row; ``dataset``, ``source`` and ``errors`` (detections behind it), empty and 0 there.
    """
    order = {label: place for place, label in enumerate(datasets)}
    for (kind, channel, material), figures in FIGURES.items():
        fits = (table["table"] == kind) & (table["channel"] == channel) & (table["material"] == material)
        rows = sorted(table[fits].to_dict("records"), key=lambda row: order[row["dataset"]])
        about = {key: rows[0][key] if rows else none for key, none in _NOTHING.items()}
        for metric, value in figures.items():
            here, reach = (
                float(rows[0].get(name, math.nan)) if rows else math.nan for name in (metric, f"{metric}_reach")
            )
            cell = {"table": kind, "channel": channel, "material": material, "metric": metric}
            ends = {"here": here, "low": here - reach, "high": here + reach, "difference": here - value}
            yield {**cell, "published": value, **ends, **about}


_NOTHING: Mapping[str, Any] = {"dataset": "", "source": "", "errors": 0}
