"""The Kalman track: what a frame costs in a stream, one frame a call, and beside matrices as a user writes them.

Run through ``python tests/bench/run.py tracks``.
"""

from __future__ import annotations

from collections.abc import Iterator

import frames as made
import numpy as np
from bench_cfar_clutter import stage
from harness import Disagreement, Effort, Interval, Row, Run, at_most, interleaved, median, ratio, told

from uwbbench.api import Block, Detections, FloatArray, Frames
from uwbbench.api.capture import Capture

MICROSECONDS = 15.0


def rows(effort: Effort) -> Iterator[Row]:
    """One frame a call with one detection each."""
    capture = made.echoes(effort.frames(3000), 50)
    blocks, range_m = given(capture)
    check(capture, blocks, naive(range_m, capture.trajectory.timestamp_s))

    def ours() -> Run:
        opened = stage("track.kalman", capture.radar, {})
        return lambda: [opened.step(block) for block in blocks]

    spent = interleaved(
        {"naive": lambda: lambda: naive(range_m, capture.trajectory.timestamp_s), "ours": ours}, effort.rounds(11)
    )
    each = {name: seconds / len(blocks) * 1e6 for name, seconds in spent.items()}
    found: Interval = median(each["ours"])
    yield at_most("track.kalman, a frame a call", MICROSECONDS, found, "us")
    yield told("  matrices in numpy / ours", ratio(each["naive"], each["ours"]), "times")


def given(capture: Capture) -> tuple[list[Block], FloatArray]:
    """Blocks of one frame with one detection each, and their ranges."""
    whole: Frames = capture.frames()
    range_m = 2 + 0.001 * np.arange(len(whole)) + 0.03 * np.random.default_rng(0).normal(size=len(whole))
    blocks = []
    for frame in range(len(whole)):
        found = Detections([frame], range_m=range_m[frame : frame + 1], amplitude=[1.0], score_db=[20.0], tap=[9.0])
        blocks.append(Block(whole.part(frame, frame + 1), detections=found))
    return blocks, range_m


def naive(range_m: FloatArray, time_s: FloatArray) -> FloatArray:
    """Filtered ranges, with numpy's matrices, of one track that never misses."""
    state, covariance = np.array([range_m[0], 0.0]), np.diag([0.045**2, 1.0])
    filtered = [range_m[0]]
    for step_s, measured_m in zip(np.diff(time_s), range_m[1:], strict=True):
        moves = np.array([[1, step_s], [0, 1]])
        bend = np.array([step_s**2 / 2, step_s])
        state, covariance = moves @ state, moves @ covariance @ moves.T + 0.25 * np.outer(bend, bend)
        gain = covariance[:, 0] / (covariance[0, 0] + 0.045**2)
        state, covariance = state + gain * (measured_m - state[0]), covariance - np.outer(gain, covariance[0])
        filtered.append(state[0])
    return np.array(filtered)


def check(capture: Capture, blocks: list[Block], expected: FloatArray) -> None:
    """Filtered ranges equal to 1e-9.

    Raises
    ------
    Disagreement
        If they differ.
    """
    opened = stage("track.kalman", capture.radar, {"gate_sigmas": 100.0})
    found = Detections.join([opened.step(block).detections for block in blocks])
    if not np.allclose(found.range_m, expected[found.frame], rtol=0, atol=1e-9):
        raise Disagreement("track.kalman differs from the matrices")
