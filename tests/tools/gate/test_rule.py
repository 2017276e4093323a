"""The rule that tells two detectors apart in speed."""

import itertools
import math

import numpy as np
import pytest

from uwbbench.measure.latency.ratio import Ratio
from uwbbench.tools.gate.check import GateVerdict
from uwbbench.tools.gate.rule import against, canary, compared, finally_against

LIMIT = 1.05


def noisy(ratio: float, seed: int, spread: float = 0.02, interrupted: float = 0.1):
    """Samples of a ratio on a machine that is interrupted now and then."""
    rng = np.random.default_rng(seed)

    def sample() -> float:
        disturbance = rng.choice([-1.0, 1.0]) * rng.exponential(0.5) if rng.random() < interrupted else 0.0
        return math.log(ratio) + rng.normal(0, spread) + disturbance

    return lambda count: [sample() for _ in range(count)]


def rule(sampler, minimum: int = 31, patience: int = 4) -> GateVerdict:
    return compared(sampler, minimum=minimum, patience=patience, limit=LIMIT)[1]


def test_equal_detectors_raise_no_alarm_and_ten_per_cent_are_caught() -> None:
    # Another verdict needs 16 of 31 samples beyond a limit that one in 20 passes: 6e-13.
    assert all(rule(noisy(1.0, seed)) is GateVerdict.PASS for seed in range(100))
    assert sum(rule(noisy(1.10, seed)) is GateVerdict.REGRESSION for seed in range(100)) >= 99


def test_few_pairs_of_processes_with_an_outlier_decide_as_well() -> None:
    # An alarm needs five samples of five to be interrupted upwards: 1e-7 each, and 1e-15 for three of 200.
    assert sum(rule(noisy(1.0, s, 0.01, 0.08), 5) is GateVerdict.REGRESSION for s in range(200)) <= 2
    assert sum(rule(noisy(1.10, s, 0.01, 0.08), 5) is GateVerdict.REGRESSION for s in range(200)) >= 190


def test_a_faster_head_passes() -> None:
    assert rule(noisy(0.5, 0)) is GateVerdict.PASS


def alternating(ratio: float, spread: float):
    """Samples of a ratio that lie above and below it in turn."""
    samples = itertools.cycle([math.log(ratio) - spread, math.log(ratio) + spread])
    return lambda count: [next(samples) for _ in range(count)]


def test_scatter_that_hides_the_limit_is_inconclusive_after_all_patience() -> None:
    ratio, verdict = compared(alternating(1.05, spread=1.0), minimum=31, patience=4, limit=LIMIT)
    assert verdict is GateVerdict.INCONCLUSIVE
    assert ratio.n == 4 * 31


def test_a_narrow_interval_around_the_limit_is_decided_by_the_median() -> None:
    over, under = Ratio(1.051, 1.04, 1.06, 99), Ratio(1.049, 1.04, 1.06, 99)
    assert against(over, LIMIT) is against(under, LIMIT) is GateVerdict.INCONCLUSIVE
    assert finally_against(over, LIMIT) is GateVerdict.REGRESSION
    assert finally_against(under, LIMIT) is GateVerdict.PASS


def test_clear_samples_are_not_added_to() -> None:
    ratio, verdict = compared(noisy(1.5, 1), minimum=31, patience=4, limit=LIMIT)
    assert (ratio.n, verdict) == (31, GateVerdict.REGRESSION)


@pytest.mark.parametrize(
    ("ratio", "verdict"),
    [(1.0, GateVerdict.PASS), (1.2, GateVerdict.INVALID), (1 / 1.2, GateVerdict.INVALID)],
)
def test_a_base_that_differs_from_itself_in_either_direction_is_invalid(ratio: float, verdict: GateVerdict) -> None:
    assert canary(noisy(ratio, 5), minimum=31, patience=2, limit=LIMIT)[1] is verdict


def test_a_base_that_scatters_around_itself_is_inconclusive() -> None:
    assert canary(alternating(1.0, spread=2.0), minimum=31, patience=2, limit=LIMIT)[1] is GateVerdict.INCONCLUSIVE
