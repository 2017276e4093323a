"""What a metric is: partial sums per capture that merge, and the value made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Outcome:
    """Result of matching one detector's output on one capture against the truth, in one scoring.

    Attributes
    ----------
    group : (frames,) int array
        Resampling group of each scored frame: a block of at least one second, as single frames are correlated.
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
    """

    group: IntArray
    tp: IntArray
    fp: IntArray
    fn: IntArray
    error_frame: IntArray
    error_m: FloatArray
    matched: BoolArray
    duration_s: float
    exhaustive: bool = True


class Metric:
    """A number made of outcomes.

    ``partial`` condenses one outcome; partials of several captures, or of resampled groups, merge by adding
    (``merge = "sum"``) or stacking (``merge = "stack"``); ``value`` turns the merged partial into the number.
    All are pure functions of their arguments.
    """

    unit: ClassVar[str] = ""
    merge: ClassVar[Literal["sum", "stack"]] = "sum"
    better: ClassVar[Literal["higher", "lower", "zero"]] = "higher"
    minimum_samples: ClassVar[int] = 1

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Array (k,) that adds up, or samples (n,) that stack."""
        raise NotImplementedError

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Number made of a merged partial; NaN where it is undefined."""
        raise NotImplementedError

    @classmethod
    def resampled(cls, partials: Sequence[FloatArray], counts: FloatArray) -> FloatArray:
        """Values of many resamples of the same groups; override it where there is a faster way to the same numbers.

        Parameters
        ----------
        partials : sequence of array
            Partial of each group.
        counts : (resamples, groups) array
            How often each group was drawn: whole numbers, held as floats.

        Returns
        -------
        (resamples,) array
        """
        if cls.merge == "sum":
            return np.array([cls.value(merged) for merged in counts @ np.stack(partials)])
        drawn = (np.repeat(np.arange(len(partials)), row) for row in counts.astype(np.int64))
        return np.array([cls.value(np.concatenate([partials[group] for group in groups.tolist()])) for groups in drawn])
