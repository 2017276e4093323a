"""How shares, values and differences become verdicts."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from uwbbench.measure.accuracy.stats import Difference, Estimate, clopper_pearson
from uwbbench.tools.gate.accuracy import _compared, _limited
from uwbbench.tools.gate.check import Check, GateVerdict
from uwbbench.tools.gate.config import AccuracyModel, DeadlineModel
from uwbbench.tools.gate.deadline import share_verdict

CHECK = Check(kind="accuracy", name="", verdict=GateVerdict.INVALID, quantity="F1")


def rule(**limits: object) -> AccuracyModel:
    return AccuracyModel.model_validate({"metric": "f1", "scoring": "frame", **limits})


@given(st.integers(1, 5000), st.data(), st.floats(0.0, 0.2))
def test_a_share_is_decided_where_an_exact_test_decides_it(n: int, data, limit: float) -> None:
    missed = data.draw(st.integers(0, n))
    settings = DeadlineModel(maximum_missed_share=limit)
    verdict = share_verdict(missed, *clopper_pearson(missed, n), settings)
    more = binomtest(missed, n, limit, alternative="greater").pvalue
    fewer = binomtest(missed, n, limit, alternative="less").pvalue
    if min(abs(more - 0.025), abs(fewer - 0.025)) < 1e-6:
        return
    if more < 0.025:
        assert verdict is GateVerdict.REGRESSION
    elif fewer < 0.025 or (limit == 0 and missed == 0):
        assert verdict is GateVerdict.PASS
    else:
        assert verdict is GateVerdict.INCONCLUSIVE


def estimate(value: float, n: int = 100) -> Estimate:
    return Estimate(value, value - 0.05, value + 0.05, n, 10)


@pytest.mark.parametrize(
    ("limits", "value", "verdict"),
    [
        ({"minimum": 0.9}, 0.9, GateVerdict.PASS),
        ({"minimum": 0.9}, 0.899, GateVerdict.REGRESSION),
        ({"maximum": 0.1}, 0.1, GateVerdict.PASS),
        ({"maximum": 0.1}, 0.101, GateVerdict.REGRESSION),
    ],
)
def test_a_fixed_limit_is_inclusive_and_held_against_the_value(limits, value, verdict) -> None:
    assert _limited(CHECK, rule(**limits), estimate(value)).verdict is verdict


def test_an_undefined_value_is_invalid_and_too_few_samples_are_inconclusive() -> None:
    nothing = _limited(CHECK, rule(minimum=0.9), Estimate(math.nan, math.nan, math.nan, 0, 0))
    few = _limited(CHECK, rule(minimum=0.9), Estimate(math.nan, math.nan, math.nan, 5, 9))
    assert (nothing.verdict, nothing.value) == (GateVerdict.INVALID, None)
    assert few.verdict is GateVerdict.INCONCLUSIVE
    assert few.advice


def difference(value: float, half: float, groups: int = 10) -> Difference:
    return Difference(value, value - half, value + half, 100, groups)


@pytest.mark.parametrize("better", ["higher", "lower"])
@pytest.mark.parametrize(
    ("loss", "half", "tolerance", "verdict"),
    [
        (0.00, 0.00, 0.00, GateVerdict.PASS),
        (-0.2, 0.01, 0.00, GateVerdict.PASS),
        (0.02, 0.03, 0.00, GateVerdict.PASS),
        (0.02, 0.01, 0.00, GateVerdict.REGRESSION),
        (0.02, 0.01, 0.02, GateVerdict.PASS),
        (0.04, 0.01, 0.02, GateVerdict.REGRESSION),
        (0.02, math.nan, 0.0, GateVerdict.INCONCLUSIVE),
        (-0.2, math.nan, 0.0, GateVerdict.PASS),
    ],
)
def test_a_loss_counts_beyond_its_interval_and_the_tolerance(better, loss, half, tolerance, verdict) -> None:
    value = -loss if better == "higher" else loss
    found = difference(value, half)
    judged = _compared(CHECK, rule(no_worse_than="run", tolerance=tolerance), better, found)
    assert judged.verdict is verdict
    assert judged.bound == ("minimum" if better == "higher" else "maximum")
