"""What one run says: a leaderboard, the two tables of arXiv 2512.01018, times, and all that did not work.

Conventions
-----------
* Captures are pooled before a number is made of them: the value is that of all their frames together.
* Captures of different datasets, and measured and simulated ones, are never pooled; every row says which it is of.
* Where the truth is not exhaustive an unmatched detection proves nothing: recall is shown beside the recall of as many
  random ranges (``chance_recall``), and precision and F1 are undefined.
* Times are those of the machine that ran the experiment, and hold nowhere else; :mod:`uwbbench.results.times` says what
  they are of.
"""

from __future__ import annotations

import dataclasses
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uwbbench.api.errors import StoreError
from uwbbench.config.identity import from_results, marked
from uwbbench.measure.accuracy.counts import reach_of_mean
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.scoring import column_of
from uwbbench.measure.accuracy.stats import Estimate
from uwbbench.results import published
from uwbbench.results.chains import chains_of
from uwbbench.results.error_causes import ErrorCauses, causes_lack, error_causes
from uwbbench.results.limits import Limits
from uwbbench.results.pareto import speeds_of_run
from uwbbench.results.ranked_curves import CurveKey, RankedCurve, curves_of
from uwbbench.results.reported import reported
from uwbbench.results.results import Scored, columns_of, errors_in, estimates_of, scenes_of, scored
from uwbbench.results.set_aside import SetAside, set_aside
from uwbbench.results.slices import Board
from uwbbench.results.times import comparable, in_words, row_of, timed_of
from uwbbench.results.verdicts import Ranks, ranks_of
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry
from uwbbench.run.folder.reported import REPORTED_FACT

if TYPE_CHECKING:
    import pandas as pd


EARLIER = (
    "where errors come from is not known: an earlier version made these scores; 'uwbbench rescore' finds the kinds of "
    "false detections, and only a new run the causes of misses, and curves without thresholds"
)
"""Said of a run whose scores hold no causes."""


@contextmanager
def read_safely(path: Path) -> Iterator[None]:
    """Turn what goes wrong over values that no run writes into one message about the folder.

    Inside, numerical libraries use one thread: products of small matrices only get slower by more.

    Raises
    ------
    StoreError
        Where a stored value is missing, or of another kind than a run of this version writes.
    """
    from threadpoolctl import threadpool_limits

    try:
        with threadpool_limits(1):
            yield
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        what = f"no {error}" if isinstance(error, KeyError) else f"{type(error).__name__}: {error}"
        raise StoreError(
            f"{path}: does not hold what a run of this version writes ({what}): it was edited, cut short, or made by "
            "another version"
        ) from error


class Report:
    """All tables of one run.

    Parameters
    ----------
    folder : RunFolder

    Raises
    ------
    StoreError
        If something stored is missing or broken.
    """

    def __init__(self, folder: RunFolder) -> None:
        self.folder = folder
        self.experiment: dict[str, Any] = folder.manifest["experiment"]
        self.entries: list[Entry] = folder.entries()
        self.detectors: list[str] = [config["name"] for config in self.experiment["detectors"]]
        self.read_only: set[str] = {one["name"] for one in self.experiment["detectors"] if from_results(one)}
        self.bounds = folder.bounds
        self.metrics = MetricChoice(self.experiment["metrics"], [rule.scoring for rule in folder.rules])
        self.settings: dict[str, Any] = {**self.experiment["intervals"], "seed": self.experiment["seed"]}

    @cached_property
    def scored(self) -> list[Scored]:
        """Every unit that could be scored."""
        return scored(self.folder)

    @cached_property
    def estimates(self) -> list[tuple[dict[str, Any], dict[str, Estimate]]]:
        """Leaderboard rows: what each is of, and its estimates by metric."""
        rows = []
        for board, ranks in self.ranks.items():
            for place, detector in enumerate(ranks.order, start=1):
                low, high = ranks.sets.get(detector, (None, None))
                about = {"place": place, "rank_low": low, "rank_high": high}
                members = self.boards[board][detector]
                rows.append((self._about(members) | about, self._estimates[board][detector]))
        return rows

    @cached_property
    def boards(self) -> dict[Board, dict[str, list[Scored]]]:
        """What each detector did on each board."""
        boards: dict[Board, dict[str, list[Scored]]] = defaultdict(dict)
        for one in sorted(self.scored, key=lambda one: self.detectors.index(one.detector)):
            board = one.dataset, one.source, one.scoring, one.table
            boards[board].setdefault(one.detector, []).append(one)
        return dict(sorted(boards.items()))

    @cached_property
    def ranks(self) -> dict[Board, Ranks]:
        """Order, rank sets and comparisons of each board."""
        speeds = speeds_of_run(self.entries)
        times = {
            board[0]: {name: s.ratio for (at, name), s in speeds.items() if at == board[0]} for board in self.boards
        }
        return {
            board: ranks_of(
                members, self.metrics.of(board[2]), self._estimates[board], times[board[0]], bounds=self.bounds
            )
            for board, members in self.boards.items()
        }

    @cached_property
    def _estimates(self) -> dict[Board, dict[str, dict[str, Estimate]]]:
        return {
            board: {
                name: estimates_of(self.metrics.of(board[2]), scored, self.settings) for name, scored in members.items()
            }
            for board, members in self.boards.items()
        }

    def _about(self, members: Sequence[Scored]) -> dict[str, Any]:
        first = members[0]
        about = {key: getattr(first, key) for key in ("dataset", "source", "scoring", "table", "detector")}
        truths = np.array([one.outcome.tp.sum() + one.outcome.fn.sum() for one in members], float)
        chance = np.array([one.numbers.get("chance_recall") for one in members], float)  # None becomes NaN
        return about | {
            "captures": len(members),
            "scenes": len(set(scenes_of(members).values())),
            "frames": sum(one.frames for one in members),
            "invalid": sum(one.frames - one.processed for one in members),
            "unprocessed": sum(int(one.numbers["unprocessed"]) for one in members),
            "scored_frames": sum(len(one.outcome.group) for one in members),
            "errors": errors_in(one.outcome for one in members),
            "exhaustive": all(one.outcome.exhaustive for one in members),
            "chance_recall": float((chance * truths).sum() / truths.sum()) if truths.sum() else math.nan,
            "results_file": first.detector in self.read_only,
            "bound": first.detector in self.bounds,
            **self._times(first.detector, first.dataset),
        }

    def _times(self, detector: str, dataset: str) -> dict[str, Any]:
        """Times of a detector: medians over the captures that were timed, or as its results files report them."""
        if detector in self.read_only:
            mine = [e.facts for e in self._of_kind("accuracy") if (e.detector, e.dataset) == (detector, dataset)]
            timed = [facts[REPORTED_FACT] for facts in mine if REPORTED_FACT in facts]
        else:
            timed = [entry.facts for entry in self.measured(dataset, detector)]
        return {key: _median(facts[key] for facts in timed) for key in ("p50_us", "p99_us")}

    def measured(self, dataset: str, detector: str | None = None) -> list[Entry]:
        """Latency units of a dataset whose times may stand side by side, of one detector or of all."""
        units = comparable(entry for entry in self._of_kind("latency") if entry.dataset == dataset)
        return [entry for entry in units if detector in (None, entry.detector)]

    def label(self, detector: str, text: str | None = None) -> str:
        """Name of a detector, or another text for it, as tables show it: marked where it was read, or is a bound."""
        return marked(text or detector, results_file=detector in self.read_only, bound=detector in self.bounds)

    def _of_kind(self, kind: str) -> list[Entry]:
        return self._done[kind]

    @cached_property
    def _done(self) -> Mapping[str, list[Entry]]:
        """Units that worked, by kind."""
        done: dict[str, list[Entry]] = defaultdict(list)
        for entry in self.entries:
            if entry.status == "done":
                done[entry.kind].append(entry)
        return done

    @cached_property
    def leaderboard(self) -> pd.DataFrame:
        """One row for each dataset, scoring, table and detector, best first, with intervals and counts."""
        import pandas as pd

        rows = []
        for about, estimates in self.estimates:
            groups = {estimate.groups for estimate in estimates.values()}
            rows.append(about | columns_of(estimates) | {"groups": max(groups)})
        return pd.DataFrame(rows)

    @cached_property
    def causes(self) -> list[ErrorCauses]:
        """Where errors come from, of each detector on each board, in the order of the leaderboard."""
        order = {(*_board(about), about["detector"]): place for place, (about, _) in enumerate(self.estimates)}
        return sorted(error_causes(self.scored), key=lambda one: order[(*one.board, one.detector)])

    @cached_property
    def curves(self) -> dict[CurveKey, RankedCurve]:
        """What each detector would find at every threshold, by dataset, source and detector.

        Those are left out whose candidates are not known under the rules of the scores.
        """
        scored = {(one.detector, one.dataset, one.capture) for one in self.scored}
        units = [e for e in self._of_kind("accuracy") if (e.detector, e.dataset, e.capture) in scored]
        return curves_of(self.folder, units, self.settings["confidence"])

    @cached_property
    def paper_tables(self) -> pd.DataFrame:
        """The two tables of arXiv 2512.01018, for every detector and scoring: rows channel and material.

        ``table`` distinguishes them: ``filtering`` (error of the range) and ``mapping`` (distance to the outline).
        Besides the estimates each metric of the paper has ``METRIC_reach``, half of Student's interval over captures.
        """
        import pandas as pd

        groups: dict[tuple[Any, ...], list[Scored]] = defaultdict(list)
        for one in (one for one in self.scored if not one.outcome.of_run):
            order = one.table, one.scoring, self.detectors.index(one.detector), one.dataset, one.channel or 0
            groups[*order, one.material, one.source].append(one)
        rows = []
        known = {  # a row of all captures of a board has its numbers
            tuple(map(id, members)): self._estimates[board][name]
            for board, of_board in self.boards.items()
            for name, members in of_board.items()
        }
        for _, members in sorted(groups.items(), key=lambda item: item[0]):
            first, same = members[0], tuple(map(id, members))
            estimates = known.get(same) or estimates_of(self.metrics.of(first.scoring), members, self.settings)
            keys = ("table", "scoring", "detector", "dataset", "channel", "material", "source")
            row = {key: getattr(first, key) for key in keys} | {"captures": len(members)}
            row["frames"] = sum(len(one.outcome.group) for one in members)
            row["errors"] = errors_in(one.outcome for one in members)
            rows.append(row | columns_of(estimates) | self._reach(members))
        return pd.DataFrame(rows)

    def _reach(self, members: Sequence[Scored]) -> dict[str, float]:
        """How sure the mean of each of the paper's metrics is over captures that are drawn alike."""
        columns = {name: column_of(name, self.metrics[name].unit) for name in published.METRICS if name in self.metrics}
        reach = {}
        for name, column in columns.items():
            stored = [one.numbers.get(column) for one in members]
            reach[f"{name}_reach"] = reach_of_mean([math.nan if value is None else value for value in stored])
        return reach

    @cached_property
    def repeats_the_paper(self) -> bool:
        """Whether the run covers every row of the paper's tables, counted as there."""
        alike = (one for one in self.scored if one.scoring == published.SCORING)
        return {(one.channel, one.material) for one in alike} >= set(published.ROWS)

    @cached_property
    def published(self) -> list[dict[str, Any]]:
        """Every published cell beside that of the first detector of this run; none for other runs."""
        if not self.repeats_the_paper:
            return []
        table, datasets = self.paper_tables, [used["label"] for used in self.experiment["datasets"]]
        table = table[table["scoring"] == published.SCORING]
        there = [name for name in self.detectors if name in set(table["detector"])]
        detector = min(there, key=lambda name: name in self.bounds)
        rows = published.beside(table[table["detector"] == detector], datasets)
        return [{"detector": detector, "scoring": published.SCORING} | row for row in rows]

    @cached_property
    def chains(self) -> pd.DataFrame:
        """Detections left behind each step of each detector on each dataset: all, and the mean of a capture."""
        return chains_of(self.folder, self._of_kind("accuracy"))

    @cached_property
    def limits(self) -> Limits:
        """Comparison with physical limits; empty unless the run has test signals."""
        return Limits(self.folder)

    @cached_property
    def latency(self) -> pd.DataFrame:
        """One row for each detector and capture that was timed."""
        import pandas as pd

        return pd.DataFrame([row_of(entry) for entry in self._of_kind("latency")])

    @property
    def timed(self) -> str:
        """What the times are of, for people."""
        return in_words(self._of_kind("latency"))

    @cached_property
    def captures(self) -> list[dict[str, Any]]:
        """What was compared on; the description of a simulated scene says which terms were kept, and at what cost."""
        rows: dict[str, dict[str, Any]] = {}
        for entry in self._of_kind("accuracy"):
            if entry.capture_id not in rows:
                header = self.folder.header(entry.capture_id)
                about = {key: getattr(header, key) for key in ("source", "license", "citation", "description")}
                rows[entry.capture_id] = {
                    "dataset": entry.dataset,
                    "capture": entry.capture,
                    "frames": len(header),
                } | about
        return sorted(rows.values(), key=lambda row: (row["dataset"], row["capture"]))

    @cached_property
    def stability(self) -> list[dict[str, Any]]:
        """Results of each detector in the hard cases, in the order of the experiment."""
        facts = {entry.detector: entry.facts for entry in self._of_kind("stability")}
        return [{"detector": name} | facts[name] for name in self.detectors if name in facts]

    @cached_property
    def set_aside(self) -> list[SetAside]:
        """Where a scoring looked at less than half of what a detector found."""
        return set_aside(self.folder, self._of_kind("accuracy"), self.scored)

    @cached_property
    def failures(self) -> list[Entry]:
        """Units, and whole datasets, that failed."""
        return [entry for entry in self.entries if entry.status == "failed"]

    @cached_property
    def unscored(self) -> list[tuple[Entry, str, str]]:
        """Units that ran but could not be scored: entry, scoring, reason."""
        table = self.folder.scores()
        rows = table[table["status"] == "unscored"].to_dict("records") if "status" in table else []
        by_name = {(e.detector, e.dataset, e.capture): e for e in self._of_kind("accuracy")}
        keyed = [(by_name.get((row["detector"], row["dataset"], row["capture"])), row) for row in rows]
        return [(entry, row["scoring"], row["reason"]) for entry, row in keyed if entry is not None]

    @cached_property
    def notes(self) -> list[str]:
        """What detectors and the journal want the reader to know, each once with how often."""
        counts: dict[str, int] = defaultdict(int)
        for entry in self._of_kind("accuracy"):
            for note in entry.facts["notes"]:
                counts[f"{entry.detector}: {note}"] += 1
        said = [f"{note} ({count} captures)" if count > 1 else note for note, count in counts.items()]
        older = [EARLIER] if causes_lack(self.scored) else []
        return said + older + list(self.metrics.notes) + self.folder.damage

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values, for JSON; undefined numbers are NaN, which the store writes as null."""
        rows = [about | {name: dataclasses.asdict(e) for name, e in every.items()} for about, every in self.estimates]
        keys = ("kind", "detector", "dataset", "capture", "reason")
        return {
            "run": str(self.folder.path),
            "experiment": self.experiment["name"],
            "leaderboard": rows,
            "causes": [one.to_dict() for one in self.causes],
            "curves": [
                {**dict(zip(("dataset", "source", "detector"), key, strict=True)), **curve.to_dict()}
                for key, curve in self.curves.items()
            ],
            "paper_tables": self.paper_tables.to_dict("records"),
            "published": self.published,
            "reported": [one.to_dict() for one in reported(self)],
            "chains": self.chains.to_dict("records"),
            "limits": self.limits.to_dict(),
            "latency": [{**facts_of(e), **e.facts, "timed": timed_of(e.facts)} for e in self._of_kind("latency")],
            "captures": self.captures,
            "stability": self.stability,
            "set_aside": [dataclasses.asdict(one) for one in self.set_aside],
            "failures": [{key: getattr(entry, key) for key in keys} for entry in self.failures],
            "unscored": [{**facts_of(entry), "scoring": s, "reason": reason} for entry, s, reason in self.unscored],
            "notes": self.notes,
        }


def _board(about: Mapping[str, Any]) -> Board:
    return about["dataset"], about["source"], about["scoring"], about["table"]


def facts_of(entry: Entry) -> dict[str, str]:
    """Names of what an entry is about."""
    return {"detector": entry.detector, "dataset": entry.dataset, "capture": entry.capture}


def _median(values: Iterable[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else math.nan
