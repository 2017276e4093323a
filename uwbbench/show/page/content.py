"""What a page shows, from a report: texts and tables, boards to choose from, and charts by what was chosen."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.measure.accuracy.stats import Estimate
from uwbbench.results.cases import Case, cases
from uwbbench.results.drive_cases import drive_cases
from uwbbench.results.pareto import Speed, speeds_of_run
from uwbbench.results.report import Report
from uwbbench.results.results import Scored
from uwbbench.results.set_aside import SetAside
from uwbbench.results.slices import Board, Slice, cuts, range_edges_m, slices, span_name
from uwbbench.results.times import in_words
from uwbbench.run.folder.journal import Entry
from uwbbench.show.charts import time_chart
from uwbbench.show.charts.chart import Spec
from uwbbench.show.looks import Look, looks
from uwbbench.show.page.board_charts import BOARD_CHARTS, drawn
from uwbbench.show.page.captures import look
from uwbbench.show.page.drives import drive_look
from uwbbench.show.page.timed import COLUMNS, timed_cells
from uwbbench.show.text.numbers import rounded
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.sheet import labels
from uwbbench.show.text.wording import set_aside_warning, table_name


class Content:
    """Everything on the page of one run.

    Parameters
    ----------
    report : Report
    roots : sequence of Path, optional
        Folders in which captures are looked for, to show their samples; None: they are not looked for.
    """

    def __init__(self, report: Report, roots: Sequence[Path] | None = None) -> None:
        self.report, self.roots = report, roots
        self.detectors = {name: report.label(name, short) for name, short in labels(report.detectors).items()}
        self.datasets = labels(used["label"] for used in report.experiment["datasets"])
        self.quantities = Quantity.of_all(report.metrics)
        self.scored = [one for one in report.scored if one.dataset not in report.limits.datasets]
        self.edges_m = range_edges_m(self.scored)
        self.spans = [span_name(*ends) for ends in zip(self.edges_m[:-1], self.edges_m[1:], strict=True)]

    @property
    def estimates(self) -> list[tuple[dict[str, Any], dict[str, Estimate]]]:
        """Rows of the leaderboards; test signals of physical limits have tables of their own, and no leader."""
        return [row for row in self.report.estimates if row[0]["dataset"] not in self.report.limits.datasets]

    @cached_property
    def boards(self) -> dict[Board, list[Scored]]:
        """What was scored on each board, in the order of the leaderboards."""
        boards: dict[Board, list[Scored]] = {}
        for about, _ in self.estimates:
            boards.setdefault((about["dataset"], about["source"], about["scoring"], about["table"]), [])
        for one in self.scored:
            boards[one.dataset, one.source, one.scoring, one.table].append(one)
        return boards

    @cached_property
    def slices(self) -> list[Slice]:
        """Every cut of every board."""
        known = {
            ((about["dataset"], about["source"], about["scoring"], about["table"]), about["detector"]): estimates
            for about, estimates in self.estimates
        }
        return list(slices(self.scored, self.report.metrics, self.edges_m, self.report.settings, known))

    @cached_property
    def speeds(self) -> dict[str, dict[str, Speed]]:
        """Speed of each detector by dataset."""
        speeds: dict[str, dict[str, Speed]] = defaultdict(dict)
        for (dataset, detector), speed in speeds_of_run(self.report.entries).items():
            speeds[dataset][detector] = speed
        return speeds

    @cached_property
    def leaders(self) -> dict[tuple[str, str], str]:
        """First detector of each dataset and source, on its first board."""
        leaders: dict[tuple[str, str], str] = {}
        for about, _ in self.estimates:
            if self.leads(about):
                leaders.setdefault((about["dataset"], about["source"]), about["detector"])
        return leaders

    def leads(self, about: Mapping[str, Any]) -> bool:
        """Whether a row is of its dataset's first board: of the experiment's first scoring that there is."""
        asked = self.report.experiment["scoring"]
        there = {board[2] for board in self.boards if board[0] == about["dataset"]}
        first = min(there, key=lambda scoring: (asked.index(scoring) if scoring in asked else len(asked), scoring))
        return bool(about["table"] == "filtering" and about["scoring"] == first)

    @cached_property
    def marks(self) -> dict[str, Look]:
        """Look of each detector by its label."""
        return looks(self.detectors.values())

    # Charts ----------------------------------------------------------------------------------------------------

    def title(self, what: str, dataset: str, source: str) -> str:
        """Title of a chart, which says so where captures are simulated.

        Parameters
        ----------
        what : str
            What the chart shows.
        dataset : str
            Label in the run.
        source : {"measured", "simulated"}
        """
        return f"{what}: {self.datasets[dataset]}, {'SIMULATED' if source == 'simulated' else 'measured'}"

    def exhaustive(self, board: Board) -> bool:
        """Whether the truth names all that is visible in every capture of a board."""
        return all(one.outcome.exhaustive for one in self.boards[board])

    def charted(self, board: Board) -> list[str]:
        """Metrics that charts of a board show."""
        return self.report.metrics.of(board[2]).headline(exhaustive=self.exhaustive(board))

    def _latencies(self) -> Iterator[Spec]:
        sources = {board[0]: board[1] for board in self.boards}
        for dataset in self.datasets:
            times: dict[str, Any] = {}
            deadlines = []
            timed = self.report.measured(dataset)
            for entry in timed:
                parts = [times[entry.detector]] if entry.detector in times else []
                times[entry.detector] = np.concatenate([*parts, self.report.folder.times_us(entry.unit)])
                deadlines.append(entry.facts["deadline_us"])
            if times:
                title = self.title("Times of calls", dataset, sources.get(dataset, "measured"))
                yield time_chart.latency(title, times, min(deadlines), self.detectors, in_words(timed))

    @cached_property
    def cases(self) -> list[Case]:
        """Captures to look at."""
        return list(cases(self.report.folder, self._done, self.scored, self.leaders, self.report.metrics))

    @property
    def _done(self) -> list[Entry]:
        return [entry for entry in self.report.entries if (entry.kind, entry.status) == ("accuracy", "done")]

    @cached_property
    def looks(self) -> list[dict[str, Any]]:
        """Radargram and map of each case, with what a reader must know."""
        return [look(self, case) for case in self.cases]

    @cached_property
    def drives(self) -> list[dict[str, Any]]:
        """Map and errors over time of the middle run of each dataset with mappers."""
        known = drive_cases(self.report.folder, self._done, self.scored, self.leaders, self.report.metrics)
        return [drive_look(self, case) for case in known]

    @cached_property
    def board_charts(self) -> dict[str, list[dict[str, Spec | None]]]:
        """Every chart that follows the chosen board, by kind, board and metric."""
        return drawn(self)

    # Data of the page ------------------------------------------------------------------------------------------

    @cached_property
    def timings(self) -> list[Spec]:
        """Distribution of the times of calls, for each dataset that was timed."""
        return list(self._latencies())

    def data(self) -> dict[str, Any]:
        """What the page's script reads; undefined numbers are None."""
        boards = list(self.boards)
        place = {board: index for index, board in enumerate(boards)}
        detectors = {name: index for index, name in enumerate(self.report.detectors)}
        materials = labels({one.material for one in self.scored})
        # Equal values stay in this order however the reader sorts: that of the leaderboards, which breaks ties.
        ranked = enumerate(about for about, _ in self.estimates)
        order = {((a["dataset"], a["source"], a["scoring"], a["table"]), a["detector"]): rank for rank, a in ranked}
        rows = [
            [
                place[one.board],
                one.channel,
                materials.get(one.material, ""),
                one.span,
                detectors[one.detector],
                one.captures,
                one.frames,
                [_packed(one.estimates.get(name, _NOT_HERE)) for name in self.quantities],
                one.hits > 0,
                one.errors,
            ]
            for one in sorted(self.slices, key=lambda one: order[one.board, one.detector])
        ]
        return {
            "detectors": list(self.detectors.values()),
            "bounds": [name in self.report.bounds for name in self.report.detectors],
            "marks": [[one.path, one.colour] for one in self.marks.values()],
            "quantities": [vars(quantity) for quantity in self.quantities.values()],
            "boards": [self._board(board, materials) for board in boards],
            "spans": self.spans,
            "rows": rows,
            "timed": COLUMNS if self.timings else [],
            "times": [[timed_cells(self, dataset).get(name) for name in detectors] for dataset in self.datasets],
            "charts": {
                kind: {"specs": specs, "empty": BOARD_CHARTS[kind].empty} for kind, specs in self.board_charts.items()
            },
            "looks": [{"radargram": one["radargram"], "map": one["map"]} for one in self.looks],
            "drives": [{"map": one["map"], "errors": one["errors"]} for one in self.drives],
        }

    def _board(self, board: Board, materials: Mapping[str, str]) -> dict[str, Any]:
        dataset, source, scoring, table = board
        members, exhaustive = self.boards[board], self.exhaustive(board)
        metrics = self.report.metrics.of(scoring)
        same = {
            f"{channel}|{materials.get(material, '')}": f"{kept[0]}|{materials.get(kept[1], '')}"
            for (channel, material), (kept, _) in cuts(members).items()
        }
        return {
            "dataset": f"{self.datasets[dataset]} ({source})",
            "scoring": scoring,
            "table": table_name(scoring, table),
            "columns": metrics.defined(exhaustive=exhaustive),
            "main": metrics.ranking(exhaustive=exhaustive),
            "cuts": same,
            "charted": self.charted(board),
            "missing": self._missing(board),
            "warnings": [set_aside_warning(one) for one in self.report.set_aside if _of_board(one, board)],
            "timing": list(self.datasets).index(dataset),
        }

    def _missing(self, board: Board) -> list[str]:
        """Why detectors are not on a board, or not with all captures: empty differs from missing."""
        there = {one.detector for one in self.boards[board]}
        said = []
        for detector, label in self.detectors.items():
            failed = [
                e for e in self.report.failures if (e.kind, e.detector, e.dataset) == ("accuracy", detector, board[0])
            ]
            if failed:
                done = sum(one.detector == detector for one in self.boards[board])
                said.append(f"{label}: failed on {len(failed)} of {len(failed) + done} captures; see Failed.")
            elif detector not in there:
                why = "it does not cluster positions" if board[3] == "mapping" else "it could not be scored"
                said.append(f"{label}: not here, as {why}.")
        return said


_NOT_HERE = Estimate(math.nan, math.nan, math.nan, 0, 0)
"""Of a metric that has no meaning in a scoring, whose boards have no column for it."""


def _of_board(one: SetAside, board: Board) -> bool:
    return (one.dataset, one.source, one.scoring, "filtering") == board


def _packed(estimate: Any) -> list[Any]:
    return [rounded(estimate.value), rounded(estimate.low), rounded(estimate.high), estimate.n, estimate.groups]
