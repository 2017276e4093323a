"""Values of sampled responses between their taps."""

from __future__ import annotations

from typing import Literal

import numpy as np

from uwbbench.api import Bins, ComplexArray, FloatArray

Method = Literal["quadratic", "fft", "linear"]


def between_taps(samples: ComplexArray, first_path: FloatArray, bins: Bins, method: Method) -> ComplexArray:
    """Responses at places between their taps, each frame by itself.

    Parameters
    ----------
    samples : (frames, taps) array
    first_path : (frames,) array
        Tap from which the bins count.
    bins : Bins
    method : {"quadratic", "fft", "linear"}
        Quadratic spline that is mirrored at the first and last tap (order 2 of ``scipy.ndimage``), the trigonometric
        polynomial through all samples, or straight lines.

    Returns
    -------
    (frames, bins) complex array
        NaN outside the frame.
    """
    last = samples.shape[1] - 1
    taps = first_path[:, None] + bins.place
    with np.errstate(invalid="ignore"):  # a first path that is not known lies outside every frame
        inside = (taps >= 0) & (taps <= last)
    taps = np.where(inside, taps, 0.0)
    if method == "fft":
        values = _band_limited(samples, np.where(np.isfinite(first_path), first_path, 0.0), bins)
    elif method == "linear":
        values = _linear(samples, taps)
    else:
        values = _quadratic(samples, taps)
    return np.asarray(np.where(inside, values, np.nan))


def _linear(samples: ComplexArray, taps: FloatArray) -> ComplexArray:
    before = np.minimum(taps.astype(np.int64), samples.shape[1] - 2)
    share = taps - before
    row = np.arange(len(samples))[:, None]
    return np.asarray((1 - share) * samples[row, before] + share * samples[row, before + 1])


def _quadratic(samples: ComplexArray, taps: FloatArray) -> ComplexArray:
    """Spline whose pieces meet halfway between the taps (Unser, IEEE Signal Processing Magazine 16(6), 1999)."""
    from scipy import ndimage  # costs more than everything else at start-up

    weight = ndimage.spline_filter1d(samples, order=2, axis=1, output=np.complex128, mode="mirror")
    weight = np.concatenate([weight[:, 1:2], weight, weight[:, -2:-1]], axis=1)  # mirrored: one more on each side
    nearest = np.floor(taps + 0.5).astype(np.int64)
    off = taps - nearest
    row = np.arange(len(samples))[:, None]
    values = (0.5 - off) ** 2 / 2 * weight[row, nearest]
    values += (0.75 - off**2) * weight[row, nearest + 1]
    values += (0.5 + off) ** 2 / 2 * weight[row, nearest + 2]
    return np.asarray(values)


def _band_limited(samples: ComplexArray, first_path: FloatArray, bins: Bins) -> ComplexArray:
    """Frames shifted in the frequency domain, where zeros beyond the band make the spacing finer."""
    length = samples.shape[1]
    turn = 2 * np.pi * np.fft.fftfreq(length)
    spectrum = np.fft.fft(samples, axis=1) * np.exp(1j * turn * (first_path[:, None] + bins.first_tap))
    padded = np.zeros((len(samples), length * bins.per_tap), np.complex128)
    positive = (length + 1) // 2
    padded[:, :positive] = spectrum[:, :positive]
    padded[:, positive - length :] = spectrum[:, positive:]
    fine = np.fft.ifft(padded, axis=1) * bins.per_tap
    return np.asarray(fine[:, np.arange(bins.count) % fine.shape[1]])
