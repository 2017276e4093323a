"""What a page shows, from a report: texts and tables, boards to choose from, and charts by what was chosen."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.errors import CaptureError
from uwbbench.measure.accuracy.stats import MINIMUM_GROUPS
from uwbbench.results import radargram
from uwbbench.results.cases import Case, cases
from uwbbench.results.curves import error_curve
from uwbbench.results.pareto import Speed, points, speeds_of_run
from uwbbench.results.report import Report
from uwbbench.results.results import Scored
from uwbbench.results.slices import ALL, Board, Slice, cuts, range_edges_m, slices, span_name
from uwbbench.results.times import in_words
from uwbbench.show.charts import error_charts, scene_charts, speed_chart, time_chart
from uwbbench.show.charts.chart import Spec
from uwbbench.show.text.numbers import number, rounded
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.sheet import labels
from uwbbench.show.text.wording import TABLES


@dataclass(frozen=True)
class Picture:
    """A chart with a name for its file.

    Attributes
    ----------
    name : str
    spec : dict
        Vega-Lite.
    """

    name: str
    spec: Spec


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
        self.detectors = labels(report.detectors)
        self.datasets = labels(used["label"] for used in report.experiment["datasets"])
        self.quantities = Quantity.of_all(report.metrics)
        self.edges_m = range_edges_m(report.scored)
        self.spans = [span_name(*ends) for ends in zip(self.edges_m[:-1], self.edges_m[1:], strict=True)]

    @cached_property
    def boards(self) -> dict[Board, list[Scored]]:
        """What was scored on each board, in the order of the leaderboards."""
        boards: dict[Board, list[Scored]] = {}
        for about, _ in self.report.estimates:
            boards.setdefault((about["dataset"], about["source"], about["scoring"], about["table"]), [])
        for one in self.report.scored:
            boards[one.dataset, one.source, one.scoring, one.table].append(one)
        return boards

    @cached_property
    def slices(self) -> list[Slice]:
        """Every cut of every board."""
        known = {
            ((about["dataset"], about["source"], about["scoring"], about["table"]), about["detector"]): estimates
            for about, estimates in self.report.estimates
        }
        return list(slices(self.report.scored, self.report.metrics, self.edges_m, self.report.settings, known))

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
        first = self.report.experiment["scoring"][0] if self.report.estimates else ""
        scorings = {about["scoring"] for about, _ in self.report.estimates}
        for about, _ in self.report.estimates:
            if about["table"] == "filtering" and (about["scoring"] == first or first not in scorings):
                leaders.setdefault((about["dataset"], about["source"]), about["detector"])
        return leaders

    def summary(self) -> list[str]:
        """One sentence for each dataset: who leads, how sure that is, and at what cost."""
        sentences = []
        for about, estimates in self.report.estimates:
            key = about["dataset"], about["source"]
            if self.leaders.get(key) != about["detector"] or about["table"] != "filtering":
                continue
            if about["scoring"] != next(b[2] for b in self.boards if b[:2] == key):
                continue
            sentences.append(self._sentence(about, estimates))
        return sentences

    def _sentence(self, about: Mapping[str, Any], estimates: Mapping[str, Any]) -> str:
        metrics, exhaustive = self.report.metrics, about["exhaustive"]
        main = self.quantities[metrics.ranking(exhaustive=exhaustive)]
        said = [main, *(self.quantities[name] for name in metrics.error(exhaustive=exhaustive))]
        figures = " and ".join(f"{by.title} {by.value_of(estimates[by.name])}" for by in said)
        plural = "capture" if about["captures"] == 1 else "captures"
        what = f"{about['captures']} {about['source']} {plural} of {self.datasets[about['dataset']]}"
        leader = self.detectors[about["detector"]]
        text = (
            f"On {what} ({about['scored_frames']} scored frames, {about['scoring']} scoring), {leader} leads with "
            f"{figures}"
        )
        if math.isnan(estimates[main.name].low):
            text += f" (no intervals: fewer than {MINIMUM_GROUPS} groups)"
        speed = self.speeds.get(about["dataset"], {}).get(about["detector"])
        if speed is None:
            return f"{text}; it was not timed."
        against = self.detectors.get(speed.reference, speed.reference)
        return f"{text}, at {number(speed.ratio, 2)} times the time a frame of {against}."

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
        return self.report.metrics.headline(exhaustive=self.exhaustive(board))

    def pareto(self, board: Board, name: str) -> Spec | None:
        """Speed against error; None where fewer than two detectors were timed."""
        members: dict[str, list[Scored]] = defaultdict(list)
        for one in self.boards[board]:
            members[one.detector].append(one)
        speeds = self.speeds.get(board[0], {})
        placed = points(members, speeds, self.report.metrics[name], self.report.settings)
        if not placed:
            return None
        quantity = self.quantities[name]
        title = self.title(f"Speed against {quantity.title}", board[0], board[1])
        return speed_chart.speed_against_error(title, placed, self.detectors, quantity)

    def by_range(self, board: Board, name: str) -> Spec | None:
        """A metric by range; None where there are no bins."""
        shown = [one for one in self.slices if one.board == board and (one.channel, one.material) == (ALL, ALL)]
        shown = [one for one in shown if one.span != ALL and self._finds(board, one.detector)]
        shown = [one for one in shown if not math.isnan(one.estimates[name].value)]
        spans = [span for span in self.spans if any(one.span == span for one in shown)]
        if not spans:
            return None
        quantity = self.quantities[name]
        title = self.title(f"{quantity.title} by range", board[0], board[1])
        return error_charts.by_range(title, shown, spans, self.detectors, quantity)

    def _finds(self, board: Board, detector: str) -> bool:
        return any(one.outcome.tp.any() for one in self.boards[board] if one.detector == detector)

    def cdf(self, board: Board) -> Spec | None:
        """Distribution of the errors; None where there are none."""
        curves = {}
        for detector in self.report.detectors:
            curve = error_curve([one.outcome for one in self.boards[board] if one.detector == detector])
            if curve is not None:
                curves[detector] = curve
        return (
            error_charts.error_cdf(self.title("Errors", board[0], board[1]), curves, self.detectors) if curves else None
        )

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
        entries = [e for e in self.report.entries if (e.kind, e.status) == ("accuracy", "done")]
        return list(cases(self.report.folder, entries, self.report.scored, self.leaders, self.report.metrics))

    @cached_property
    def looks(self) -> list[dict[str, Any]]:
        """Radargram and map of each case, with what a reader must know."""
        return [self._look(case) for case in self.cases]

    def _look(self, case: Case) -> dict[str, Any]:
        image, missing = self._image(case)
        quantity = self.quantities[case.metric]
        source = case.header.source
        capture = labels([case.capture], 40)[case.capture]
        which = {"best": "Best", "worst": "Worst", "only": "The"}[case.which]
        radar = self.title(f"{which} capture, {capture}", case.dataset, source)
        text = (
            f"{which} capture of {self.detectors[case.leader]} on {self.datasets[case.dataset]}: {capture}, "
            f"{quantity.title} {quantity.text(case.score)} in {case.scoring} scoring, "
            f"{len(case.header)} frames."
        )
        order = {name: place for place, name in enumerate(self.report.detectors)}
        chosen = [
            {
                "label": self.detectors[marks.detector],
                "count": marks.count,
                "shown": len(marks.near),
                "placed": marks.placed,
            }
            for marks in sorted(case.marks, key=lambda marks: order[marks.detector])
        ]
        return {
            "text": text,
            "missing": missing,
            "detectors": chosen,
            "leader": self.detectors[case.leader],
            "placing": self.detectors[scene_charts.placing(case)],
            "radargram": scene_charts.radargram(radar, case, image, self.detectors),
            "map": scene_charts.top_view(
                self.title(f"{which} capture from above", case.dataset, source), case, self.detectors
            ),
        }

    def _image(self, case: Case) -> tuple[tuple[str, float] | None, str]:
        if self.roots is None:
            return None, "Captures were not looked for."
        used = next(one for one in self.report.experiment["datasets"] if one["label"] == case.dataset)
        sha256 = self.report.folder.content(case.capture_id)
        try:
            return radargram.picture(radargram.reopened(used, case.capture, sha256, self.roots)), ""
        except CaptureError as error:
            return None, f"Capture not at hand: {error}"

    def pictures(self) -> Iterator[Picture]:
        """Every chart that the page can show, with names for files."""
        for place, board in enumerate(self.boards):
            for name in self.charted(board):
                for kind, spec in (("pareto", self.pareto(board, name)), ("range", self.by_range(board, name))):
                    if spec is not None:
                        yield Picture(f"{kind}-{place + 1}-{board[2]}-{board[3]}-{name}", spec)
            cdf = self.cdf(board)
            if cdf is not None:
                yield Picture(f"errors-{place + 1}-{board[2]}-{board[3]}", cdf)
        for place, spec in enumerate(self.timings):
            yield Picture(f"latency-{place + 1}", spec)
        for place, look in enumerate(self.looks):
            yield Picture(f"radargram-{place + 1}", look["radargram"])
            yield Picture(f"map-{place + 1}", look["map"])

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
        materials = labels({one.material for one in self.report.scored})
        rows = [
            [
                place[one.board],
                one.channel,
                materials.get(one.material, ""),
                one.span,
                detectors[one.detector],
                one.captures,
                one.frames,
                [_packed(one.estimates[name]) for name in self.quantities],
                one.hits > 0,
                one.errors,
            ]
            for one in self.slices
        ]
        specs: dict[str, Any] = {"pareto": [], "range": [], "cdf": []}
        for board in boards:
            specs["pareto"].append({name: self.pareto(board, name) for name in self.charted(board)})
            specs["range"].append({name: self.by_range(board, name) for name in self.charted(board)})
            specs["cdf"].append(self.cdf(board))
        specs["latency"] = self.timings
        specs["looks"] = [{"radargram": look["radargram"], "map": look["map"]} for look in self.looks]
        return {
            "detectors": list(self.detectors.values()),
            "quantities": [vars(quantity) for quantity in self.quantities.values()],
            "boards": [self._board(board, materials) for board in boards],
            "spans": self.spans,
            "rows": rows,
            "times": self._times(detectors),
            "specs": specs,
        }

    def _board(self, board: Board, materials: Mapping[str, str]) -> dict[str, Any]:
        dataset, source, scoring, table = board
        members, metrics, exhaustive = self.boards[board], self.report.metrics, self.exhaustive(board)
        same = {
            f"{channel}|{materials.get(material, '')}": f"{kept[0]}|{materials.get(kept[1], '')}"
            for (channel, material), (kept, _) in cuts(members).items()
        }
        return {
            "dataset": f"{self.datasets[dataset]} ({source})",
            "scoring": scoring,
            "table": TABLES[table],
            "columns": metrics.defined(exhaustive=exhaustive),
            "main": metrics.ranking(exhaustive=exhaustive),
            "cuts": same,
            "charted": self.charted(board),
            "missing": self._missing(board),
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

    def _times(self, detectors: Mapping[str, int]) -> list[list[Any]]:
        """Times of each dataset and detector; None where they were not measured."""
        rows = []
        for dataset in self.datasets:
            row: list[Any] = [None] * len(detectors)
            for detector, index in detectors.items():
                facts = [entry.facts for entry in self.report.measured(dataset, detector)]
                if facts:
                    speed = self.speeds.get(dataset, {}).get(detector)
                    ratio = [speed.ratio, speed.low, speed.high] if speed else [None] * 3
                    calls = sum(one["n"] for one in facts)
                    row[index] = [*map(rounded, ratio), *(_median(facts, key) for key in ("p50_us", "p99_us")), calls]
            rows.append(row)
        return rows


def _median(facts: Sequence[Mapping[str, Any]], key: str) -> float | None:
    known = [one[key] for one in facts if one[key] is not None]
    return rounded(float(np.median(known))) if known else None


def _packed(estimate: Any) -> list[Any]:
    return [rounded(estimate.value), rounded(estimate.low), rounded(estimate.high), estimate.n, estimate.groups]
