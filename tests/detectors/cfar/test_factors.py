"""Threshold factors against published values, integrals, gamma functions and sampling."""

import mpmath
import numpy as np
import pytest
from scipy import integrate, stats

from uwbbench.api import ConfigError
from uwbbench_detectors.cfar.factors import TrainingWindow, filter_correlation, order_rank, threshold_factor

RATES = (1e-2, 1e-3, 1e-4)
KNOWN = {
    ("ca", 8): (6.23, 10.97, 17.30),
    ("ca", 12): (5.61, 9.34, 13.85),
    ("ca", 16): (5.34, 8.64, 12.45),
    ("go", 8): (5.09, 9.07, 14.41),
    ("go", 12): (4.73, 7.95, 11.89),
    ("go", 16): (4.58, 7.49, 10.87),
    ("so", 8): (10.89, 22.70, 43.56),
    ("so", 12): (8.33, 15.23, 25.24),
    ("so", 16): (7.31, 12.60, 19.56),
    ("os", 8): (5.87, 11.09, 18.78),
    ("os", 12): (4.86, 8.47, 13.17),
    ("os", 16): (4.43, 7.42, 11.08),
}
"""Factors for independent cells, by statistic and N, at the rates above."""


def window(total, sides=2, guard=2):
    return TrainingWindow(total // sides, sides, guard)


@pytest.mark.parametrize(("statistic", "total"), KNOWN)
def test_factors_for_independent_cells_are_the_known_ones(statistic, total):
    factors = [threshold_factor(statistic, window(total), rate) for rate in RATES]
    assert factors == pytest.approx(KNOWN[statistic, total], abs=0.0051)


@pytest.mark.parametrize(("total", "known"), [(8, 13.35), (12, 10.94), (16, 9.84)])
def test_factors_of_averaging_in_filtered_noise_are_the_known_ones(total, known):
    assert threshold_factor("ca", window(total), 1e-3, bandwidth_samples=0.5) == pytest.approx(known, rel=0.003)


@pytest.mark.parametrize("rate", [0.1, 1e-3, 1e-9])
@pytest.mark.parametrize("total", [1, 6, 64])
def test_averaging_has_its_closed_form(total, rate):
    factor = threshold_factor("ca", window(total, sides=1), rate)
    assert factor == pytest.approx(total * (rate ** (-1 / total) - 1), rel=1e-9)


@pytest.mark.parametrize("rate", [1e-2, 1e-4, 1e-8])
@pytest.mark.parametrize("half", [1, 4, 16])
@pytest.mark.parametrize("statistic", ["go", "so"])
def test_greatest_and_smallest_of_give_their_rates_by_integration(statistic, half, rate):
    factor = threshold_factor(statistic, window(2 * half), rate)
    mean = stats.gamma(half, scale=1 / half)
    other = mean.cdf if statistic == "go" else mean.sf

    def alarm(z):
        return 2 * mean.pdf(z) * other(z) * np.exp(-factor * z)

    found, _ = integrate.quad(alarm, 0, 40 / factor, epsabs=0, epsrel=1e-10, limit=500)
    assert found == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize("rate", [1e-2, 1e-6, 1e-12])
@pytest.mark.parametrize(("total", "rank"), [(2, 0.5), (12, 0.75), (16, 1.0), (64, 0.9)])
def test_order_statistics_give_their_rates_by_gamma_functions(total, rank, rate):
    factor = mpmath.mpf(threshold_factor("os", window(total), rate, rank))
    k = order_rank(rank, total)
    with mpmath.workdps(40):
        above = mpmath.gammaprod([total + 1, factor + total - k + 1], [total - k + 1, factor + total + 1])
    assert float(above) == pytest.approx(rate, rel=1e-8)


@pytest.mark.parametrize(("rank", "cells", "place"), [(0.75, 12, 9), (0.75, 6, 4), (0.01, 4, 1), (1.0, 5, 5)])
def test_the_rank_is_rounded_and_stays_among_the_cells(rank, cells, place):
    assert order_rank(rank, cells) == place


def test_on_one_side_greatest_smallest_and_mean_are_the_same():
    assert len({threshold_factor(s, window(6, sides=1), 1e-3, bandwidth_samples=0.5) for s in ("ca", "go", "so")}) == 1


@pytest.mark.slow
@pytest.mark.parametrize("statistic", ["ca", "go", "so", "os"])
@pytest.mark.parametrize("total", [2, 8, 12, 16])
def test_factors_for_filtered_noise_are_those_for_independent_cells_where_the_filter_leaves_no_correlation(
    statistic, total
):
    # With one sample a symbol the raised cosine is zero at every lag but 0. Six standard errors of sampled factors.
    filtered = threshold_factor(statistic, window(total), 1e-3, bandwidth_samples=1.0)
    exact = {"ca": 1e-7, "so": 1e-3, "go": 0.006, "os": 0.015}[statistic]
    assert filtered == pytest.approx(threshold_factor(statistic, window(total), 1e-3), rel=exact)


@pytest.mark.parametrize("bandwidth_samples", [0.3, 0.5, 0.9])
def test_the_correlation_of_the_noise_is_the_transform_of_the_filter_s_power(bandwidth_samples):
    def power(frequency):  # root-raised-cosine of symbol time 1, squared; constant to 0.25, cosine flank to 0.75
        return 1.0 if frequency <= 0.25 else 0.5 * (1 + np.cos(np.pi * (frequency - 0.25) / 0.5))

    lags = np.arange(7)
    expected = [
        2
        * integrate.quad(
            lambda f, t=lag * bandwidth_samples: power(f) * np.cos(2 * np.pi * f * t), 0, 0.75, points=[0.25]
        )[0]
        for lag in lags
    ]
    np.testing.assert_allclose(filter_correlation(lags, bandwidth_samples), expected, atol=1e-9)


def test_a_500_mhz_filter_correlates_neighbours_at_1_ns_by_0_60():
    np.testing.assert_allclose(filter_correlation(np.array([0, 1, 2, 3]), 0.5), [1, 0.60, 0, -0.12], atol=5e-3)


def test_training_cells_that_follow_the_tested_one_too_closely_are_refused():
    with pytest.raises(ConfigError, match=r"cfar.os: .*raise 'guard_taps'"):
        threshold_factor("os", window(12, guard=0), 1e-3, bandwidth_samples=0.5)
