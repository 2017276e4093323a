"""Threshold factors that hold a false-alarm rate against a noise level that is itself estimated.

All rates are of complex Gaussian noise that is independent from tap to tap, in units of its mean square: the share of
the taps of a profile that hold a local maximum which passes. Powers are then exponentially distributed,
``P(|h|^2 > x) = exp(-x)``, magnitudes Rayleigh.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from uwbbench.api import FloatArray

_LEVELS = 96
_EXCESSES = 48
_PLACES = 65
_ODDS = 96


def _solved(rate_of: Callable[[float], float], rate: float, start: float) -> float:
    """Factor at which a falling rate has a value."""
    from scipy.optimize import brentq

    high = start
    while rate_of(high) > rate:
        high *= 2
    return float(brentq(lambda factor: math.log(rate_of(factor) / rate), high / 2**60, high, xtol=1e-9, rtol=1e-12))


@lru_cache(maxsize=1024)
def spread_factor(false_alarm_rate: float, frames: int, lower: int, upper: int) -> float:
    """How many quartile distances above the lower one a magnitude must be, of one tap in earlier frames.

    The threshold is ``T = x + factor (y - x)``, with x and y the magnitudes of two ranks among n. As it has a scale and
    an offset of its own, it fits a floor that spreads as noise does, and one that is nearly the same in all frames. It
    is made for Rayleigh magnitudes. A constant with noise on it (Rice) has lighter tails in these units: at a rate of
    1e-3 and the quartiles of many frames the factor is 3.27 for Rayleigh and 2.79 for a strong constant, so that the
    rate there is lower than stated.

    With ``U`` and ``V`` the probabilities below x and y, V has the distribution Beta(upper, n + 1 - upper) and U / V,
    independent of it, Beta(lower, upper - lower). ``p = exp(-T^2)`` of the taps are above T. One of power a is a
    maximum where both neighbours are lower, ``(1 - exp(-a))^2``, which integrates to

        ``rate = E (p - p^2 + p^3 / 3)``.

    Parameters
    ----------
    false_alarm_rate : float
        Share of taps, less than a third: of noise one tap in three is a maximum.
    frames : int
        Earlier frames, n.
    lower, upper : int
        Ranks in rising order, from 1.

    Returns
    -------
    float
        Of magnitude.
    """
    log_odds: FloatArray = np.linspace(-12.0, 12.0, _ODDS)
    step = log_odds[1] - log_odds[0]

    def beta(first: int, second: int) -> tuple[FloatArray, FloatArray]:
        value = 1 / (1 + np.exp(-log_odds))
        log_scale = math.lgamma(first + second) - math.lgamma(first) - math.lgamma(second)
        log_weight = log_scale - first * np.log1p(np.exp(-log_odds)) - second * np.log1p(np.exp(log_odds))
        return value, np.exp(log_weight) * step

    below_upper, weight = beta(upper, frames + 1 - upper)
    share, share_weight = beta(lower, upper - lower)
    high = np.sqrt(-np.log1p(-below_upper))[:, None]
    low = np.sqrt(-np.log1p(-below_upper[:, None] * share))

    def rate_of(factor: float) -> float:
        above = np.exp(-((low + factor * (high - low)) ** 2))
        return float(weight @ (above - above**2 + above**3 / 3) @ share_weight)

    return _solved(rate_of, false_alarm_rate, 4.0)


@lru_cache(maxsize=256)
def prominence_factor(false_alarm_rate: float, taps: int, noise_taps: float) -> float:
    """Factor on the mean square of a few taps of noise that a squared prominence is compared with.

    The base of a peak is the higher of the smallest values on its two sides, and the smallest of n Rayleigh values is
    no zero: at 20 taps it is 0.22 of the noise's root mean square. So the prominence of noise is lower than its
    amplitude, by a step that shrinks with the taps there are, and a threshold that is meant for amplitudes would be a
    decibel too high. Take a peak of magnitude a and the level ``u = a - t`` below which a side must fall. Going
    outwards, a tap is lower than u with probability ``1 - exp(-u^2)`` and ends the search by being higher than a with
    ``exp(-a^2)``; of n taps a side falls so low with probability

        ``S(n) = (1 - exp(-u^2)) (1 - r^n) / (1 - r)``,  ``r = exp(-u^2) - exp(-a^2)``,

    and ``P(prominence > t) = int_t^inf 2a exp(-a^2) S(left) S(right) da``, averaged over the places of a profile and
    over the estimate ``t^2 = factor g``, where ``m g`` of m taps is Gamma distributed with shape m. The integrals are
    Gauss-Laguerre and trapezoidal sums in the logarithm of g. Whatever scales the profile by its minimum and maximum
    is undone before the comparison, and so has no part in it.

    Parameters
    ----------
    false_alarm_rate : float
        Share of taps, less than a third.
    taps : int
        Of the profile.
    noise_taps : float
        Taps that the mean square is taken over, m, or as many as would know it as well.

    Returns
    -------
    float
        Of power.
    """
    excess, weight = np.polynomial.laguerre.laggauss(_EXCESSES)
    spread = 14 / math.sqrt(noise_taps) + 2
    log_level: FloatArray = np.linspace(-3 * spread, spread, _LEVELS)
    log_density = noise_taps * (math.log(noise_taps) + log_level - np.exp(log_level)) - math.lgamma(noise_taps)
    density = np.exp(log_density) * (log_level[1] - log_level[0])
    place = np.unique(np.linspace(1, taps - 2, _PLACES).round())
    share = np.diff(np.concatenate([[0.5], (place[1:] + place[:-1]) / 2, [taps - 1.5]])) / taps
    left, right = place, taps - 1 - place

    def rate_of(factor: float) -> float:
        threshold2 = factor * np.exp(log_level)[:, None]
        height2 = threshold2 + excess
        margin2 = (np.sqrt(height2) - np.sqrt(threshold2)) ** 2
        lower, higher = -np.expm1(-margin2), np.exp(-height2)
        stay = 1 - lower - higher
        reach = (lower / np.maximum(lower + higher, np.finfo(float).tiny))[..., None]
        log_stay = np.log(np.maximum(stay, np.finfo(float).tiny))[..., None]
        sides = reach**2 * np.expm1(left * log_stay) * np.expm1(right * log_stay)
        return float(density @ (np.exp(-threshold2[:, 0]) * ((sides @ share) @ weight)))

    return _solved(rate_of, false_alarm_rate, 16.0)
