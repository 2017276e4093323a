"""The boards of a suite, with the ranks of their detectors, and times put together over machines.

Conventions
-----------
* A board is one dataset, source, scoring and table of a suite; numbers of different boards are never combined.
* Boards are ranked by the metric that their experiment lists first, or by F1; by recall where the truth is not
  exhaustive.
* Ranks, comparisons and the words for them are those of :mod:`uwbbench.results.verdicts`.
* Time is the ratio to the reference detector of the suite, measured in alternating blocks on one machine. Over several
  machines it is the geometric mean, and its interval reaches from the lowest to the highest end.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.stats import Estimate
from uwbbench.results.leaderboard.runs import Run
from uwbbench.results.leaderboard.suites import Contender, Suite
from uwbbench.results.pareto import Speed, speed_of
from uwbbench.results.results import Scored, estimates_of
from uwbbench.results.slices import Board
from uwbbench.results.times import timed_of
from uwbbench.results.verdicts import Pair, Ranks, ranks_of
from uwbbench.run.folder.journal import Entry

SETTINGS: dict[str, Any] = {"confidence": 0.95, "seed": 0}
"""Of all intervals of a site, whatever the runs used for theirs."""


@dataclass(frozen=True)
class Standing:
    """One detector on a board.

    Attributes
    ----------
    contender : Contender
    scored : tuple of Scored
    estimates : mapping of str to Estimate
    ranks : (int, int) or None
        Smallest and largest rank that it may have; None for a bound, where it was not scored on all captures, or where
        scenes are too few.
    speed : Speed or None
    """

    contender: Contender
    scored: tuple[Scored, ...]
    estimates: Mapping[str, Estimate]
    ranks: tuple[int, int] | None
    speed: Speed | None


@dataclass(frozen=True)
class Ranking:
    """A board with its detectors, the best first.

    Attributes
    ----------
    suite : Suite
    board : Board
    exhaustive : bool
        Whether the truth names all that is visible.
    standings : tuple of Standing
    ranks : Ranks
        Order, rank sets and comparisons, by the contenders' keys.
    """

    suite: Suite
    board: Board
    exhaustive: bool
    standings: tuple[Standing, ...]
    ranks: Ranks

    @property
    def main(self) -> str:
        """The metric that ranks."""
        return self.ranks.main

    @property
    def captures(self) -> int:
        """Captures that any of them was scored on."""
        return self.ranks.captures

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """Comparisons of all pairs of them."""
        return self.ranks.pairs

    @property
    def metrics(self) -> MetricChoice:
        """Metrics of its suite in its scoring."""
        return self.suite.metrics.of(self.board[2])

    @property
    def headline(self) -> list[str]:
        """Names of the few metrics that the index shows."""
        return self.metrics.headline(exhaustive=self.exhaustive)

    def pair(self, first: str, second: str, metric: str) -> Pair | None:
        """Comparison of two contenders, first minus second; None where they were not compared.

        Parameters
        ----------
        first, second : str
            Keys of contenders.
        metric : str
        """
        return self.ranks.pair(first, second, metric)


def rankings(suite: Suite) -> list[Ranking]:
    """Rankings of all boards of a suite, in the order of datasets and scorings."""
    boards: dict[Board, dict[str, list[Scored]]] = defaultdict(lambda: defaultdict(list))
    for contender in suite.contenders:
        for one in contender.scored:
            boards[one.dataset, one.source, one.scoring, one.table][contender.key].append(one)
    datasets = suite.datasets
    scorings = suite.scorings
    order = sorted(boards, key=lambda b: (datasets.index(b[0]), b[1], scorings.index(b[2]), b[3]))
    return [_ranking(suite, board, boards[board]) for board in order]


def _ranking(suite: Suite, board: Board, members: Mapping[str, list[Scored]]) -> Ranking:
    metrics = suite.metrics.of(board[2])
    exhaustive = all(one.outcome.exhaustive for scored in members.values() for one in scored)
    estimates = {key: estimates_of(metrics, scored, SETTINGS) for key, scored in members.items()}
    speeds = speeds_of(suite, board[0])
    times = {key: speed.ratio for key, speed in speeds.items()}
    contenders = {one.key: one for one in suite.contenders}
    bounds = {key for key in members if contenders[key].bound}
    ranks = ranks_of(members, metrics, estimates, times, metrics.compared(exhaustive=exhaustive), bounds)
    standings = [
        Standing(contenders[key], tuple(members[key]), estimates[key], ranks.sets.get(key), speeds.get(key))
        for key in ranks.order
    ]
    return Ranking(suite, board, exhaustive, tuple(standings), ranks)


# Times ---------------------------------------------------------------------------------------------------------


def reference_of(suite: Suite) -> tuple[str, str, str] | None:
    """Name and identity of the reference that most detectors were timed against, and what the times are of.

    None where nothing was timed.
    """
    uses: Counter[tuple[str, str, str]] = Counter()
    for contender in suite.contenders:
        uses.update({key for run, entry in contender.timed if (key := _reference(run, entry)) is not None})
    return max(uses, key=lambda key: (uses[key], key)) if uses else None


def _reference(run: Run, entry: Entry) -> tuple[str, str, str] | None:
    ratio = entry.facts["ratio_to_reference"]
    return (ratio["reference"], run.manifest["reference"], timed_of(entry.facts)) if ratio else None


def speeds_by_machine(suite: Suite, contender: Contender, dataset: str) -> dict[str, Speed]:
    """Speed on each machine, against the common reference only.

    Parameters
    ----------
    suite : Suite
        Whose most used reference is the common one.
    contender : Contender
    dataset : str
        Label.

    Returns
    -------
    dict of str to Speed
        By machine as one line; without machines on which the contender was not compared with that reference.
    """
    common = reference_of(suite)
    timed: dict[str, dict[str, Any]] = defaultdict(dict)
    for run, entry in contender.timed:  # the newest run of a machine counts
        if entry.dataset == dataset and common is not None and _reference(run, entry) == common:
            timed[run.machine_of(entry)][entry.capture] = entry
    speeds = {machine: speed_of(list(entries.values())) for machine, entries in timed.items()}
    return {machine: speed for machine, speed in speeds.items() if speed is not None}


def speeds_of(suite: Suite, dataset: str) -> dict[str, Speed]:
    """Speed of each contender, combined over machines.

    The median time of a frame belongs to a machine, so it is NaN; so is the frame period in times of the reference
    unless all were timed on one machine.
    """
    by_machine = {one.key: speeds_by_machine(suite, one, dataset) for one in suite.contenders}
    machines = {machine for speeds in by_machine.values() for machine in speeds}
    return {
        key: _together(list(speeds.values()), one_machine=len(machines) == 1)
        for key, speeds in by_machine.items()
        if speeds
    }


def _together(speeds: Sequence[Speed], *, one_machine: bool) -> Speed:
    return Speed(
        reference=speeds[0].reference,
        ratio=math.exp(float(np.mean([math.log(speed.ratio) for speed in speeds]))),
        low=float(np.min([speed.low for speed in speeds])),
        high=float(np.max([speed.high for speed in speeds])),
        captures=max(speed.captures for speed in speeds),
        deadline=speeds[0].deadline if one_machine else math.nan,
        p50_us=math.nan,
        timed=speeds[0].timed,
    )
