"""What a metric is: partial sums per capture that merge, and the value made of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal, TypeVar

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray, lock_fields

Kind = Literal["share", "ratio", "mean", "quantile", "positive", "other"]

_Value = TypeVar("_Value", float, FloatArray)


@dataclass(frozen=True)
class Outcome:
    """Result of matching one detector's output on one capture against the truth, in one scoring; read-only.

    A scoring that knows more has a subclass with further arrays, and says in ``per_frame`` and ``per_item`` what they
    are of: a capture is cut into blocks by these alone.

    Attributes
    ----------
    group : (frames,) int array
        Block of at least one second that each scored frame belongs to, counted from the start of the capture.
    tp, fp, fn : (frames,) int array
        Counts of each scored frame.
    error_frame : (retained,) int array
        Row, in the arrays above, of the frame of each retained detection.
    error_m : (retained,) float array
        Signed error of each retained detection against the object it belongs to; NaN where there is none.
    matched : (retained,) bool array
        Whether that detection counts as a true positive.
    duration_s : float
        Time covered by the scored frames.
    exhaustive : bool
        False where an unmatched detection proves nothing: precision is then undefined.
    per_frame : tuple of str
        Arrays whose first axis is the scored frames.
    per_item : mapping of str to tuple of str
        Arrays whose first axis is items of another kind, such as detections, by the array that names each item's row
        among the scored frames.
    of_run : bool
        Whether it is of a run as a whole. A run is then one piece of evidence, whatever scene it is of, and metrics of
        every scoring, which count detections, have no meaning.
    """

    of_run: ClassVar[bool] = False
    per_frame: ClassVar[tuple[str, ...]] = ("group", "tp", "fp", "fn")
    per_item: ClassVar[Mapping[str, tuple[str, ...]]] = {"error_frame": ("error_m", "matched")}

    group: IntArray
    tp: IntArray
    fp: IntArray
    fn: IntArray
    error_frame: IntArray
    error_m: FloatArray
    matched: BoolArray
    duration_s: float
    exhaustive: bool = True

    def __post_init__(self) -> None:
        lock_fields(self, self.per_frame)
        for row, names in self.per_item.items():
            lock_fields(self, (row, *names))


class Metric:
    """A number made of outcomes.

    ``partial`` condenses one outcome; partials of several captures, or of blocks of one, merge by adding
    (``merge = "sum"``) or stacking (``merge = "stack"``); ``value`` turns the merged partial into the number.
    All are pure functions of their arguments. What tables, charts, comparisons and leaderboards must know of a metric
    are the attributes below: none of them knows a metric by its name.

    A metric need not say what ``kind`` of number it is: its interval is then that of its values without one scene at a
    time. Saying so gives a better interval, an outer one too, and makes large boards fast.

    Attributes
    ----------
    of : type of Outcome
        Outcomes that it takes: :class:`Outcome`, which every scoring has, or what some scorings alone have. In tables
        of other scorings it has no column.
    title : str
        What people call it; empty: the name under which it is registered.
    unit : str
        SI unit of the value, such as ``m``; empty for a share.
    shown_as : (str, float, int) or None
        Unit in which people read it, factor to that unit, and decimals; None: metres as centimetres with one decimal,
        other units with two, shares with three.
    merge : {"sum", "stack"}
    better : {"higher", "lower", "zero"}
        Which end is better. Zero: neither, as for a signed error; such a metric never ranks.
    margin : float
        Difference that does not matter, in ``unit``: detectors that differ by less are practically equal.
    minimum_samples : int
        With fewer samples the value is undefined.
    needs_exhaustive_truth : bool
        Whether it is undefined where the truth does not name all that is visible, as unmatched detections count in it.
    default : bool
        Whether every run shows it; others are shown where an experiment lists them under ``metrics``.
    order : int
        Place among the columns of a table; equal ones stand in the order in which they are listed.
    brief : bool
        Whether a default one also stands in tables that must be narrow: in the terminal, and by channel and material.
    beside : str
        Registered name of the metric that it completes, as bias and scatter complete a mean absolute error: where
        tables are narrow it stands wherever that one does.
    headline : int or None
        Place among the few default ones that are charted; the first three of them are compared in pairs, and the first
        that can ranks. Of equal ones those come first that only this scoring has. None: not among them. Listed ones
        always are, and come first.
    kind : {"share", "ratio", "mean", "quantile", "positive", "other"}
        Which interval it has. A share (0...1), a ratio that is never negative, such as a mean absolute error or a rate,
        or a mean of either sign is a ratio of sums, whose ``parts`` it must give. A quantile, at ``level``, is that of
        the absolute samples that it stacks. Positive: any other number that is never negative.
    level : float
        Of a quantile: 0.95 for the 95th percentile.
    """

    of: ClassVar[type[Outcome]] = Outcome
    title: ClassVar[str] = ""
    unit: ClassVar[str] = ""
    shown_as: ClassVar[tuple[str, float, int] | None] = None
    merge: ClassVar[Literal["sum", "stack"]] = "sum"
    better: ClassVar[Literal["higher", "lower", "zero"]] = "higher"
    margin: ClassVar[float] = 0.01
    minimum_samples: ClassVar[int] = 1
    needs_exhaustive_truth: ClassVar[bool] = False
    default: ClassVar[bool] = False
    order: ClassVar[int] = 100
    brief: ClassVar[bool] = True
    beside: ClassVar[str] = ""
    headline: ClassVar[int | None] = None
    kind: ClassVar[Kind] = "other"
    level: ClassVar[float] = math.nan

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Array (k,) that adds up, or samples, (n,) or (n, k), that stack."""
        raise NotImplementedError

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Number made of a merged partial; NaN where it is undefined."""
        raise NotImplementedError

    @classmethod
    def scale(cls) -> tuple[str, float, int]:
        """Unit in which people read the value, factor to it, and decimals."""
        usual = {"": ("", 1.0, 3), "m": ("cm", 100.0, 1)}
        return cls.shown_as or usual.get(cls.unit, (cls.unit, 1.0, 2))

    @classmethod
    def merit(cls, value: _Value) -> _Value:
        """Number that is larger where the value is better."""
        if cls.better == "zero":
            return -abs(value)
        return value if cls.better == "higher" else -value

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """Numerator and denominator whose sums, over partials, make the value; of a share, a ratio or a mean."""
        raise NotImplementedError

    @classmethod
    def most(cls, partial: FloatArray) -> float:  # noqa: ARG003 - of any
        """Largest magnitude that a scene's value can have, by all partials merged; NaN: no bound is known.

        Of a ratio or a mean: their outer intervals need it.
        """
        return math.nan
