"""The rule by which two detectors are told apart in speed, and how it was chosen.

What is measured
----------------
A *turn* is the time of the next frames of a capture, one frame a call; a *block* is four turns in the order ABBA or,
the next time, BAAB. Its log ratio is that of the faster head to the faster base: drift of the machine meets both alike,
and a turn that was disturbed counts only where both were (with both cores busy, the interval was six times as wide for
the sums of the turns). Base and head go through the same frames.

Left out of a turn is the time in which other processes had the core, which Linux counts for each thread: with both
cores busy, that halved the scatter of blocks as long as a time slice (250 us a frame). Processor time would do the
same, but a head that sleeps or waits for a file would pass. What others did to the caches stays in.

* Two detectors of one environment live in one process. A sample is one block: 61 of them or more.
* Two environments live in two processes, on one core, that take turns at a command. Where a process happens to lie in
  memory makes it slower or faster by some per cent for all its life (1 % standard deviation on the machine that this
  was written on, one in twenty beyond 5 %), so a sample is the median block of two fresh processes: 5 pairs or more.

The rule
--------
The ratio is exp of the median sample, its interval the percentile bootstrap (95 %) of that median. With the limit L
(1.05 by default):

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
upper end below 5 % although the median is at 10 %.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.tools.gate.check import Verdict

Turn = Callable[[], float]
"""Takes the next turn of a detector, and returns its time in seconds."""

Sampler = Callable[[int], Sequence[float]]
"""Measures so many log ratios."""

RESAMPLES = 1000
TAILS = (0.025, 0.975)


@dataclass(frozen=True)
class Ratio:
    """How much slower one detector is than another.

    Attributes
    ----------
    value : float
        Time of the second over that of the first.
    low, high : float
        Ends of the 95 % interval.
    n : int
        Samples.
    """

    value: float
    low: float
    high: float
    n: int

    @classmethod
    def of(cls, log_ratios: FloatArray) -> Ratio:
        """Ratio of samples (n,): exp of their median, with its bootstrap interval; seeded."""
        drawn = np.random.default_rng(0).integers(len(log_ratios), size=(RESAMPLES, len(log_ratios)))
        low, high = np.quantile(np.median(log_ratios[drawn], axis=1), TAILS)
        return cls(math.exp(float(np.median(log_ratios))), math.exp(low), math.exp(high), len(log_ratios))

    def against(self, limit: float) -> Verdict:
        """Whether the second detector is slower than allowed; inconclusive where the interval holds the limit."""
        if self.low > limit:
            return Verdict.REGRESSION
        return Verdict.PASS if self.high <= limit else Verdict.INCONCLUSIVE

    def finally_against(self, limit: float) -> Verdict:
        """The same, with no more samples to come: the median decides where the interval is narrow enough."""
        clear = self.against(limit)
        if clear is not Verdict.INCONCLUSIVE or self.high - self.low > limit - 1:
            return clear
        return Verdict.REGRESSION if self.value > limit else Verdict.PASS

    def of_equals(self, limit: float) -> Verdict:
        """Whether two equal detectors look equal; invalid where they differ by more than the limit."""
        if self.low > limit or self.high < 1 / limit:
            return Verdict.INVALID
        return Verdict.PASS if 1 / limit <= self.low and self.high <= limit else Verdict.INCONCLUSIVE


def log_ratios(base: Turn, head: Turn, blocks: int) -> Sequence[float]:
    """Log ratios of blocks, in the orders ABBA and BAAB by turns."""
    return [_log_ratio(base, head) if number % 2 == 0 else -_log_ratio(head, base) for number in range(blocks)]


def _log_ratio(outer: Turn, inner: Turn) -> float:
    """Log ratio of the faster inner turn to the faster outer one."""
    first = outer()
    faster_inner = min(inner(), inner())
    return math.log(faster_inner / min(first, outer()))


def sampled(sampler: Sampler, minimum: int, patience: int, decide: Callable[[Ratio], Verdict]) -> tuple[Ratio, Verdict]:
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
        Verdict of a ratio so far; inconclusive asks for more.

    Returns
    -------
    ratio : Ratio
    verdict : Verdict
    """
    samples: list[float] = []
    goal = minimum
    while True:
        samples += sampler(goal - len(samples))
        ratio = Ratio.of(np.array(samples))
        verdict = decide(ratio)
        if verdict is not Verdict.INCONCLUSIVE or goal >= minimum * patience:
            return ratio, verdict
        goal = min(2 * goal, minimum * patience)


def compared(sampler: Sampler, *, minimum: int, patience: int, limit: float) -> tuple[Ratio, Verdict]:
    """Base against head, by the rule above."""
    ratio, verdict = sampled(sampler, minimum, patience, lambda found: found.against(limit))
    return ratio, verdict if verdict is not Verdict.INCONCLUSIVE else ratio.finally_against(limit)


def canary(sampler: Sampler, *, minimum: int, patience: int, limit: float) -> tuple[Ratio, Verdict]:
    """Base against base: pass where they look equal, invalid where they differ, else inconclusive."""
    return sampled(sampler, minimum, patience, lambda found: found.of_equals(limit))
