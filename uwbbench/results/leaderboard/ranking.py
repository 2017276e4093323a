"""Who is better than whom, how sure that is, and who is as good for all practical purposes.

Conventions
-----------
* A board is one dataset, source, scoring and table of a suite; numbers of different boards are never combined.
* Boards are ranked by the metric that their experiment lists first, or by F1; by recall where the truth is not
  exhaustive.
* Two detectors are compared on the captures that both were scored on, in pairs: both are evaluated on the same drawn
  captures (or blocks of a second, where captures are few). The p-values of all pairs of a board are adjusted together
  after Holm, for each metric.
* Two detectors *differ* if the adjusted p-value is below 0.05. They are *practically equal* if the whole 95 %
  interval of their difference lies within the metric's margin (0.01 of a share, 1 cm of an error), which a difference
  may do that is certain but does not matter: then they are called equal. Otherwise the captures do not decide.
* The rank of a detector is one more than the number of ranked ones that are better by more than chance and more than
  the margin. Detectors share ranks, and one that was not scored on all captures of the board has none.
* Time is the ratio to the reference detector of the suite, measured in alternating blocks on one machine. Over several
  machines it is the geometric mean, and its interval reaches from the lowest to the highest end.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.stats import MINIMUM_GROUPS, Difference, Estimate, holm, paired_difference
from uwbbench.results.leaderboard.runs import Run
from uwbbench.results.leaderboard.suites import Contender, Suite
from uwbbench.results.pareto import Speed, speed_of
from uwbbench.results.results import Scored, estimates_of
from uwbbench.results.slices import Board
from uwbbench.results.times import timed_of
from uwbbench.run.folder.journal import Entry

SETTINGS: dict[str, Any] = {"resamples": 2000, "confidence": 0.95, "seed": 0}
"""Of all intervals of a site, whatever the runs used for theirs."""

SIGNIFICANCE = 0.05

Verdict = Literal["differs", "equal", "undecided", "too few groups", "undefined"]


@dataclass(frozen=True)
class Pair:
    """Two detectors on the captures that both were scored on.

    Attributes
    ----------
    first, second : str
        Keys of contenders.
    metric : str
    captures : int
    difference : Difference
        First minus second.
    adjusted : float
        The p-value after Holm.
    verdict : {"differs", "equal", "undecided", "too few groups", "undefined"}
        Undefined where one of them has no value, as it found nothing.
    better : str or None
        Key of the better one; None unless they differ, or where neither end of the metric is better.
    """

    first: str
    second: str
    metric: str
    captures: int
    difference: Difference
    adjusted: float
    verdict: Verdict
    better: str | None


@dataclass(frozen=True)
class Standing:
    """One detector on a board.

    Attributes
    ----------
    contender : Contender
    scored : tuple of Scored
    estimates : mapping of str to Estimate
    rank : int or None
        None where it was not scored on all captures, or the captures are too few to compare.
    speed : Speed or None
    """

    contender: Contender
    scored: tuple[Scored, ...]
    estimates: Mapping[str, Estimate]
    rank: int | None
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
    main : str
        The metric that ranks.
    captures : int
        Captures that any of them was scored on.
    standings : tuple of Standing
    pairs : tuple of Pair
    """

    suite: Suite
    board: Board
    exhaustive: bool
    main: str
    captures: int
    standings: tuple[Standing, ...]
    pairs: tuple[Pair, ...]

    @property
    def metrics(self) -> MetricChoice:
        """Metrics of its suite."""
        return self.suite.metrics

    @property
    def headline(self) -> list[str]:
        """Names of the few metrics that the index shows."""
        return self.metrics.headline(exhaustive=self.exhaustive)

    def pair(self, first: str, second: str, metric: str) -> Pair | None:
        """Comparison of two contenders, first minus second, in whichever order it is stored.

        Parameters
        ----------
        first, second : str
            Keys of contenders.
        metric : str

        Returns
        -------
        Pair or None
            None where the two were not compared by this metric.
        """
        for pair in self.pairs:
            if (pair.first, pair.second, pair.metric) == (first, second, metric):
                return pair
            if (pair.second, pair.first, pair.metric) == (first, second, metric):
                d = pair.difference
                turned = dataclasses.replace(d, value=-d.value, low=-d.high, high=-d.low)
                return dataclasses.replace(pair, first=first, second=second, difference=turned)
        return None


def rankings(suite: Suite) -> list[Ranking]:
    """Rankings of all boards of a suite, in the order of datasets and scorings."""
    boards: dict[Board, dict[str, list[Scored]]] = defaultdict(lambda: defaultdict(list))
    for contender in suite.contenders:
        for one in contender.scored:
            boards[one.dataset, one.source, one.scoring, one.table][contender.key].append(one)
    datasets = suite.datasets
    scorings: list[str] = [rule.scoring for rule in suite.newest.rules]
    order = sorted(boards, key=lambda b: (datasets.index(b[0]), b[1], scorings.index(b[2]), b[3]))
    return [_ranking(suite, board, boards[board]) for board in order]


def _ranking(suite: Suite, board: Board, members: Mapping[str, list[Scored]]) -> Ranking:
    every = [one for scored in members.values() for one in scored]
    metrics = suite.metrics
    exhaustive = all(one.outcome.exhaustive for one in every)
    main = metrics.ranking(exhaustive=exhaustive)
    captures = len({one.capture for one in every})
    pairs = _pairs(members, metrics, metrics.compared(exhaustive=exhaustive))
    speeds = speeds_of(suite, board[0])
    complete = {key for key, scored in members.items() if len(scored) == captures}
    ahead: Counter[str] = Counter()
    for pair in pairs:
        if pair.metric == main and pair.better in complete:
            ahead[pair.second if pair.better == pair.first else pair.first] += 1
    decidable = (
        any(p.metric == main and p.verdict in ("differs", "equal", "undecided") for p in pairs) or len(members) == 1
    )
    standings = []
    for contender in suite.contenders:
        scored = members.get(contender.key, [])
        if not scored:
            continue
        estimates = estimates_of(metrics, scored, SETTINGS)
        ranked = decidable and contender.key in complete
        rank = ahead[contender.key] + 1 if ranked else None
        standings.append(Standing(contender, tuple(scored), estimates, rank, speeds.get(contender.key)))
    standings.sort(key=lambda one: _order(one, metrics[main].merit(one.estimates[main].value)))
    return Ranking(suite, board, exhaustive, main, captures, tuple(standings), pairs)


def _order(standing: Standing, merit: float) -> tuple[Any, ...]:
    """Ranked ones first, the best first; undefined values last."""
    return standing.rank is None, standing.rank or 0, math.inf if math.isnan(merit) else -merit, standing.contender.name


def _pairs(members: Mapping[str, list[Scored]], metrics: MetricChoice, names: Sequence[str]) -> tuple[Pair, ...]:
    by_capture = {key: {one.capture: one.outcome for one in scored} for key, scored in members.items()}
    pairs = []
    for name in names:
        metric, compared = metrics[name], []
        for first, second in itertools.combinations(by_capture, 2):
            shared = sorted(set(by_capture[first]) & set(by_capture[second]))
            series = [[by_capture[key][capture] for capture in shared] for key in (first, second)]
            compared.append((first, second, len(shared), paired_difference(metric, *series, **SETTINGS)))
        adjusted = holm([one[3].p_value for one in compared])
        for (first, second, captures, difference), p_value in zip(compared, adjusted.tolist(), strict=True):
            verdict = _verdict(difference, p_value, metric.margin)
            better = None
            if verdict == "differs" and metric.better != "zero":
                better = first if metric.merit(difference.value) > 0 else second
            pairs.append(Pair(first, second, name, captures, difference, p_value, verdict, better))
    return tuple(pairs)


def _verdict(difference: Difference, adjusted: float, margin: float) -> Verdict:
    if difference.groups < MINIMUM_GROUPS:
        return "too few groups"
    if math.isnan(difference.value) or math.isnan(difference.low):
        return "undefined"
    if -margin < difference.low and difference.high < margin:
        return "equal"
    return "differs" if adjusted < SIGNIFICANCE else "undecided"


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
