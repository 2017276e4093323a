"""How the targets are measured and shown: contenders that take turns, ratios with intervals, one table.

Conventions
-----------
* Contenders take turns in one process; turns, ratios and intervals are those of :mod:`uwbbench.measure.latency.ratio`,
  a round being a block.
* Times are processor times, which other programs on the machine hardly change; elapsed times where threads or processes
  work side by side, and for single calls.
* A time is the median over the rounds of the faster turn. The interval of what is no median, such as an exponent, is
  the central 95 % of its values for resampled rounds.
* Everything runs pinned to one core unless a target is about two, with the garbage collector off.
* Contenders must agree before they are timed: a :class:`Disagreement` ends the benchmark with exit code 1, whereas a
  missed target does not.
* A part of the benchmark is a function ``rows(effort)`` of its module, which yields rows as they are measured.
"""

from __future__ import annotations

import gc
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from uwbbench.api import FloatArray
from uwbbench.measure.latency.ratio import Ratio, Turn, alternate, median_interval

RESAMPLES = 2000
TURN_S = 0.02
"""A contender that is done sooner runs again within its turn, ``MOST_REPEATS`` times at most."""
MOST_REPEATS = 20

Run = Callable[[], object]
Clock = Callable[[], float]


class Disagreement(AssertionError):
    """Two contenders gave different answers, so that their times mean nothing."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is spent on the measurement.

    Attributes
    ----------
    quick : bool
        Few rounds on few frames, to see that everything runs and agrees; the times mean little.
    paced_s : float
        Length of the run at the radar's rate.
    gates : int
        Repetitions of each regression gate.
    """

    quick: bool = False
    paced_s: float = 5.0
    gates: int = 10

    def rounds(self, usual: int) -> int:
        """Rounds of a comparison."""
        return 3 if self.quick else usual

    def frames(self, usual: int) -> int:
        """Frames of a capture."""
        return min(usual, 600) if self.quick else usual


@dataclass(frozen=True)
class Interval:
    """A value and the ends of its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes
    ----------
    target : str
        What is asked for.
    required : str
        The limit, as it is printed; empty where the figure is for information.
    value, low, high : float
        Measured, with its interval; NaN ends where there is only one measurement.
    unit : str
    met : bool or None
        None where nothing is required or nothing could be measured.
    note : str
    """

    target: str
    required: str
    value: float
    low: float = math.nan
    high: float = math.nan
    unit: str = ""
    met: bool | None = None
    note: str = ""


def at_least(target: str, limit: float, found: Interval, unit: str = "times", note: str = "") -> Row:
    """A value that must reach a limit."""
    met = found.value >= limit
    return Row(target, f">= {limit:g}", found.value, found.low, found.high, unit, met, note)


def at_most(target: str, limit: float, found: Interval, unit: str = "times", note: str = "") -> Row:
    """A value that must not exceed a limit."""
    met = found.value <= limit
    return Row(target, f"<= {limit:g}", found.value, found.low, found.high, unit, met, note)


def told(target: str, found: Interval, unit: str, note: str = "") -> Row:
    """A figure for information."""
    return Row(target, "", found.value, found.low, found.high, unit, None, note)


def missing(target: str, required: str, why: str) -> Row:
    """A target that cannot be measured here."""
    return Row(target, required, math.nan, note=why)


def interleaved(
    contenders: Mapping[str, Callable[[], Run]], rounds: int, cores: int = 1, clock: Clock = process_time
) -> dict[str, FloatArray]:
    """Seconds (rounds,) of each contender's faster turn.

    Parameters
    ----------
    contenders : mapping of name to function
        Each prepares one run, untimed (fresh frames, an opened stream), and returns what is timed.
    rounds : int
        Behind one untimed round that warms everything up.
    cores : int
        That the process may use.
    clock : function
        ``perf_counter`` where threads or other processes take part.
    """
    with alone(cores):
        turns: list[Turn] = []
        for prepare in contenders.values():
            _seconds(prepare, clock)  # imports and compiles
            repeats = max(1, min(MOST_REPEATS, round(TURN_S / _seconds(prepare, clock))))
            turns.append(partial(_turn, prepare, clock, repeats))
        faster_s = alternate(turns, rounds).min(axis=2)
    return dict(zip(contenders, faster_s.T, strict=True))


def _turn(prepare: Callable[[], Run], clock: Clock, repeats: int) -> float:
    return float(np.mean([_seconds(prepare, clock) for _ in range(repeats)]))


def _seconds(prepare: Callable[[], Run], clock: Clock) -> float:
    run = prepare()
    start = clock()
    run()
    return clock() - start


def median(values: ArrayLike) -> Interval:
    """Median over the rounds."""
    return Interval(*median_interval(values))


def once(value: float) -> Interval:
    """A figure that was measured once, and has no interval."""
    return Interval(value, math.nan, math.nan)


def ratio(slow: FloatArray, fast: FloatArray) -> Interval:
    """How many times longer one took than the other."""
    found = Ratio.of(np.log(slow / fast))
    return Interval(found.value, found.low, found.high)


def exponent(sizes: Sequence[int], seconds: FloatArray) -> Interval:
    """Power of the size with which times (rounds, sizes) grow: slope of the straight line through both logarithms."""
    return resampled(seconds, lambda drawn: np.polyfit(np.log(sizes), np.log(np.median(drawn, axis=0)), 1)[0])


def resampled(table: FloatArray, statistic: Callable[[FloatArray], float]) -> Interval:
    """Statistic of a table, with its interval over resampled rows."""
    rng = np.random.default_rng(0)
    draws = [statistic(table[rng.integers(len(table), size=len(table))]) for _ in range(RESAMPLES)]
    low, high = np.quantile(draws, [0.025, 0.975])
    return Interval(float(statistic(table)), float(low), float(high))


@contextmanager
def alone(cores: int = 1) -> Iterator[None]:
    """Keep this process on so many cores, and the garbage collector out of it."""
    before = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
    if before:
        os.sched_setaffinity(0, sorted(before)[-cores:])  # interrupts tend to be served by the first
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()
        if before:
            os.sched_setaffinity(0, before)


def line(row: Row) -> str:
    """A row as people read it."""
    verdict = {True: "met", False: "MISSED", None: ""}[row.met]
    interval = "" if math.isnan(row.low) else f"[{_short(row.low)}, {_short(row.high)}]"
    measured = "-" if math.isnan(row.value) else f"{_short(row.value)} {row.unit}"
    return f"{row.target:<62} {row.required:>8} {measured:>15} {interval:<18} {verdict:<6} {row.note}".rstrip()


def heading() -> str:
    """The names of the columns."""
    return f"{'target':<62} {'required':>8} {'measured':>15} {'95 % interval':<18} {'':<6} note"


def plain(row: Row) -> dict[str, Any]:
    """A row for programs; what is not a number becomes null."""
    return {
        name: None if isinstance(value, float) and math.isnan(value) else value for name, value in asdict(row).items()
    }


def _short(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
