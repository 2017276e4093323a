"""Threshold factors of the CFAR detectors: what the noise estimate is multiplied by for a false-alarm rate.

A cell is an alarm where ``|x|^2 > factor * z``, with ``z`` estimated from ``sides`` groups of ``n`` training cells
each. All rates are for complex Gaussian noise.

For independent cells the rate is a closed expression of the factor. For noise that the receiver's filter has
correlated, cell averaging still has one: the rate is the probability that an indefinite quadratic form of Gaussians is
positive. GO and OS are no quadratic forms; there the rate is an average over random directions of the training cells
of a probability known in closed form for each direction. Its sampling error is 0.3 % of the rate for GO; for OS it is 1
% at 1e-3 and 10 % at 1e-6 (0.1 dB of the factor). SO follows from the other two: an alarm of SO is one against either
side, an alarm of GO one against both, so ``P_SO + P_GO`` is twice the rate of cell averaging on one side.

References
----------
H. Rohling, "Radar CFAR thresholding in clutter and multiple target situations", IEEE Trans. AES 19(4), 1983.
P. Gandhi and S. Kassam, "Analysis of CFAR processors in nonhomogeneous background", IEEE Trans. AES 24(4), 1988.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from uwbbench.api import ConfigError, FloatArray

Statistic = Literal["ca", "go", "so", "os"]

ROLL_OFF = 0.5
"""Roll-off of the IEEE 802.15.4 HRP reference pulse."""
DIRECTIONS = 2**16
"""Random directions behind each factor of GO, SO and OS in correlated noise."""


@dataclass(frozen=True)
class TrainingWindow:
    """The cells that a noise estimate is made of.

    Attributes
    ----------
    cells : int
        Training cells on a side, ``n``.
    sides : int
        2, or 1 at the edges of a frame.
    guard : int
        Cells left out on a side, between the cell under test and its training cells.
    """

    cells: int
    sides: Literal[1, 2]
    guard: int

    @property
    def total(self) -> int:
        """Training cells of all sides, ``N``."""
        return self.cells * self.sides

    @property
    def offsets(self) -> FloatArray:
        """Distances (total,) of the training cells from the cell under test, side by side."""
        one_side = np.asarray(np.arange(self.cells) + self.guard + 1, dtype=np.float64)
        return one_side if self.sides == 1 else np.concatenate([-one_side, one_side])


def filter_correlation(lag: FloatArray, bandwidth_samples: float) -> FloatArray:
    """Correlation of the noise behind a root-raised-cosine receive filter.

    ``rho(t) = sinc(t/T) cos(pi b t/T) / (1 - (2 b t/T)^2)`` with the roll-off ``b = 0.5`` and the symbol time ``T``,
    one over the bandwidth: 0.60, 0 and -0.12 at lags 1, 2 and 3 for 499.2 MHz sampled at twice that.

    Parameters
    ----------
    lag : array
        In samples.
    bandwidth_samples : float
        Bandwidth times sample interval.
    """
    time = np.asarray(lag, dtype=np.float64) * bandwidth_samples
    pole = np.isclose(np.abs(2 * ROLL_OFF * time), 1.0, rtol=1e-9)
    denominator = np.where(pole, 1.0, 1.0 - (2 * ROLL_OFF * time) ** 2)
    shape = np.where(pole, np.pi / 4, np.cos(np.pi * ROLL_OFF * time) / denominator)
    return np.asarray(np.sinc(time) * shape)


def order_rank(rank: float, cells: int) -> int:
    """Place in ascending order, from 1, of the order statistic among so many cells."""
    return min(max(round(rank * cells), 1), cells)


@lru_cache(maxsize=256)
def threshold_factor(
    statistic: Statistic,
    window: TrainingWindow,
    false_alarm_rate: float,
    rank: float = 0.75,
    bandwidth_samples: float | None = None,
) -> float:
    """Factor on the noise estimate that gives a false-alarm rate.

    Parameters
    ----------
    statistic : {"ca", "go", "so", "os"}
        Mean of all training cells; larger or smaller of the two halves' means; order statistic. With one side the
        first three are the same.
    window : TrainingWindow
    false_alarm_rate : float
        Probability of an alarm in a cell that holds noise alone.
    rank : float
        Share of the training cells below the order statistic.
    bandwidth_samples : float, optional
        Bandwidth times sample interval for filter-correlated noise; None for independent cells.

    Returns
    -------
    float

    Raises
    ------
    ConfigError
        If correlated noise reaches over the guard cells so far that GO, SO or OS have no such factor.
    """
    log_rate = _log_rate_of(statistic, window, rank, bandwidth_samples)
    target = math.log(false_alarm_rate)
    high = 1.0
    while log_rate(high) > target:
        high *= 2
    from scipy.optimize import brentq

    return float(brentq(lambda factor: log_rate(factor) - target, 0.0, high, xtol=1e-12, rtol=1e-12))


def _log_rate_of(
    statistic: Statistic, window: TrainingWindow, rank: float, bandwidth_samples: float | None
) -> Callable[[float], float]:
    """Logarithm of the false-alarm rate as a function of the factor."""
    if statistic in ("go", "so") and window.sides == 1:
        statistic = "ca"
    if bandwidth_samples is not None:
        if statistic == "ca":
            return _correlated_averaging(window, bandwidth_samples)
        if statistic == "so":
            return _correlated_smallest_of(window, bandwidth_samples)
        return _sampled_log_rate(statistic, window, rank, bandwidth_samples)
    n, total, k = window.cells, window.total, order_rank(rank, window.total)
    return {
        "ca": lambda factor: -total * math.log1p(factor / total),
        "go": lambda factor: math.log(2 * math.exp(-n * math.log1p(factor / n)) - _smallest_of_rate(factor, n)),
        "so": lambda factor: math.log(_smallest_of_rate(factor, n)),
        "os": lambda factor: -sum(math.log1p(factor / (total - below)) for below in range(k)),
    }[statistic]


def _smallest_of_rate(factor: float, n: int) -> float:
    """``2 sum_k C(n-1+k, k) (2 + factor/n)^-(n+k)`` over k < n."""
    base = 2 + factor / n
    return 2 * sum(math.comb(n - 1 + k, k) * base ** -(n + k) for k in range(n))


def _correlated_smallest_of(window: TrainingWindow, bandwidth_samples: float) -> Callable[[float], float]:
    """Log rate of SO in correlated noise, from those of one side and of GO."""
    one_side = _correlated_averaging(replace(window, sides=1), bandwidth_samples)
    greatest_of = _sampled_log_rate("go", window, 1.0, bandwidth_samples)
    return lambda factor: math.log(2 * math.exp(one_side(factor)) - math.exp(greatest_of(factor)))


def _covariance(window: TrainingWindow, bandwidth_samples: float) -> FloatArray:
    """Covariance (1 + total, 1 + total) of the cell under test and its training cells."""
    place = np.concatenate([[0.0], window.offsets])
    return filter_correlation(place[:, None] - place, bandwidth_samples)


def _square_root(covariance: FloatArray) -> FloatArray:
    """Symmetric square root; band-limited noise sampled densely is singular up to rounding."""
    value, vector = np.linalg.eigh(covariance)
    return np.asarray((vector * np.sqrt(np.maximum(value, 0.0))) @ vector.T)


def _correlated_averaging(window: TrainingWindow, bandwidth_samples: float) -> Callable[[float], float]:
    """Exact log rate of cell averaging in correlated noise.

    ``|x0|^2 - factor/N sum |x_i|^2`` is a form of whitened Gaussians with eigenvalues ``v`` of ``S D S``, where S is
    the root of the covariance and ``D = diag(1, -factor/N, ...)``. Only one of them is positive, so the partial
    fractions of its distribution reduce to ``P = prod_j 1 / (1 + |v_j| / v_1)``.
    """
    root = _square_root(_covariance(window, bandwidth_samples))

    def log_rate(factor: float) -> float:
        weight = np.full(window.total + 1, -factor / window.total)
        weight[0] = 1.0
        value = np.linalg.eigvalsh((root * weight) @ root)
        return float(-np.sum(np.log1p(np.maximum(-value[:-1], 0.0) / value[-1])))

    return log_rate


def _sampled_log_rate(
    statistic: Literal["go", "os"], window: TrainingWindow, rank: float, bandwidth_samples: float
) -> Callable[[float], float]:
    """Log rate of GO or OS in correlated noise, the same smooth function at every call.

    Write the training cells as ``t = rho x0 + V y`` with white ``y`` of ``N`` entries, independent of the cell under
    test ``x0``. Whether it is an alarm depends only on ``q = |x0| / |y|`` and the direction of ``y``, which are
    independent. The mean power of a group of cells, over ``|y|^2``, is ``A q^2 + 2 B q + C``, so the cell exceeds
    ``factor`` times it from one root ``q`` on; GO takes the larger of the two roots, and OS the k-th of the roots of
    single cells. ``P(q^2 > s) = (1 + s)^-N`` closes the formula; directions are drawn with a fixed
    seed. It needs ``factor * A < 1``.
    """
    covariance = _covariance(window, bandwidth_samples)
    rho = covariance[1:, 0]
    spread = _square_root(covariance[1:, 1:] - np.outer(rho, rho))
    rng = np.random.default_rng(20250101)
    white = rng.normal(size=(DIRECTIONS, window.total)) + 1j * rng.normal(size=(DIRECTIONS, window.total))
    white /= np.linalg.norm(white, axis=1, keepdims=True)
    cells = white @ spread
    group = (-1, 1, window.total) if statistic == "os" else (-1, window.sides, window.cells)
    axis = 1 if statistic == "os" else 2
    steep = np.square(rho).reshape(group).mean(axis=axis)
    tilt = (rho * cells.real).reshape(group).mean(axis=axis)
    level = (cells.real**2 + cells.imag**2).reshape(group).mean(axis=axis)
    place = order_rank(rank, window.total) - 1 if statistic == "os" else 1

    def log_rate(factor: float) -> float:
        lead = 1 - factor * steep
        if lead.min() <= 0:
            raise ConfigError(
                f"cfar.{statistic}: 'noise: correlated' with {window.guard} guard_taps: the noise of the nearest "
                "training taps follows the tested tap too closely for this false_alarm_rate; raise 'guard_taps'"
            )
        root = (factor * tilt + np.sqrt((factor * tilt) ** 2 + lead * factor * level)) / lead
        decisive = np.partition(root, place, axis=1)[:, place]
        return float(np.log(np.mean((1 + decisive**2) ** -window.total)))

    return log_rate
