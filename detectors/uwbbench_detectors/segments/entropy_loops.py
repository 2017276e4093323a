"""Inner loops of the entropy segmentation: entropy of sliding windows, and runs of windows above the tail's."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray, compiled
from uwbbench_detectors.cfar.windows import window_sums
from uwbbench_detectors.compiled.rank import median, sort

GAUSS, VASICEK = range(2)
"""Codes of the estimators."""
SIGMA_OF_MAD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""


@compiled
def entropies(
    amplitude: FloatArray, window: int, spacing: int, estimator: int, scratch: FloatArray, entropy: FloatArray
) -> None:
    """Differential entropy of each run of ``window`` samples, in nats; minus infinity where they have no spread.

    Parameters
    ----------
    amplitude : (taps,) array
        Magnitudes of one frame.
    window : int
        Samples of a window.
    spacing : int
        VASICEK: ranks between a sample and the two that its density is estimated from; below half the window.
    estimator : int
        GAUSS: ``ln(pi e mean|x|^2)``, that of a complex normal distribution. VASICEK: ``mean ln(n / (2 m) (a_(i+m) -
        a_(i-m)))`` over the sorted magnitudes a, with ranks beyond the ends taken at the ends.
    scratch : (4, taps) array
        Overwritten.
    entropy : (taps - window + 1,) array
        Of the windows by their first tap.
    """
    if estimator == GAUSS:
        power, sums = scratch[2], scratch[3]
        for tap in range(len(amplitude)):
            power[tap] = amplitude[tap] * amplitude[tap]
        window_sums(power, window, scratch[:2], sums)
        for first in range(len(entropy)):
            entropy[first] = math.log(math.pi * math.e / window * sums[first])
        return
    ordered = scratch[0, :window]
    for first in range(len(entropy)):
        for place in range(window):
            ordered[place] = amplitude[first + place]
        sort(ordered)
        total = 0.0
        for rank in range(window):
            gap = ordered[min(rank + spacing, window - 1)] - ordered[max(rank - spacing, 0)]
            total += math.log(window / (2 * spacing) * gap)
        entropy[first] = total / window


@compiled
def segments(
    amplitude: FloatArray,
    first_path: FloatArray,
    first_frame: int,
    estimator: tuple[int, int, int],
    tail: int,
    sigmas: float,
    shape: tuple[float, int, int],
) -> tuple[FloatArray, bool]:
    """Runs of windows whose entropy exceeds that of the tail, by frame and then tap.

    Parameters
    ----------
    amplitude : (frames, taps) array
        Magnitudes.
    first_path : (frames,) array
        Fractional tap of the direct path.
    first_frame : int
        Number of the first frame.
    estimator : (int, int, int)
        GAUSS or VASICEK, samples of a window, spacing.
    tail : int
        Last windows that the others are compared with.
    sigmas : float
        Robust standard deviations of the tail above its median from which a window is hot.
    shape : (float, int, int)
        Least distance of the middle of a hot window behind the first path; most cold windows inside a run; least
        windows of a run.

    Returns
    -------
    found : (n, 6) array
        Number of the frame, by its bits; taps of the strongest sample, of the start and of the stop; its amplitude;
        ``score_db``, the largest entropy of the run over the tail's median, as a ratio of powers.
    silent : bool
        Whether a frame with a signal has a tail whose entropies have no spread; nothing is found there.
    """
    kind, window, spacing = estimator
    guard, merge, least = shape
    frames, taps = amplitude.shape
    windows = taps - window + 1
    scratch, level, entropy, reference = np.empty((4, taps)), np.empty(taps), np.empty(windows), np.empty(tail)
    found = np.empty((frames * ((windows + 1) // 2), 6))
    bits = found.view(np.int64)
    to_middle, decibels = (window - 1) / 2, (20 if kind == VASICEK else 10) / math.log(10)
    count, silent = 0, False
    for frame in range(frames):
        largest = amplitude[frame].max()
        if not largest > 0:
            continue
        unit = math.ldexp(1.0, math.frexp(largest)[1] - 1)  # a power of two, by which dividing is exact
        for tap in range(taps):  # so that no square over- or underflows
            level[tap] = amplitude[frame, tap] / unit
        entropies(level, window, spacing, kind, scratch, entropy)
        for place in range(tail):
            reference[place] = entropy[windows - tail + place]
        centre = median(reference)
        for place in range(tail):
            reference[place] = abs(entropy[windows - tail + place] - centre)
        spread = median(reference)
        if not (spread > 0 and math.isfinite(centre)):
            silent = True
            continue
        threshold = centre + sigmas * SIGMA_OF_MAD * spread
        start = stop = -1
        for first in range(windows + 1):
            hot = first < windows and entropy[first] > threshold and first + to_middle - first_path[frame] >= guard
            if hot and start >= 0 and first - stop <= merge + 1:
                stop = first
            elif hot or first == windows:
                if start >= 0 and stop - start + 1 >= least:
                    crest = start + (window - 1) // 2
                    for tap in range(crest + 1, stop + window // 2 + 1):
                        if level[tap] > level[crest]:
                            crest = tap
                    bits[count, 0] = first_frame + frame
                    found[count, 1] = crest
                    found[count, 2], found[count, 3] = start + to_middle - 0.5, stop + to_middle + 0.5
                    found[count, 4] = amplitude[frame, crest]
                    found[count, 5] = decibels * (entropy[start : stop + 1].max() - centre)
                    count += 1
                start = stop = first
    return found[:count].copy(), silent
