"""Inner loops of the robot's own template."""

from __future__ import annotations

from typing import Any

import numpy as np

from uwbbench.api import BoolArray, FloatArray, compiled
from uwbbench_detectors.first_path.template_loops import COUNT, PATH_M, path_since

MEMORY, STEP_M = range(2)
"""Settings, by their places."""
SETTINGS = 2
FRAMES = 4
"""State beside that of the alignment: frames at the first place."""
CARRIED = 5


@compiled
def without_robot(made: Any, template: Any, carried: FloatArray, at: FloatArray) -> None:
    """Subtract the template from an aligned response, then renew it if the robot has moved.

    Parameters
    ----------
    made : (2, taps) float32 array
        Changed.
    template : (2, taps) float32 array
        Changed.
    carried : (CARRIED,) array
        Changed.
    at : (SETTINGS,) array
    """
    taps = made.shape[1]
    if carried[COUNT] == 0 or carried[PATH_M] > at[STEP_M]:
        carried[COUNT] += 1
        carried[PATH_M] = 0
        share = 1 / min(carried[COUNT], at[MEMORY])
    elif carried[COUNT] == 1:  # the mean of the frames at the first place, which count as one look
        carried[FRAMES] += 1
        share = 1 / (1 + carried[FRAMES])
    else:
        share = 0.0
    part_of = np.float32(share)
    for part in range(2):
        source, target = template[part], made[part]
        for tap in range(taps):
            left = target[tap] - source[tap]
            source[tap] += part_of * left
            target[tap] = left
    if carried[COUNT] == 1:
        for tap in range(taps):
            made[0, tap] = made[1, tap] = np.float32(0)


@compiled
def residuals(
    samples: Any, valid: BoolArray, place_m: FloatArray, template: Any, carried: FloatArray, at: FloatArray
) -> Any:
    """What consecutive frames of one response hold beside the template.

    Parameters
    ----------
    samples : (frames, taps) complex64 array
        Aligned; frames that are all zero are passed over.
    valid : (frames,) bool array
    place_m : (frames, 3) array
    template : (2, taps) float32 array
    carried : (CARRIED,) array
        Both carried from block to block.
    at : (SETTINGS,) array

    Returns
    -------
    (frames, taps) complex64 array
    """
    frames, taps = samples.shape
    left = np.zeros((frames, taps), np.complex64)
    made = np.zeros((2, taps), np.float32)
    for frame in range(frames):
        if not valid[frame]:
            continue
        path_since(place_m[frame], carried)
        some = False
        for tap in range(taps):
            made[0, tap], made[1, tap] = samples[frame, tap].real, samples[frame, tap].imag
            some |= made[0, tap] != 0 or made[1, tap] != 0
        if not some:
            continue
        without_robot(made, template, carried, at)
        for tap in range(taps):
            left[frame, tap] = complex(made[0, tap], made[1, tap])
    return left
