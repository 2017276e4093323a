"""Who is better than whom on a board: ranks, intervals and the words for them, the same in every report and site.

Conventions
-----------
* Two detectors are compared on the captures that both were scored on, scene by scene. The p-values of all pairs of a
  board are adjusted together after Holm, for each metric (:mod:`uwbbench.measure.accuracy.boards`).
* They *differ* if the adjusted p-value is below 0.05. They are *equal* if the 99 % interval of their difference lies
  within the metric's margin (0.01 of a share, 1 cm of an error), from twelve scenes on. Otherwise they are *not told
  apart*. Below six scenes there are *too few*, and nobody is ranked.
* A detector has a rank set, such as 1-3: one more than those that are better beyond chance and the margin, up to the
  number of detectors less those that are worse. The top group is all that may be first. One that was not scored on all
  captures of the board has none.
* Bounds, such as a detector that reads the truth, have no rank, are compared with nobody, and stand last.
* Detectors stand in the order of their values in the metric that ranks; ties are broken by the headline metric of
  errors (MAE), then by time. *Leads* is said only of the one that alone may be first.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uwbbench.api.text import counted
from uwbbench.measure.accuracy.boards import Verdict, holm, rank_sets, verdict
from uwbbench.measure.accuracy.evidence import LEAST_RUNS, WITHIN_SCENES, least_units, unit_of
from uwbbench.measure.accuracy.intervals import CONFIDENCE, INNER_UNITS
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.stats import Difference, Estimate, paired_board, paired_difference
from uwbbench.results.results import Scored, scenes_of

WORDS: dict[Verdict, str] = {
    "differs": "differ",
    "equal": "practically equal",
    "not told apart": "not told apart",
    "too few": "too few scenes to decide",
    "undefined": "undefined: one of them found nothing",
}
"""What is said of two detectors."""

WITHIN = "within these recordings only; says nothing about other scenes"
"""What an interval from one to three scenes is."""

INTERVALS = (
    f"Evidence is counted in scenes: captures that repeat one another are one. From {INNER_UNITS} scenes on, the inner "
    "interval is shown, for scenes like these; below, the outer one, as if each scene ended all or nothing, and from "
    f"1 to {WITHIN_SCENES} scenes one {WITHIN}."
)
"""What intervals are, for the reader of a table."""

RUN_INTERVALS = (
    f"Evidence is counted in runs, each of which is one number: from {LEAST_RUNS} runs on, the interval is Student's, "
    "for runs that are drawn like these; below there is none."
)
"""The same where runs are judged as a whole."""


_ENOUGH = {"scene": "six", "run": "ten"}
"""How many of each rank."""

BOUNDS = (
    "bound: no detector, but what detectors are to be read against, as it reads the truth or does not look at all; it "
    "has no rank and is compared with nobody."
)
"""What is said below a table that has one."""


@dataclass(frozen=True)
class Pair:
    """Two detectors on the captures that both were scored on.

    Attributes
    ----------
    first, second : str
        Keys of detectors.
    metric : str
    captures : int
    difference : Difference
        First minus second.
    adjusted : float
        The p-value after Holm.
    verdict : {"differs", "equal", "not told apart", "too few", "undefined"}
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

    def turned(self) -> Pair:
        """The same, seen from the other side."""
        d = self.difference
        around = replace(d, value=-d.value, low=-d.high, high=-d.low, per_group=tuple(-value for value in d.per_group))
        return replace(self, first=self.second, second=self.first, difference=around)


@dataclass(frozen=True)
class Ranks:
    """Order, rank sets and comparisons of the detectors of a board.

    Attributes
    ----------
    main : str
        The metric that ranks.
    captures, scenes : int
        Captures that any of them was scored on, and scenes that these are of.
    order : tuple of str
        Keys of the detectors, the best first, and of the bounds behind them.
    sets : mapping of str to (int, int)
        Smallest and largest rank that each may have; without those that have none.
    pairs : tuple of Pair
    bounds : frozenset of str
        Keys of those that only bound what detectors can reach.
    unit : {"scene", "run"}
        What is counted as one piece of evidence.
    """

    main: str
    captures: int
    scenes: int
    order: tuple[str, ...]
    sets: Mapping[str, tuple[int, int]]
    pairs: tuple[Pair, ...]
    bounds: frozenset[str] = frozenset()
    unit: str = "scene"

    @property
    def top(self) -> list[str]:
        """Those that may be first, in order."""
        return [key for key in self.order if self.sets.get(key, (0, 0))[0] == 1]

    @property
    def leader(self) -> str | None:
        """The one that alone may be first, where others were compared with it."""
        return self.top[0] if len(self.top) == 1 and len(self.sets) > 1 else None

    def pair(self, first: str, second: str, metric: str) -> Pair | None:
        """Comparison of two detectors, first minus second, in whichever order it is stored.

        Parameters
        ----------
        first, second : str
            Keys of detectors.
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
                return pair.turned()
        return None

    def text(self, key: str) -> str:
        """Rank set of a detector as people read it."""
        return rank_text(self.sets.get(key))

    def opening(self, names: Mapping[str, str], figures: str) -> str:
        """Who comes first, with what, and whether it leads.

        Parameters
        ----------
        names : mapping of str to str
            What people call each detector, by key.
        figures : str
            Its figures.
        """
        first = names[self.order[0]]
        if self.leader == self.order[0]:
            return f"{first} leads with {figures}"
        text = f"{first} comes first with {figures}"
        if len(self.order) - len(self.bounds) <= 1:
            return f"{first} has {figures}"
        if not self.sets:
            return f"{text}, but {counted(self.scenes, self.unit)} cannot rank ({_ENOUGH[self.unit]} can)"
        others = [names[key] for key in self.top if key != self.order[0]]
        if self.order[0] not in self.top or not others:
            return text
        return f"{text}, but is not surely ahead of {listed(others)}"


def rank_text(ranks: tuple[int, int] | None) -> str:
    """A rank set as people read it.

    Examples
    --------
    >>> rank_text((1, 1)), rank_text((1, 3)), rank_text(None)
    ('1', '1-3', '–')
    """
    if ranks is None:
        return "–"
    low, high = ranks
    return str(low) if low == high else f"{low}-{high}"


def listed(names: Sequence[str]) -> str:
    """Names as words of a sentence.

    Examples
    --------
    >>> listed(["a"]), listed(["a", "b", "c"])
    ('a', 'a, b and c')
    """
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def ranks_of(
    members: Mapping[str, Sequence[Scored]],
    metrics: MetricChoice,
    estimates: Mapping[str, Mapping[str, Estimate]],
    times: Mapping[str, float],
    compared: Iterable[str] = (),
    bounds: Collection[str] = (),
) -> Ranks:
    """Ranks of the detectors of a board.

    Parameters
    ----------
    members : mapping of str to sequence of Scored
        What each detector did on each capture, by its key.
    metrics : MetricChoice
    estimates : mapping
        Of each detector, by metric.
    times : mapping of str to float
        Time a frame of those that were timed, by which ties are broken.
    compared : iterable of str
        Metrics in which detectors are compared in pairs, besides the one that ranks.
    bounds : collection of str
        Keys of those that only bound what detectors can reach.
    """
    every = [one for scored in members.values() for one in scored]
    exhaustive = all(one.outcome.exhaustive for one in every)
    main = metrics.ranking(exhaustive=exhaustive)
    captures = {one.capture for one in every}
    scenes = scenes_of(every)
    ranked = {key: scored for key, scored in members.items() if key not in bounds}
    pairs = pairs_of(ranked, metrics, dict.fromkeys([main, *compared]), scenes)
    complete = [key for key, scored in ranked.items() if len(scored) == len(captures)]
    place = {key: at for at, key in enumerate(complete)}
    ahead = np.zeros((len(complete), len(complete)), bool)
    for pair in pairs:
        if pair.metric == main and pair.better is not None and {pair.first, pair.second} <= set(complete):
            worse = pair.second if pair.better == pair.first else pair.first
            ahead[place[pair.better], place[worse]] = True
    count = len(set(scenes.values()))
    sets = {}
    if count >= least_units(metrics[main]):
        sets = {key: (low, high) for key, (low, high) in zip(complete, rank_sets(ahead).tolist(), strict=True)}
    names = [main, *metrics.error(exhaustive=exhaustive)]

    def order(key: str) -> tuple[float, ...]:
        merits = [metrics[name].merit(estimates[key][name].value) for name in names]
        costs = [math.inf if math.isnan(merit) else -round(merit, 12) for merit in merits]
        return (key in bounds, key not in place, *costs, times.get(key, math.inf))

    known = frozenset(key for key in members if key in bounds)
    in_order = tuple(sorted(members, key=order))
    return Ranks(main, len(captures), count, in_order, sets, pairs, known, unit_of(metrics[main]))


def pairs_of(
    members: Mapping[str, Sequence[Scored]],
    metrics: MetricChoice,
    names: Iterable[str],
    scenes: Mapping[str, Hashable],
) -> tuple[Pair, ...]:
    """Comparisons of all pairs of a board, in some metrics.

    Parameters
    ----------
    members : mapping of str to sequence of Scored
        What each detector did on each capture, by its key.
    metrics : MetricChoice
    names : iterable of str
        Of the metrics.
    scenes : mapping of str to hashable
        What each capture is of.
    """
    outcomes = {key: {one.capture: one.outcome for one in scored} for key, scored in members.items()}
    captures = {key: sorted(known) for key, known in outcomes.items()}
    alike = len(set(map(tuple, captures.values()))) == 1
    pairs = []
    for name in names:
        metric, differences = metrics[name], {}
        if alike:
            shared = next(iter(captures.values()))
            series = [[known[capture] for capture in shared] for known in outcomes.values()]
            found = paired_board(metric, series, [scenes[capture] for capture in shared], confidence=CONFIDENCE)
            keys = list(outcomes)
            differences = {(keys[a], keys[b]): (len(shared), d) for (a, b), d in found.items()}
        else:
            for first, second in itertools.combinations(outcomes, 2):
                shared = sorted(set(captures[first]) & set(captures[second]))
                one, other = ([outcomes[key][capture] for capture in shared] for key in (first, second))
                difference = paired_difference(metric, one, other, [scenes[capture] for capture in shared])
                differences[first, second] = len(shared), difference
        least = least_units(metric)
        tested = [d.p_value if d.groups >= least else math.nan for _, d in differences.values()]
        for ((first, second), (count, d)), p_value in zip(differences.items(), holm(tested).tolist(), strict=True):
            word = verdict(d.contrast, p_value, d.groups, metric.margin, least)
            better = None
            if word == "differs" and metric.better != "zero":
                better = first if metric.merit(d.value) > 0 else second
            pairs.append(Pair(first, second, name, count, d, p_value, word, better))
    return tuple(pairs)
