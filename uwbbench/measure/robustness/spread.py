"""Hard statistics: the errors that a detector is judged by, far from zero."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from uwbbench.api.case import Evidence, Violation, hard_case
from uwbbench.measure.accuracy.metrics.error import StandardDeviation
from uwbbench.measure.robustness.subject import Subject


@hard_case("equal")
def standard_deviation_far_from_zero(subject: Subject) -> Evidence:  # noqa: ARG001  (all detectors share the metric)
    """The spread of errors around 1e8 m is exact to 1e-7, where the difference of two sums of squares has no digit.

    A property of the framework, so that every detector is judged rightly. The reference is rational arithmetic.
    """
    errors_m = 1e8 + np.random.default_rng(31).normal(size=400)
    exact = [Fraction(value) for value in errors_m.tolist()]
    mean = sum(exact) / len(exact)
    expected = math.sqrt(sum((value - mean) ** 2 for value in exact) / len(exact))
    computed = StandardDeviation.value(errors_m)
    if not abs(computed - expected) <= 1e-7 * expected:
        raise Violation(f"standard deviation {computed}, exactly {expected}")
    return Evidence(f"{computed:.6f} m, {abs(computed - expected):.1g} m off")
