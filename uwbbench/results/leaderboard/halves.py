"""Public and private half of a suite side by side: who is worse on captures that nobody could tune to.

Conventions
-----------
* Bounds are no detectors, and left out.
* A detector is compared with itself, of the same identity, on each board of both halves, in the metric that ranks.
* Captures of the same name are of the same scene with other draws; the difference is paired over them, and its p-value
  adjusted after Holm over all detectors and boards.
* A detector *loses* where it is worse on the private half by more than chance, and by more than the metric's margin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from uwbbench.measure.accuracy.boards import Verdict, holm, verdict
from uwbbench.measure.accuracy.evidence import least_units
from uwbbench.measure.accuracy.stats import Difference, Estimate, paired_difference
from uwbbench.results.leaderboard.ranking import Ranking
from uwbbench.results.leaderboard.suites import Contender
from uwbbench.results.results import scenes_of


@dataclass(frozen=True)
class Change:
    """One detector on both halves of a board.

    Attributes
    ----------
    contender : Contender
        As on the public half.
    public, private : Ranking
        The board on each half.
    estimates : (Estimate, Estimate)
        The metric that ranks, on the public and the private half.
    difference : Difference
        Private minus public.
    adjusted : float
        Its p-value after Holm.
    verdict : {"differs", "equal", "not told apart", "too few", "undefined"}
    loses : bool
        Whether it is worse on the private half.
    """

    contender: Contender
    public: Ranking
    private: Ranking
    estimates: tuple[Estimate, Estimate]
    difference: Difference
    adjusted: float
    verdict: Verdict
    loses: bool


def changes(public: Sequence[Ranking], private: Sequence[Ranking]) -> list[Change]:
    """Every detector on every board that both halves have, in the order of the public boards.

    Parameters
    ----------
    public, private : sequence of Ranking
        First boards of the datasets of each half.
    """
    other = {ranking.board: ranking for ranking in private}
    compared = []
    for ranking in public:
        if ranking.board not in other:
            continue
        hidden = {one.contender.key: one for one in other[ranking.board].standings}
        metric = ranking.metrics[ranking.main]
        for one in ranking.standings:
            if one.contender.bound or one.contender.key not in hidden:
                continue
            its = hidden[one.contender.key]
            sides = [{part.capture: part for part in scored} for scored in (its.scored, one.scored)]
            shared = sorted(set(sides[0]) & set(sides[1]))
            scenes = scenes_of(sides[1][name] for name in shared)
            hidden_ones, own = ([side[name].outcome for name in shared] for side in sides)
            found = paired_difference(metric, hidden_ones, own, [scenes[name] for name in shared])
            estimates = one.estimates[ranking.main], its.estimates[ranking.main]
            compared.append((one.contender, ranking, other[ranking.board], estimates, found))
    least = [least_units(ranking.metrics[ranking.main]) for _, ranking, *_ in compared]
    tested = [d.p_value if d.groups >= few else math.nan for (*_, d), few in zip(compared, least, strict=True)]
    judged = []
    for (contender, ranking, hidden_board, estimates, d), p in zip(compared, holm(tested).tolist(), strict=True):
        metric = ranking.metrics[ranking.main]
        word = verdict(d.contrast, p, d.groups, metric.margin, least_units(metric))
        loses = word == "differs" and metric.merit(d.value) < -metric.margin
        judged.append(Change(contender, ranking, hidden_board, estimates, d, p, word, loses))
    return judged
