"""What paths through noise alone accumulate, at most: the offset and the threshold of a track before detection.

A cell of noise has the power ``x`` in units of the noise, exponentially distributed, and the evidence
``l = clip(10 log10(x / x0), lowest, highest)``. From frame to frame a path goes on to one of ``n`` cells. The largest
sum of evidence over all paths that end in a cell, started anew wherever it would be negative, exceeds ``t`` with a
probability of at most (union bound over all paths of k frames, and Markov's inequality for each of them)

    ``sum over k of n^(k-1) M(theta)^k exp(-theta t) = M / (1 - n M) exp(-theta t)``, ``M(theta) = E[exp(theta l)]``,

for every ``theta`` with ``n M(theta) < 1``. A sum that forgets is never larger. Only independence from frame to frame
is used, none from cell to cell; noise that was averaged over several cells has a shorter tail than ``x``, so that the
bound holds for it, too. It is the bound by which a sequential test keeps its rate of false alarms (Wald,
Sequential Analysis, 1947), summed over the paths of a branching walk.
"""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray

DB = 10 / math.log(10)
_EXPONENTS = np.linspace(0.25, 60.0, 240)
_SURVIVORS = 0.5
"""Paths that noise alone has left of each path, frame by frame, at the offset: they die out."""
_HIGHEST_DB = 17.0
"""Enough for 10^15 cells."""


def moment(neutral_db: float, lowest_db: float, highest_db: float) -> FloatArray:
    """``E[exp(theta l)]`` of one cell of noise, by the exponents ``s = theta 10 / ln 10`` that are tried.

    Between the clips ``exp(theta l) = (x / x0)^s``, whose mean is an incomplete gamma function.

    Parameters
    ----------
    neutral_db : float
        Power over noise at which the evidence is zero, x0.
    lowest_db, highest_db : float
        Where the evidence is clipped.

    Returns
    -------
    (exponents,) array
    """
    from scipy.special import gammainc, gammaln

    s = _EXPONENTS
    low, high = (10 ** ((neutral_db + clip) / 10) for clip in (lowest_db, highest_db))
    between = np.exp(gammaln(1 + s) - s * neutral_db / DB) * (gammainc(1 + s, high) - gammainc(1 + s, low))
    return np.asarray(
        -math.expm1(-low) * np.exp(s * lowest_db / DB) + between + np.exp(np.minimum(s * highest_db / DB - high, 700))
    )


def neutral_db(cells: int, lowest_db: float, highest_db: float) -> float:
    """Least power over noise for which paths through noise die out.

    It is where ``n M(theta)`` reaches one half at its lowest.

    Parameters
    ----------
    cells : int
        Cells n that a path may go on to.
    lowest_db, highest_db : float
        Where the evidence is clipped.
    """
    below, above = 0.0, _HIGHEST_DB
    while above - below > 1e-6:
        middle = (below + above) / 2
        if cells * moment(middle, lowest_db, highest_db).min() < _SURVIVORS:
            above = middle
        else:
            below = middle
    return above


def threshold_db(cells: int, taps: int, rate: float, neutral: float, clips: tuple[float, float]) -> float:
    """Evidence that the best path of a frame of noise exceeds with at most a given probability.

    Parameters
    ----------
    cells : int
        Cells n that a path may go on to.
    taps : int
        Cells in which a path may end.
    rate : float
        Probability, by frame.
    neutral : float
        Power over noise, in dB, at which the evidence is zero.
    clips : (float, float)
        Lowest and highest evidence of one cell in one frame.

    Returns
    -------
    float
        The lowest of the bounds for all exponents.
    """
    mean = moment(neutral, *clips)
    dies = cells * mean < 1
    bound = np.log(taps * mean[dies] / (1 - cells * mean[dies]) / rate) * DB / _EXPONENTS[dies]
    return max(float(bound.min()), 0.0)
