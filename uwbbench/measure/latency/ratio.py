"""How much slower one program is than another: programs that take turns, and the ratio of their times.

Absolute times differ between machines, and on one machine from minute to minute. Programs that take turns within
milliseconds meet the same clock, the same neighbours and the same temperature, so that the ratio of their times keeps
what the programs are and loses what the machine did. Everything that compares times does it here: the ratio to a
reference of a run, the regression gate, and the benchmark of uwbbench itself.

Conventions
-----------
* A *turn* is the time of some work. A *block* is all programs in turn, and then all in reverse order: ABBA for two, so
  that a drift within the block meets both alike. The next block begins with the other end (BAAB): whoever starts bears
  what happened before, such as caches that another process has emptied.
* A program's time in a block is its faster turn. Disturbances only ever make a turn longer, so a block is disturbed
  only where both turns of a program were: with three turns in ten disturbed, the interval of 100 blocks is a third as
  wide as that of the sums of the turns. Both turns must be of the same work.
* The ratio is exp of the median over blocks of the log ratio: the typical block.
* Its interval (95 %) is that of the median by order statistics, which supposes nothing of the distribution: with n
  blocks, the k-th smallest and the k-th largest log ratio, k being the largest number for which a binomial variable of
  n trials with probability 1/2 is below k in at most 2.5 % of all cases (David and Nagaraja, Order Statistics, 2003,
  section 7.1). Blocks are the samples, as calls within one are correlated. With fewer than six blocks these are the
  extremes, which hold the ratio in 1 - 2^(1 - n) of all cases: 94 % for five, 75 % for three.
* The percentile bootstrap of the median, in place of it, is too narrow for few blocks: under drift and interruptions
  that are simulated, it holds the ratio in 87 % of all cases with seven blocks and in 92 % with nine or fifteen; order
  statistics hold it in 95 % or more from five to 244.
* Rare expensive work is not part of a typical block. The ratio of all time together, in which it counts as much as it
  takes, is given beside it (:func:`ratio_summary`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from uwbbench.api.arrays import FloatArray

Turn = Callable[[], float]
"""Takes the next turn of a program, and returns its time in seconds."""

MINIMUM_BLOCKS = 8
"""Fewer blocks than this give no interval of all time."""

TAIL_CASES = 40
"""One case in so many lies beyond each end of an interval."""


def alternate(programs: Sequence[Turn], blocks: int) -> FloatArray:
    """Let programs take turns, forwards and backwards in each block, beginning at either end by turns.

    Parameters
    ----------
    programs : sequence of callable
        Each takes its next turn, and returns its time in seconds.
    blocks : int

    Returns
    -------
    (blocks, programs, 2) array
        Both turns of each program in each block, in seconds.
    """
    times_s = np.empty((blocks, len(programs), 2))
    forwards = tuple(range(len(programs)))
    for block in range(blocks):
        order = forwards if block % 2 == 0 else forwards[::-1]
        for turn, sequence in enumerate((order, order[::-1])):
            for program in sequence:
                times_s[block, program, turn] = programs[program]()
    return times_s


def log_ratios(slower_s: FloatArray, faster_s: FloatArray) -> FloatArray:
    """Log ratios (blocks,) of the times (blocks, 2) of two programs, first over second."""
    return np.asarray(np.log(slower_s.min(axis=1) / faster_s.min(axis=1)))


@dataclass(frozen=True)
class Ratio:
    """How much slower one program is than another.

    Attributes
    ----------
    value : float
        Time of the first over that of the second.
    low, high : float
        Ends of the 95 % interval.
    n : int
        Samples: blocks, or medians of blocks.
    """

    value: float
    low: float
    high: float
    n: int

    @classmethod
    def of(cls, log_ratios: ArrayLike) -> Ratio:
        """Ratio of samples (n,), one or more: exp of their median, with its interval."""
        value, low, high = map(math.exp, median_interval(log_ratios))
        return cls(value, low, high, np.size(log_ratios))


def median_interval(samples: ArrayLike) -> tuple[float, float, float]:
    """Median of samples (n,), one or more, and the ends of its 95 % interval by order statistics.

    Examples
    --------
    >>> median_interval([3.0, 1.0, 2.0, 5.0, 4.0])
    (3.0, 1.0, 5.0)
    """
    ordered = np.sort(np.asarray(samples, dtype=np.float64))
    beyond = _beyond(len(ordered))
    return float(np.median(ordered)), float(ordered[beyond]), float(ordered[-1 - beyond])


@cache
def _beyond(n: int) -> int:
    """How many of n samples lie beyond each end of the interval of their median."""
    below, cases, all_cases = 0, 1, 1  # so many samples lie below the median; of 2^n cases, in that many or in fewer
    while all_cases * TAIL_CASES <= 2**n:
        below += 1
        cases = cases * (n - below + 1) // below
        all_cases += cases
    return max(0, below - 1)


def ratio_summary(ours_s: FloatArray, reference_s: FloatArray, resamples: int = 1000) -> dict[str, Any]:
    """Ratio of two programs, as a run stores it.

    Parameters
    ----------
    ours_s, reference_s : (blocks, 2) array
        Times of both turns.
    resamples : int
        Draws of the bootstrap over blocks; seeded.

    Returns
    -------
    dict
        ``ratio``: the typical block. ``total_ratio``: all turns together, in which rare expensive work counts as much
        as it takes. Each with ``low`` and ``high`` (``total_low``, ``total_high``), the ends of its 95 % interval, the
        latter a percentile bootstrap over blocks; None below eight blocks. ``blocks``: their number.
    """
    ratio = Ratio.of(log_ratios(ours_s, reference_s))
    ours, reference = ours_s.sum(axis=1), reference_s.sum(axis=1)
    ends: list[float | None] = [None] * 4
    if ratio.n >= MINIMUM_BLOCKS:
        drawn = np.random.default_rng(0).integers(ratio.n, size=(resamples, ratio.n))
        total = ours[drawn].sum(axis=1) / reference[drawn].sum(axis=1)
        ends = [ratio.low, ratio.high, *map(float, np.quantile(total, [0.025, 0.975]))]
    return {
        "ratio": ratio.value,
        "low": ends[0],
        "high": ends[1],
        "total_ratio": float(ours.sum() / reference.sum()),
        "total_low": ends[2],
        "total_high": ends[3],
        "blocks": ratio.n,
    }
