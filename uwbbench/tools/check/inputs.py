"""What plugins are tried on: a small simulated capture with the flaws of measured ones, and blocks cut from it."""

from __future__ import annotations

import dataclasses
import statistics
import time
from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from uwbbench.api.block import Block
from uwbbench.api.capture import Capture
from uwbbench.api.frames import Frames
from uwbbench.measure.robustness.scene import altered, approach, on_radar

FRAMES, CALLS = 128, 60
INVALID, ZERO, LOUD = (5, 40, 41), 11, 17
"""Frames with a sample that is not finite, of zeros, and a thousand times stronger."""
CUTS: dict[str, tuple[int, ...]] = {
    "single frames": tuple(range(1, FRAMES)),
    "blocks of 7": tuple(range(7, FRAMES, 7)),
    "one frame, then the others": (1,),
    "halves with an empty block between": (FRAMES // 2, FRAMES // 2),
    "uneven blocks": (3, 4, 50, 51, 100, 127),
}


def call_s(step: Callable[[Any], object], calls: Sequence[Any]) -> float:
    """Median time of a call for one frame, after the first third of the calls, which load and compile."""
    times = []
    for frame in calls:
        start = time.perf_counter()
        step(frame)
        times.append(time.perf_counter() - start)
    return statistics.median(times[len(times) // 3 :])


@cache
def usual_capture(*, sts: bool = True, truth: bool = True, background: bool = True) -> Capture:
    """Approach to one echo in complex64 samples, with invalid, zero and very strong frames.

    Parameters
    ----------
    sts, truth, background : bool
        Whether it has STS responses, a ground truth and a background, some frames of which are invalid too.
    """

    def partly_invalid(samples: np.ndarray) -> np.ndarray:
        samples[INVALID, 3] = np.nan
        return samples.astype(np.complex64)

    def flawed(samples: np.ndarray) -> np.ndarray:
        samples[ZERO] = 0
        samples[LOUD] *= 1000
        return samples

    capture = altered(altered(approach(frames=FRAMES), flawed), partly_invalid, receiver=True)
    if not sts:
        radar = dataclasses.replace(capture.radar, has_sts=False, array_spacing_m=None)
        samples: dict[str, Any] = dict.fromkeys(("sts1", "sts2", "first_path_index_sts1", "first_path_index_sts2"))
        capture = on_radar(capture, radar, **samples)
    absent: dict[str, Any] = {name: None for name, there in (("truth", truth), ("background", background)) if not there}
    return dataclasses.replace(capture, **absent) if absent else capture


def frames_of(capture: Capture) -> Frames:
    """All frames as a pipeline hands them to stages: invalid ones marked, and their samples zero."""
    frames = capture.frames()
    clean: dict[str, Any] = {
        name: np.where(frames.valid[:, None], samples, 0)
        for name in ("preamble", "sts1", "sts2")
        if (samples := getattr(frames, name)) is not None
    }
    return dataclasses.replace(frames, **clean)


def cut(block: Block, start: int, stop: int) -> Block:
    """Frames ``start`` to ``stop`` of a block, with their detections.

    Parameters
    ----------
    block : Block
    start, stop : int
        First frame, and the one after the last, counted from the start of the block.
    """
    return block.cut(start, stop)


def pieces(block: Block, cuts: Sequence[int]) -> list[Block]:
    """Consecutive parts of a block, cut before the given frames."""
    edges = [0, *cuts, len(block.frames)]
    return [cut(block, start, stop) for start, stop in pairwise(edges)]
