"""The leaderboard of a suite as Markdown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

import uwbbench
from uwbbench.tools.leaderboard import Leaderboard

LIMITS = "limits"
"""Beginning of the names of datasets of test signals."""


@dataclass(frozen=True)
class Board:
    """What a run of a suite says, as far as it is published.

    Attributes
    ----------
    name, version : str
    figures : DataFrame
        A row for each dataset and detector: F1 with its interval, rank set among the detectors, time ratio.
    detectors, references : list of str
        Detectors, those that are often among the best first; and what bounds them.
    timed : list of str
        Datasets on which detectors were timed.
    machine : str
    """

    name: str
    version: str
    figures: pd.DataFrame
    detectors: list[str]
    references: list[str]
    timed: list[str]
    machine: str

    @property
    def datasets(self) -> list[str]:
        """Frozen datasets in the order of the suite."""
        return list(dict.fromkeys(self.figures["dataset"]))

    def is_noise(self, dataset: str) -> bool:
        """Whether a dataset holds nothing to be found."""
        return not (self.of(dataset)["f1"] > 0).any()

    def of(self, dataset: str) -> pd.DataFrame:
        """Figures of a dataset, by detector."""
        return self.figures[self.figures["dataset"] == dataset].set_index("detector")


def board_of(run: uwbbench.Run, combined: Leaderboard) -> Board:
    """Figures of a run of a suite, from its leaderboard."""
    about, table = run.manifest["experiment"], combined.table
    bounds = set(table.loc[table["bound"], "detector"])
    references = [one["name"] for one in about["detectors"] if one["name"] in bounds]
    table = table[(table["table"] == "filtering") & table["dataset"].isin(run.manifest["frozen"])]
    parts = []
    for dataset in dict.fromkeys(one["label"] for one in about["datasets"]):
        rows = table[table["dataset"] == dataset].copy()
        if rows.empty:
            continue
        rows["low"], rows["high"] = (rows[end].fillna(0).astype(int) for end in ("rank", "rank_high"))
        parts.append(rows)
    figures = pd.concat(parts)
    detectors = [one["name"] for one in about["detectors"] if one["name"] not in references]
    found = figures[figures["f1"] > 0]
    top = found[found["low"] == 1].groupby("detector").size()
    mean = figures.groupby("detector")["f1"].mean()
    detectors.sort(key=lambda name: (-top.get(name, 0), -mean.get(name, 0.0)))
    timed = [
        one["label"] for one in about["datasets"] if one.get("latency", True) and one["label"] in set(table["dataset"])
    ]
    machine = run.manifest["sessions"][-1]["machine"]["cpu"]
    return Board(about["name"], about["suite"]["version"], figures, detectors, references, timed, machine)


def readme_text(board: Board) -> str:
    """The block of the README."""
    shown = [name for name in board.datasets if not name.startswith(LIMITS)]
    head = ["detector", *shown, f"time on {board.timed[0]}"]
    lines = [f"| {' | '.join(head)} |", f"| --- |{' ---: |' * (len(head) - 1)}"]
    for name in [*board.detectors, *board.references]:
        cells = [_cell(board.of(dataset), name) for dataset in shown]
        lines.append(f"| {' | '.join([f'`{name}`', *cells, _time(board.of(board.timed[0]), name)])} |")
    units = int(board.figures["captures"].max())
    text = (
        f"Suite `{board.name}`, version {board.version[:12]}, SIMULATED: F1 by object within 20 cm over {units} "
        "captures a column, and in brackets the ranks that a detector may have among the others; **bold** may be the "
        "first. "
        f"`{'`, `'.join(board.references)}` are no detectors but bounds. Times from samples to rows, in times of "
        f"`paper-filtering`, measured in turns on {board.machine}."
    )
    return "\n".join([*lines, "", f"*{text}*"])


def _cell(of: pd.DataFrame, name: str) -> str:
    if name not in of.index or np.isnan(of.loc[name, "f1"]):
        return "–"
    row = of.loc[name]
    if not row["low"]:
        return f"{row['f1']:.2f}"
    low, high = int(row["low"]), int(row["high"])
    ranks = str(low) if low == high else f"{low}-{high}"
    return f"**{row['f1']:.2f}** ({ranks})" if low == 1 else f"{row['f1']:.2f} ({ranks})"


def _time(of: pd.DataFrame, name: str) -> str:
    ratio = of.loc[name, "time_ratio"] if name in of.index else np.nan
    return "–" if np.isnan(ratio) else f"{ratio:.3g}"
