"""Figures of the paper whose detector ``paper`` is, to be shown beside those of a run.

They are read from ``configs/published``. A missing figure is shown as such and never filled in.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from types import MappingProxyType
from typing import Literal

from uwbbench.api.locate import config_folder
from uwbbench.api.yaml_file import read_yaml

Row = tuple[Literal["filtering", "mapping"], int, str]

_PAPER = read_yaml(config_folder() / "published" / "arxiv-2512-01018.yaml").data

NAME: str = _PAPER["name"]

ROWS: tuple[tuple[int, str], ...] = tuple(product((5, 9), ("metal", "concrete", "plywood")))
"""Channel and material of the rows of both tables."""

FIGURES: Mapping[Row, Mapping[str, float]] = MappingProxyType(
    {
        (table, cell.pop("channel"), cell.pop("material")): cell
        for table, cells in _PAPER["figures"].items()
        for cell in cells
    }
)
"""Known cells by table, channel and material; metres and shares of one."""

NOTES: Mapping[str, tuple[str, ...]] = {table: tuple(notes) for table, notes in _PAPER["notes"].items()}
"""What is known but belongs to no single cell, by table."""

CHAIN: Mapping[str, int] = MappingProxyType({row["title"]: row["left"] for row in _PAPER["chain"]})
"""Peaks left behind each step of the paper's demonstration."""

STEPS: Mapping[str, str] = MappingProxyType({row["title"]: row["step"] for row in _PAPER["chain"] if "step" in row})
"""Step of a pipeline behind which the same count is taken; clusters are counted in the detections themselves."""


def known(table: str, channel: int | None, material: str, metric: str) -> float | None:
    """Published figure of a cell, or None where it is not known.

    Parameters
    ----------
    table : {"filtering", "mapping"}
    channel : int or None
    material, metric : str

    Examples
    --------
    >>> known("filtering", 5, "plywood", "mae"), known("mapping", 5, "plywood", "mae")
    (0.3074, None)
    """
    for row, figures in FIGURES.items():
        if row == (table, channel, material):
            return figures.get(metric)
    return None
