"""The rule that decides whether two detectors differ in speed, and how it was chosen.

What is measured
----------------
Blocks of turns of base and head on the same frames, and the ratio of their times
(:mod:`uwbbench.measure.latency.ratio`, :mod:`uwbbench.measure.latency.player`).

* Two detectors of one environment live in one process. A sample is one block: 61 of them or more.
* Two environments live in two processes, on one core, that take turns at a command. Where a process happens to lie in
  memory makes it slower or faster by some per cent for all its life (1 % standard deviation on the machine that this
  was written on, one in twenty beyond 5 %), so a sample is the median block of two fresh processes: 5 pairs or more.

The rule
--------
With the ratio, its interval, and the limit L (1.05 by default):

* the interval lies above L: regression;
* it lies below L: pass;
* otherwise as many samples again are taken, until there are ``patience`` times the least number. If the interval is
  then no wider than L - 1, the median decides; if it is wider, or there were too few frames, nothing does:
  inconclusive.

Before, the base is compared with itself in the same way. Unless that interval lies within 1/L ... L, no comparison
follows: outside it the measurement is invalid, across its ends it is inconclusive.

Error rates
-----------
``python tests/bench/bench_gate.py`` runs 100 gates of each of two detectors against itself and 100 against itself
slowed by 10 %, and prints how many raised an alarm, each with its exact interval. A false alarm needs the lower end of
the interval to pass 5 % although the medians of equal detectors scatter by some tenths of a per cent; a miss needs the
upper end below 5 % although the median is at 10 %. Simulated, with drift and up to seven turns in ten disturbed, none
of 1 000 gates of equal detectors raises an alarm and none of 1 000 of a detector slower by 10 % passes; in the worst
case 4 and 5 % are inconclusive.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from uwbbench.measure.latency.ratio import Ratio
from uwbbench.tools.gate.check import GateVerdict

Sampler = Callable[[int], Sequence[float]]
"""Measures so many log ratios."""


def against(ratio: Ratio, limit: float) -> GateVerdict:
    """Whether the head is slower than allowed; inconclusive where the interval holds the limit."""
    if ratio.low > limit:
        return GateVerdict.REGRESSION
    return GateVerdict.PASS if ratio.high <= limit else GateVerdict.INCONCLUSIVE


def finally_against(ratio: Ratio, limit: float) -> GateVerdict:
    """The same, with no more samples to come: the median decides where the interval is narrow enough."""
    clear = against(ratio, limit)
    if clear is not GateVerdict.INCONCLUSIVE or ratio.high - ratio.low > limit - 1:
        return clear
    return GateVerdict.REGRESSION if ratio.value > limit else GateVerdict.PASS


def of_equals(ratio: Ratio, limit: float) -> GateVerdict:
    """Whether two equal detectors look equal; invalid where they differ by more than the limit."""
    if ratio.low > limit or ratio.high < 1 / limit:
        return GateVerdict.INVALID
    return GateVerdict.PASS if 1 / limit <= ratio.low and ratio.high <= limit else GateVerdict.INCONCLUSIVE


def sampled(
    sampler: Sampler, minimum: int, patience: int, decide: Callable[[Ratio], GateVerdict]
) -> tuple[Ratio, GateVerdict]:
    """Take samples until they decide.

    Parameters
    ----------
    sampler : callable
        Measures so many log ratios.
    minimum : int
        Least number of samples.
    patience : int
        How many times as many are taken at most; the number is doubled as long as nothing is decided.
    decide : callable
        GateVerdict of a ratio so far; inconclusive asks for more.

    Returns
    -------
    ratio : Ratio
    verdict : GateVerdict
    """
    samples: list[float] = []
    goal = minimum
    while True:
        samples += sampler(goal - len(samples))
        ratio = Ratio.of(samples)
        verdict = decide(ratio)
        if verdict is not GateVerdict.INCONCLUSIVE or goal >= minimum * patience:
            return ratio, verdict
        goal = min(2 * goal, minimum * patience)


def compared(sampler: Sampler, *, minimum: int, patience: int, limit: float) -> tuple[Ratio, GateVerdict]:
    """Base against head, by the rule above.

    Parameters
    ----------
    sampler : callable
        Measures so many log ratios of head to base.
    minimum, patience : int
        As in :func:`sampled`.
    limit : float
        Ratio of times up to which the head is not too slow.
    """
    ratio, verdict = sampled(sampler, minimum, patience, lambda ratio: against(ratio, limit))
    return ratio, verdict if verdict is not GateVerdict.INCONCLUSIVE else finally_against(ratio, limit)


def canary(sampler: Sampler, *, minimum: int, patience: int, limit: float) -> tuple[Ratio, GateVerdict]:
    """Base against base: pass where they look equal, invalid where they differ, else inconclusive.

    Parameters
    ----------
    sampler : callable
        Measures so many log ratios of base to base.
    minimum, patience : int
        As in :func:`sampled`.
    limit : float
        Equal detectors have a ratio of times within 1 / ``limit`` and ``limit``.
    """
    return sampled(sampler, minimum, patience, lambda ratio: of_equals(ratio, limit))
