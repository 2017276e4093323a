"""Speed against error: which detectors no other one beats in both, and how sure that is.

Conventions
-----------
* Speed is the time a frame, from samples to rows, relative to that of the reference detector of the run, measured in
  alternating blocks; it is what travels between machines. Where an earlier version measured, it is of the step alone;
  the two are not mixed. Over several timed captures it is the geometric mean.
* A detector is on the front if no other one is at least as fast and at least as good, and better in one of them.
* The probability of being on the front is the share of draws in which it is. A draw takes values of all detectors from
  their joint t distribution over scenes, and a time ratio for each detector from a log-normal distribution through its
  stored interval, as the run keeps the ratio and its interval only. Below six scenes nothing is drawn.
* Bounds, such as a detector that reads the truth, are drawn, but are not on the front and put nobody off it.
* Detectors are compared on the captures that all of them were scored on. One that finds nothing is not drawn.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray
from uwbbench.api.metric import Metric, Outcome
from uwbbench.measure.accuracy.stats import Estimate, drawn, estimated
from uwbbench.results.results import Scored, scenes_of
from uwbbench.results.times import ROWS, comparable, timed_of
from uwbbench.run.folder.journal import Entry

DRAWS = 2000

NORMAL_975 = 1.959964
"""The 97.5 % quantile of the normal distribution: half the width of a 95 % interval."""


@dataclass(frozen=True)
class Speed:
    """Time a frame relative to the reference.

    Attributes
    ----------
    reference : str
    ratio, low, high : float
        With the ends of a 95 % interval; NaN where a block comparison was too short for one.
    captures : int
        Timed captures behind it.
    deadline : float
        The radar's frame period, in times of the reference's median time a frame on this machine.
    p50_us : float
        Median time a frame on this machine.
    timed : str
        What the times are of (:mod:`uwbbench.results.times`).
    """

    reference: str
    ratio: float
    low: float
    high: float
    captures: int
    deadline: float
    p50_us: float
    timed: str = ROWS

    @property
    def spread(self) -> float:
        """Standard deviation of the logarithm; 0 where no interval is known."""
        return 0.0 if math.isnan(self.low) else math.log(self.high / self.low) / (2 * NORMAL_975)


@dataclass(frozen=True)
class Point:
    """One detector among others.

    Attributes
    ----------
    detector : str
    speed : Speed
    error : Estimate
        The metric, on the captures that all detectors share.
    on_front : bool
        By the values themselves.
    probability : float
        Of being on the front; NaN where there are too few scenes, and for bounds.
    bound : bool
        Whether it is no detector, but bounds what detectors can reach.
    """

    detector: str
    speed: Speed
    error: Estimate
    on_front: bool
    probability: float
    bound: bool = False


def speed_of(timed: Sequence[Entry]) -> Speed | None:
    """Speed of a detector from its latency entries of one dataset; None where it was never compared.

    Several captures are combined by the mean of the logarithms, their intervals as those of independent values.
    """
    compared = [e.facts for e in comparable(e for e in timed if e.facts.get("ratio_to_reference"))]
    if not compared:
        return None
    ratios = [facts["ratio_to_reference"] for facts in compared]
    middle = float(np.mean([math.log(one["ratio"]) for one in ratios]))
    known = all(one["low"] is not None for one in ratios)
    half = [math.log(one["high"] / one["low"]) / 2 for one in ratios] if known else [math.nan]
    reach = float(np.sqrt(np.sum(np.square(half)))) / len(half)
    deadlines = [
        facts["deadline_us"] / facts["p50_us"] * one["ratio"] for facts, one in zip(compared, ratios, strict=True)
    ]
    return Speed(
        reference=ratios[0]["reference"],
        ratio=math.exp(middle),
        low=math.exp(middle - reach),
        high=math.exp(middle + reach),
        captures=len(compared),
        deadline=float(np.median(deadlines)),
        p50_us=float(np.median([facts["p50_us"] for facts in compared])),
        timed=timed_of(compared[0]),
    )


def speeds_of_run(entries: Iterable[Entry]) -> dict[tuple[str, str], Speed]:
    """Speed by dataset and detector, from all entries of a run; without those that were never compared."""
    datasets: dict[str, list[Entry]] = defaultdict(list)
    timed: dict[tuple[str, str], list[Entry]] = defaultdict(list)
    for entry in entries:
        if (entry.kind, entry.status) == ("latency", "done"):
            datasets[entry.dataset].append(entry)
    for entry in (entry for units in datasets.values() for entry in comparable(units)):
        timed[entry.dataset, entry.detector].append(entry)
    speeds = {key: speed_of(units) for key, units in timed.items()}
    return {key: speed for key, speed in speeds.items() if speed is not None}


def points(
    members: Mapping[str, Sequence[Scored]],
    speeds: Mapping[str, Speed],
    metric: type[Metric],
    settings: Mapping[str, Any],
    bounds: Collection[str] = (),
) -> list[Point]:
    """Points of a chart, the fastest first.

    Parameters
    ----------
    members : mapping of str to sequence of Scored
        What each detector did on one board.
    speeds : mapping of str to Speed
    metric : type of Metric
    settings : mapping
        ``confidence`` and ``seed`` of intervals and draws.
    bounds : collection of str
        Names of those that only bound what detectors can reach.
    """
    timed = {name: scored for name, scored in members.items() if name in speeds}
    shared = set.intersection(*(set(_by_capture(scored)) for scored in timed.values())) if timed else set()
    known_scenes = scenes_of(one for scored in timed.values() for one in scored)
    series, estimates, scenes = {}, {}, list[str]()
    for name, scored in timed.items():
        chosen = [one for capture, one in sorted(_by_capture(scored).items()) if capture in shared]
        outcomes, scenes = [one.outcome for one in chosen], [known_scenes[one.capture] for one in chosen]
        estimate = estimated(metric, outcomes, scenes, confidence=settings["confidence"])
        if outcomes and any(outcome.tp.any() for outcome in outcomes) and not math.isnan(estimate.value):
            series[name], estimates[name] = outcomes, estimate
    rivals = [name for name in series if name not in bounds]
    best, chance = _on_front(rivals, series, estimates, speeds, metric, scenes, settings["seed"])
    placed = [
        Point(name, speeds[name], estimates[name], name in best, chance.get(name, math.nan), name in bounds)
        for name in series
    ]
    return sorted(placed, key=lambda point: point.speed.ratio)


def _on_front(
    names: Sequence[str],
    series: Mapping[str, Sequence[Outcome]],
    estimates: Mapping[str, Estimate],
    speeds: Mapping[str, Speed],
    metric: type[Metric],
    scenes: Sequence[str],
    seed: int,
) -> tuple[set[str], dict[str, float]]:
    """Names on the front by the values themselves, and with what probability each is; none where scenes are too few."""
    if not names:
        return set(), {}
    logs = np.array([math.log(speeds[name].ratio) for name in names])
    values = np.array([-metric.merit(estimates[name].value) for name in names])
    best = front(logs[None], values[None])[0]
    errors = -metric.merit(drawn(metric, [series[name] for name in names], scenes, draws=DRAWS, seed=seed))
    chance = dict[str, float]()
    if len(errors):
        spread = np.array([speeds[name].spread for name in names])
        costs = np.random.default_rng([seed, 1]).normal(logs, spread, size=errors.shape)
        chance = dict(zip(names, front(costs, errors).mean(axis=0).tolist(), strict=True))
    return {name for name, on in zip(names, best, strict=True) if on}, chance


def front(cost: FloatArray, error: FloatArray) -> BoolArray:
    """Which columns (draws, detectors) no other column beats in both cost and error; NaN is always beaten.

    Examples
    --------
    >>> front(np.array([[1.0, 2.0, 3.0]]), np.array([[0.3, 0.1, 0.2]])).tolist()
    [[True, True, False]]
    """
    on = ~(np.isnan(cost) | np.isnan(error))
    for column in range(cost.shape[1]):
        c, e = cost[:, column, None], error[:, column, None]
        beaten = (c <= cost) & (e <= error) & ((c < cost) | (e < error))
        on &= ~beaten
    return np.asarray(on)


def _by_capture(scored: Sequence[Scored]) -> dict[str, Scored]:
    return {one.capture: one for one in scored}
