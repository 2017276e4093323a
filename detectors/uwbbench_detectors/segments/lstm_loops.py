"""Inner loops of the recurrent segmentation: a network along the taps of a frame, and runs of probable taps."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import FloatArray, IntArray, compiled


@compiled
def _sigmoid(value: float) -> float:
    return 1 / (1 + math.exp(-value))


@compiled
def probabilities(
    features: FloatArray,
    first: IntArray,
    scaling: FloatArray,
    inputs: FloatArray,
    recurrent: FloatArray,
    bias: FloatArray,
    outputs: FloatArray,
    offset: float,
    found: FloatArray,
) -> None:
    """Probability of each tap, by a long short-term memory that runs along the taps, or one each way.

    ``i, f, o = sigmoid(W x + U h + b)``, ``g = tanh(...)``, ``c = f c + i g``, ``h = o tanh(c)`` (Hochreiter and
    Schmidhuber, Neural Computation 9(8), 1997; Gers et al. 2000), then ``sigmoid(v h + offset)``. Weights are laid out
    so that all gates of one input follow each other, and nothing but these gates is added up at a time: the sums are
    the same whatever the processor's width.

    Parameters
    ----------
    features : (frames, taps, features) array
    first : (frames,) int array
        Tap that each run begins with; taps beyond the frame repeat its last one.
    scaling : (2, features) array
        Mean and standard deviation that features are taken relative to.
    inputs : (directions, features, 4 hidden) array
        Of the gates i, f, g, o.
    recurrent : (directions, hidden, 4 hidden) array
    bias : (directions, 4 hidden) array
    outputs : (directions, hidden) array
    offset : float
    found : (frames, steps) array
        Overwritten.
    """
    frames, taps, count = features.shape
    directions, hidden = outputs.shape
    steps = found.shape[1]
    scaled, gates = np.empty((steps, count)), np.empty(4 * hidden)
    state, cell = np.empty(hidden), np.empty(hidden)
    for frame in range(frames):
        for step in range(steps):
            tap = min(first[frame] + step, taps - 1)
            for number in range(count):
                scaled[step, number] = (features[frame, tap, number] - scaling[0, number]) / scaling[1, number]
            found[frame, step] = offset
        for direction in range(directions):
            state[:] = 0.0
            cell[:] = 0.0
            for place in range(steps):
                step = steps - 1 - place if direction else place
                for gate in range(4 * hidden):
                    gates[gate] = bias[direction, gate]
                for number in range(count):
                    value = scaled[step, number]
                    for gate in range(4 * hidden):
                        gates[gate] += inputs[direction, number, gate] * value
                for number in range(hidden):
                    value = state[number]
                    for gate in range(4 * hidden):
                        gates[gate] += recurrent[direction, number, gate] * value
                for unit in range(hidden):
                    kept = _sigmoid(gates[hidden + unit]) * cell[unit]
                    cell[unit] = kept + _sigmoid(gates[unit]) * math.tanh(gates[2 * hidden + unit])
                    state[unit] = _sigmoid(gates[3 * hidden + unit]) * math.tanh(cell[unit])
                    found[frame, step] += outputs[direction, unit] * state[unit]
        for step in range(steps):
            found[frame, step] = _sigmoid(found[frame, step])


@compiled
def probable_runs(
    probability: FloatArray, first: IntArray, amplitude: FloatArray, threshold: float
) -> tuple[IntArray, FloatArray]:
    """Runs of taps whose probability exceeds a threshold, by frame and then tap; frames of zeros have none.

    Parameters
    ----------
    probability : (frames, steps) array
    first : (frames,) int array
        Tap of the first step of each frame.
    amplitude : (frames, taps) array
    threshold : float

    Returns
    -------
    row : (n,) int array
    found : (n, 6) array
        Left free; taps of the strongest sample, of the start and of the stop; its amplitude; the largest probability.
    """
    frames, steps = probability.shape
    taps = amplitude.shape[1]
    row, found = np.empty(frames * ((steps + 1) // 2), np.int64), np.empty((frames * ((steps + 1) // 2), 6))
    count = 0
    for frame in range(frames):
        if not amplitude[frame].max() > 0:
            continue
        start = -1
        for tap in range(first[frame], min(first[frame] + steps, taps) + 1):
            inside = tap < min(first[frame] + steps, taps) and probability[frame, tap - first[frame]] > threshold
            if inside and start < 0:
                start = crest = tap
                likeliest = 0.0
            if inside:
                crest = tap if amplitude[frame, tap] > amplitude[frame, crest] else crest
                likeliest = max(likeliest, probability[frame, tap - first[frame]])
            elif start >= 0:
                row[count] = frame
                found[count, 1], found[count, 2], found[count, 3] = crest, start - 0.5, tap - 0.5
                found[count, 4], found[count, 5] = amplitude[frame, crest], likeliest
                count += 1
                start = -1
    return row[:count].copy(), found[:count].copy()
