"""Where the errors of detectors come from, captures added up, and what each cause costs.

Conventions
-----------
* Causes and kinds are those of :mod:`uwbbench.measure.accuracy.causes`, as each unit stored them. Captures whose causes
  are not stored, as earlier versions did not, are left out and counted.
* If a cause were gone, its misses would be true detections, and false ones of its kind would not be there. Causes are
  taken away one at a time; gains do not add up.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from uwbbench.measure.accuracy.metrics.detection import F1
from uwbbench.measure.accuracy.rules import has_causes
from uwbbench.results.results import Scored
from uwbbench.results.slices import Board
from uwbbench.run.folder.scored import causes_of

Error = Literal["missed", "false"]


@dataclass(frozen=True)
class Cost:
    """What one cause costs.

    Attributes
    ----------
    error : {"missed", "false"}
    cause : str
        Cause of misses, or kind of false detections.
    count : int
    f1 : float
        F1 if it were gone; NaN where F1 is undefined.
    gain : float
        By how much that is more.
    """

    error: Error
    cause: str
    count: int
    f1: float
    gain: float


@dataclass(frozen=True)
class ErrorCauses:
    """Errors of one detector on one board.

    Attributes
    ----------
    board : Board
    detector : str
    captures, unknown : int
        Captures whose causes are stored, and those of which they are not known.
    tp, fp, fn : int
        Of the former.
    misses, false, set_aside : mapping of str to int
    exhaustive : bool
    """

    board: Board
    detector: str
    captures: int
    unknown: int
    tp: int
    fp: int
    fn: int
    misses: Mapping[str, int]
    false: Mapping[str, int]
    set_aside: Mapping[str, int]
    exhaustive: bool

    @property
    def f1(self) -> float:
        """F1 as it is."""
        return self._f1(self.tp, self.fp, self.fn)

    @property
    def costs(self) -> list[Cost]:
        """Every cause and kind, the one that costs most first."""
        costs = [
            self._cost("missed", cause, count, self._f1(self.tp + count, self.fp, self.fn - count))
            for cause, count in self.misses.items()
        ]
        costs += [
            self._cost("false", kind, count, self._f1(self.tp, self.fp - count, self.fn))
            for kind, count in self.false.items()
        ]
        return sorted(costs, key=lambda cost: (-np.nan_to_num(cost.gain), -cost.count, cost.error, cost.cause))

    def _cost(self, error: Error, cause: str, count: int, f1: float) -> Cost:
        return Cost(error, cause, count, f1, f1 - self.f1)

    def _f1(self, tp: int, fp: int, fn: int) -> float:
        return F1.value(np.array([tp, fp, fn], float)) if self.exhaustive else math.nan

    def to_dict(self) -> dict[str, Any]:
        """Plain values; an undefined F1 is NaN."""
        names = ("detector", "captures", "unknown", "tp", "fp", "fn", "f1", "exhaustive")
        return {
            **dict(zip(("dataset", "source", "scoring", "table"), self.board, strict=True)),
            **{name: getattr(self, name) for name in names},
            "set_aside": dict(self.set_aside),
            "causes": [vars(cost) for cost in self.costs],
        }


def error_causes(scored: Sequence[Scored]) -> list[ErrorCauses]:
    """Causes of each detector on each board, in the order in which they come."""
    groups: dict[tuple[Board, str], list[Scored]] = defaultdict(list)
    for one in scored:
        groups[(one.dataset, one.source, one.scoring, one.table), one.detector].append(one)
    return [made for (board, detector), members in groups.items() for made in _pooled(board, detector, members)]


def causes_lack(scored: Sequence[Scored]) -> bool:
    """Whether errors could have causes, and none is stored."""
    able = [one for one in scored if has_causes(one.scoring)]
    return bool(able) and all(causes_of(one.numbers) is None for one in able)


def _pooled(board: Board, detector: str, members: Sequence[Scored]) -> Iterator[ErrorCauses]:
    """Nothing where no capture has its causes stored."""
    known = [(one, made) for one in members if (made := causes_of(one.numbers)) is not None]
    if known:
        misses, false, aside = Counter[str](), Counter[str](), Counter[str]()
        for _, made in known:
            misses.update(made.misses)
            false.update(made.false)
            aside.update(made.set_aside)
        tp, fp, fn = (sum(int(one.numbers[name]) for one, _ in known) for name in ("tp", "fp", "fn"))
        exhaustive = all(one.outcome.exhaustive for one, _ in known)
        captures = len(known), len(members) - len(known)
        yield ErrorCauses(board, detector, *captures, tp, fp, fn, misses, false, aside, exhaustive)
