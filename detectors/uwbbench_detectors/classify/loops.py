"""Compiled loops: features of frames, and what trees, neighbours and a linear model make of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uwbbench.api import BoolArray, ComplexArray, FloatArray, IntArray, compiled

_TAPS = 42
_TAIL = 3
_SHAPE = 2 * (_TAPS - 1)
_FLOOR = 1e-6


@compiled
def frame_features(
    samples: ComplexArray, first_path: FloatArray, valid: BoolArray, bands: IntArray
) -> tuple[NDArray[np.float32], BoolArray]:
    """Features (frames, 93) as :mod:`uwbbench_detectors.classify.features` describes them, and where there are any.

    Parameters
    ----------
    samples : (frames, taps) complex array
    first_path : (frames,) array
    valid : (frames,) bool array
    bands : (6,) int array
    """
    frames, taps = samples.shape
    features = np.zeros((frames, _SHAPE + 11), np.float32)
    there = np.zeros(frames, np.bool_)
    amplitude = np.empty(_TAPS)
    tail = np.empty(_TAPS - _TAIL)
    for frame in range(frames):
        if not (valid[frame] and 0 <= first_path[frame] <= taps - 1):
            continue
        crest = int(np.rint(first_path[frame]))
        direct = samples[frame, crest]
        unit = max(abs(direct.real), abs(direct.imag))
        if unit == 0:
            continue
        energy = 0.0
        for tap in range(_TAPS):
            amplitude[tap] = 0.0
            if crest + tap < taps:
                real, imaginary = samples[frame, crest + tap].real / unit, samples[frame, crest + tap].imag / unit
                amplitude[tap] = np.sqrt(real * real + imaginary * imaginary)
        reference = amplitude[0]
        for tap in range(_TAPS):
            amplitude[tap] /= reference
            energy += amplitude[tap] * amplitude[tap]
        if not energy < 1e30:  # no direct path: what is there is as nothing beside the rest
            continue
        _describe(amplitude, energy, tail, bands, features[frame])
        there[frame] = True
    return features, there


@compiled
def _describe(
    amplitude: FloatArray, energy: float, tail: FloatArray, bands: IntArray, row: NDArray[np.float32]
) -> None:
    """Fill in the features of one frame."""
    mean = entropy = 0.0
    for tap in range(_TAPS):
        share = amplitude[tap] * amplitude[tap] / energy
        mean += share * tap
        entropy -= share * np.log(share + 1e-12)
        if tap:
            row[tap - 1] = amplitude[tap]
            row[_TAPS - 2 + tap] = np.log10(amplitude[tap] + _FLOOR)
    spread = 0.0
    for tap in range(_TAPS):
        spread += amplitude[tap] * amplitude[tap] / energy * (tap - mean) ** 2
    largest = 0
    for place in range(_TAPS - _TAIL):
        value = amplitude[_TAIL + place]
        if value > amplitude[_TAIL + largest]:
            largest = place
        free = place
        while free > 0 and tail[free - 1] > value:
            tail[free] = tail[free - 1]
            free -= 1
        tail[free] = value
    row[_SHAPE] = mean
    row[_SHAPE + 1] = np.sqrt(spread)
    row[_SHAPE + 2] = entropy
    row[_SHAPE + 3] = amplitude[_TAIL + largest]
    row[_SHAPE + 4] = largest
    row[_SHAPE + 5] = tail[(_TAPS - _TAIL) // 2]
    for band in range(len(bands) - 1):
        total = 0.0
        for tap in range(bands[band], bands[band + 1]):
            total += amplitude[tap] * amplitude[tap]
        row[_SHAPE + 6 + band] = total


@compiled
def forest_probabilities(
    features: NDArray[np.float32],
    roots: NDArray[np.int32],
    feature: NDArray[np.int16],
    threshold: NDArray[np.float32],
    children: NDArray[np.int32],
    leaves: NDArray[np.float32],
) -> FloatArray:
    """Mean over trees of the classes' shares in the leaf that each frame falls into.

    Parameters
    ----------
    features : (frames, features) float32 array
    roots : (trees,) int32 array
        Node that each tree begins with; -1 - leaf where it is but a leaf.
    feature : (nodes,) int16 array
    threshold : (nodes,) float32 array
        Largest value that goes to the first child.
    children : (nodes, 2) int32 array
        Node behind this one, or -1 - leaf.
    leaves : (leaves, classes) float32 array

    Returns
    -------
    (frames, classes) array
    """
    frames, trees, classes = len(features), len(roots), leaves.shape[1]
    found = np.zeros((frames, classes))
    for frame in range(frames):
        for tree in range(trees):
            node = roots[tree]
            while node >= 0:
                node = children[node, 0 if features[frame, feature[node]] <= threshold[node] else 1]
            for one in range(classes):
                found[frame, one] += leaves[-1 - node, one]
        for one in range(classes):
            found[frame, one] /= trees
    return found


@compiled
def neighbour_probabilities(
    features: FloatArray, known: NDArray[np.float32], label: NDArray[np.int16], neighbours: int, classes: int
) -> FloatArray:
    """Shares of the classes among the nearest known frames, by Euclidean distance; of equals, the first ones.

    Parameters
    ----------
    features : (frames, features) array
    known : (known, features) float32 array
    label : (known,) int16 array
    neighbours, classes : int

    Returns
    -------
    (frames, classes) array
    """
    found = np.zeros((len(features), classes))
    nearest = np.empty(neighbours)
    labels = np.empty(neighbours, np.int16)
    for frame in range(len(features)):
        nearest[:] = np.inf
        for other in range(len(known)):
            distance = 0.0
            for one in range(known.shape[1]):
                distance += (features[frame, one] - known[other, one]) ** 2
            place = neighbours
            while place > 0 and distance < nearest[place - 1]:
                place -= 1
                if place < neighbours - 1:
                    nearest[place + 1] = nearest[place]
                    labels[place + 1] = labels[place]
            if place < neighbours:
                nearest[place] = distance
                labels[place] = label[other]
        for one in range(neighbours):
            found[frame, labels[one]] += 1 / neighbours
    return found


@compiled
def linear_probabilities(features: FloatArray, slope: FloatArray, intercept: FloatArray) -> FloatArray:
    """Softmax of a linear model of features.

    Parameters
    ----------
    features : (frames, features) array
    slope : (classes, features) array
    intercept : (classes,) array

    Returns
    -------
    (frames, classes) array
    """
    frames, classes = len(features), len(intercept)
    found = np.empty((frames, classes))
    for frame in range(frames):
        largest = -np.inf
        for one in range(classes):
            value = intercept[one]
            for number in range(slope.shape[1]):
                value += slope[one, number] * features[frame, number]
            found[frame, one] = value
            largest = max(largest, value)
        total = 0.0
        for one in range(classes):
            found[frame, one] = np.exp(found[frame, one] - largest)
            total += found[frame, one]
        for one in range(classes):
            found[frame, one] /= total
    return found
