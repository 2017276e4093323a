"""Inner loops of the clutter stages: backgrounds that are carried from frame to frame."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import BoolArray, ComplexArray, FloatArray, compiled

EPSILON = float(np.finfo(np.float64).eps)
ROOT_2 = 1.4142135623730951 * (1 + 1e-9)


@compiled
def usable_frames(samples: ComplexArray, valid: BoolArray) -> BoolArray:
    """Mark the valid frames (frames,) that are not all zero."""
    usable = np.zeros(len(samples), np.bool_)
    for frame in range(len(samples)):
        if valid[frame]:
            for sample in samples[frame]:
                if sample != 0:
                    usable[frame] = True
                    break
    return usable


@compiled
def largest_magnitude(frame: ComplexArray) -> float:
    """Largest ``hypot(re, im)`` of a frame, which is asked for only where it may exceed the largest so far."""
    largest = 0.0
    for sample in frame:
        reach = max(abs(sample.real), abs(sample.imag))
        if reach * ROOT_2 > largest:
            largest = max(largest, math.hypot(sample.real, sample.imag))
    return largest


@compiled
def drop_rounding(residue: ComplexArray, samples: ComplexArray, operations: float) -> None:
    """Set to zero what is left of a frame within the rounding error of so many additions.

    That error is at most ``operations`` epsilons of the frame's largest sample. Equal frames would otherwise leave a
    ripple in the last place, which a later normalisation would blow up to full scale.

    Parameters
    ----------
    residue : (taps,) complex array
        What is left of the frame; written.
    samples : (taps,) complex array
        The frame before anything was subtracted.
    operations : float
        Additions behind each tap of the residue.
    """
    bound = operations * EPSILON * largest_magnitude(samples)
    for tap in range(len(residue)):
        real, imaginary = residue[tap].real, residue[tap].imag
        reach = max(abs(real), abs(imaginary))
        if not reach > bound and not (reach * ROOT_2 > bound and math.hypot(real, imaginary) > bound):
            residue[tap] = 0


@compiled
def less_template(
    samples: ComplexArray, template: ComplexArray, weights: ComplexArray, operations: float
) -> ComplexArray:
    """Frames less a template (taps,), times the gain that the weights (taps,) give for each frame.

    Parameters
    ----------
    samples : (frames, taps) complex array
    template : (taps,) complex array
    weights : (taps,) complex array
        Their product with a frame, summed over the taps, is the gain of the template in it.
    operations : float
        Additions behind each tap of the residue, which bound its rounding error.

    Returns
    -------
    (frames, taps) array
    """
    residue = np.empty_like(samples)
    for row in range(len(samples)):
        frame, left = samples[row], residue[row]
        gain = 0j
        for tap in range(len(frame)):
            gain += frame[tap] * weights[tap]
        for tap in range(len(frame)):
            left[tap] = frame[tap] - gain * template[tap]
        drop_rounding(left, frame, operations)
    return residue


@compiled
def less_projection(frame: ComplexArray, shapes: ComplexArray, operations: float) -> ComplexArray:
    """Frame (taps,) less its projection on orthonormal shapes (rank, taps).

    Parameters
    ----------
    frame : (taps,) complex array
    shapes : (rank, taps) complex array
        Orthonormal rows; the conjugate of each is a shape that is projected out.
    operations : float
        Additions behind each tap of the residue, which bound its rounding error.

    Returns
    -------
    (taps,) array
    """
    left = frame.copy()
    for shape in shapes:
        share = 0j
        for tap in range(len(frame)):
            share += frame[tap] * shape[tap]
        for tap in range(len(frame)):
            left[tap] -= share * shape[tap].conjugate()
    drop_rounding(left, frame, operations)
    return left


@compiled
def less_mean(
    samples: ComplexArray, count: int, head: ComplexArray, stretch: ComplexArray, tail: ComplexArray
) -> ComplexArray:
    """Frames less the running mean of the frames so far, or of the last ones.

    Parameters
    ----------
    samples : (frames, taps) array
    count : int
        Frames seen before these.
    head : (taps,) array
        Sum of the frames of the current stretch; carried on.
    stretch : (window, taps) array
        Frames of the current stretch; carried on. Of no rows where the mean is over all frames so far.
    tail : (window, taps) array
        Sums of the stretch before, from each of its frames to its last; carried on.

    Returns
    -------
    (frames, taps) array
    """
    window, taps = len(stretch), samples.shape[1]
    residue = np.empty_like(samples)
    for row in range(len(samples)):
        frame, left = samples[row], residue[row]
        place = count % window if window else 0
        count += 1
        averaged = min(count, window) if window else count
        share = 1 / averaged
        if window and place + 1 < window:
            older = tail[place + 1]
            for tap in range(taps):
                head[tap] += frame[tap]
                left[tap] = frame[tap] - (head[tap] + older[tap]) * share
        else:
            for tap in range(taps):
                head[tap] += frame[tap]
                left[tap] = frame[tap] - head[tap] * share
        drop_rounding(left, frame, 2.0 * averaged)
        if window:
            for tap in range(taps):
                stretch[place, tap] = frame[tap]
            if place + 1 == window:
                _finish_stretch(stretch, tail)
                head[:] = 0
    return residue


@compiled
def _finish_stretch(stretch: ComplexArray, tail: ComplexArray) -> None:
    """Sums of a full stretch from each of its frames to the last, added from the last one on."""
    window, taps = stretch.shape
    for tap in range(taps):
        tail[window - 1, tap] = stretch[window - 1, tap]
    for place in range(window - 2, -1, -1):
        for tap in range(taps):
            tail[place, tap] = tail[place + 1, tap] + stretch[place, tap]


@compiled
def less_exponential(samples: ComplexArray, background: ComplexArray, gain: float, operations: float) -> ComplexArray:
    """Frames less the exponential average (taps,) of the frames before them, which is carried on.

    Parameters
    ----------
    samples : (frames, taps) complex array
    background : (taps,) complex array
        Average of the frames before these; written, to be carried on.
    gain : float
        Weight of a new frame in the average, from 0 to 1.
    operations : float
        Additions behind each tap of the residue, which bound its rounding error.

    Returns
    -------
    (frames, taps) array
    """
    residue = np.empty_like(samples)
    for row in range(len(samples)):
        frame, left = samples[row], residue[row]
        for tap in range(len(frame)):
            left[tap] = frame[tap] - background[tap]
            background[tap] += gain * left[tap]
        drop_rounding(left, frame, operations)
    return residue


@compiled
def less_selective(
    samples: ComplexArray,
    background: ComplexArray,
    variance: FloatArray,
    seen: int,
    settings: tuple[float, float, float, float],
) -> ComplexArray:
    """Frames less an exponential average that learns only from taps near it.

    Parameters
    ----------
    samples : (frames, taps) array
    background, variance : (taps,) arrays
        Carried on.
    seen : int
        Frames before these.
    settings : (gain, share, gate, operations)
        Weight of a frame in the background, and in the variance; a tap is learnt where its power is at most ``gate``
        variances; additions behind the background.

    Returns
    -------
    (frames, taps) array
    """
    gain, share, gate, operations = settings
    residue = np.empty_like(samples)
    for row in range(len(samples)):
        frame, left = samples[row], residue[row]
        seen += 1
        learns_all = seen <= math.ceil(1 / share)
        weight = max(1 / seen, share)
        for tap in range(len(frame)):
            left[tap] = frame[tap] - background[tap]
            power = left[tap].real ** 2 + left[tap].imag ** 2
            if learns_all or power <= gate * variance[tap]:
                background[tap] += gain * left[tap]
                variance[tap] += weight * (power - variance[tap])
        drop_rounding(left, frame, operations)
    return residue
