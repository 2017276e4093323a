"""Comparing two detectors in one process: they take turns on the same frames, and the ratio of their times is kept.

Absolute times differ between machines, and on one machine from minute to minute. Two detectors that take turns within
milliseconds meet the same clock, the same neighbours and the same temperature, so that the ratio of their times keeps
what the detectors are and loses what the machine did.

Conventions
-----------
* A block is two neighbouring parts of the stream, run in the order ABBA: A and B on the first part, B and A on the
  second. Who goes second finds the samples in the cache; within a block each does so once. The next block is BAAB:
  whoever starts a block bears what happened before it, such as caches that another process has emptied.
* A block lasts about ``BLOCK_S`` for the faster detector, as far as the capture reaches. A reading of the clock (below
  0.1 us) is then a hundred-millionth to a ten-thousandth of it, and a single interrupt (some us) below a hundredth;
  longer blocks would only give a drifting clock time to tell A from B, and leave fewer of them.
* There are at least ``MINIMUM_BLOCKS`` blocks: a short or fast capture is passed several times, each with streams
  opened anew.
* Blocks are the unit of the bootstrap, as the calls within one are correlated.
* On a busy machine other processes take the core for milliseconds, several times the length of a block. Linux tells a
  thread how long it waited for its core; that time is no detector's, and is left out of the block. What the others did
  to the caches stays in it. Where the system does not tell, nothing is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import perf_counter_ns
from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.capture import Capture
from uwbbench.api.frames import Frames
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.accuracy.stats import MINIMUM_GROUPS
from uwbbench.measure.latency.counters import core_waits
from uwbbench.measure.latency.loops import cut, quiet

MINIMUM_BLOCKS = 32
BLOCK_S = 1e-3
PROBED_S = 0.01
"""Time after which a detector's speed is known well enough to choose the length of the blocks."""


@dataclass(frozen=True)
class Turns:
    """What two detectors took in alternating blocks.

    Attributes
    ----------
    first_s, second_s : (blocks,) array
        Time that each spent in a block, without waiting for the core.
    waited_s : (blocks,) array
        Time in a block during which other processes had the core; 0 where the system does not tell.
    """

    first_s: FloatArray
    second_s: FloatArray
    waited_s: FloatArray


def alternating(
    first: Pipeline, second: Pipeline, capture: Capture, whole: Frames, blocks: int = MINIMUM_BLOCKS
) -> Turns:
    """Let two detectors take turns on the same frames, one frame a call.

    Warm both up before: what is compiled in here would be part of the times.

    Parameters
    ----------
    first, second : Pipeline
    capture : Capture
    whole : Frames
        The frames, at least one, preloaded.
    blocks : int
        Blocks at least; the frames are passed as often as that takes, and always to their end.

    Returns
    -------
    Turns
    """
    faster_s = min(_call_s(pipeline, capture, whole) for pipeline in (first, second))
    size = min(len(whole), max(1, math.ceil(BLOCK_S / faster_s / 2)))
    parts = len(whole) // size
    passes = math.ceil(2 * blocks / parts)
    spent_ns = np.empty((passes * parts, 2))
    waited_ns = np.empty((passes * parts, 2))
    with quiet(), core_waits() as waits_ns:
        for number in range(passes):
            steps = first.open(capture).step, second.open(capture).step
            for at in range(parts):
                turn = number * parts + at
                order = (0, 1) if turn % 4 in (0, 3) else (1, 0)
                part = whole.part(at * size, (at + 1) * size)
                # Cut in the order of use, just before it: whose frames were made first would find them in no cache.
                calls = {who: cut(part, 1) for who in order}
                for who in order:
                    step, frames_of_turn = steps[who], calls[who]
                    before = waits_ns()
                    start = perf_counter_ns()
                    for frames in frames_of_turn:
                        step(frames)
                    spent_ns[turn, who] = perf_counter_ns() - start
                    waited_ns[turn, who] = waits_ns() - before
    # A wait beside the timed part, between the readings of the two clocks, may exceed what was timed: it is none of it.
    net_ns = np.where(waited_ns < spent_ns, spent_ns - waited_ns, spent_ns)
    by_block_s = _by_block(net_ns) * 1e-9
    return Turns(by_block_s[:, 0], by_block_s[:, 1], _by_block(waited_ns).sum(axis=1) * 1e-9)


def _by_block(by_turn: FloatArray) -> FloatArray:
    """Sums (blocks, 2) of two neighbouring turns each."""
    return np.asarray(by_turn[: len(by_turn) // 2 * 2].reshape(-1, 2, 2).sum(axis=1))


def _call_s(pipeline: Pipeline, capture: Capture, whole: Frames) -> float:
    """Median time of the first calls: enough of them to choose a block's length."""
    step = pipeline.open(capture).step
    times_ns: list[int] = []
    for frames in cut(whole.part(0, 1000), 1):
        start = perf_counter_ns()
        step(frames)
        times_ns.append(perf_counter_ns() - start)
        if sum(times_ns) > PROBED_S * 1e9:
            break
    return max(float(np.median(times_ns)), 1.0) * 1e-9


def ratio_summary(ours_s: FloatArray, reference_s: FloatArray, resamples: int = 1000) -> dict[str, Any]:
    """Ratio of two detectors from the times of alternating blocks.

    Parameters
    ----------
    ours_s, reference_s : (blocks,) array
    resamples : int
        Draws of the bootstrap over blocks; seeded.

    Returns
    -------
    dict
        ``ratio``: exp of the median log ratio, the typical block. ``total_ratio``: all blocks together, in which rare
        expensive frames count as much as they take. Each with ``low`` and ``high`` (``total_low``, ``total_high``),
        the ends of its 95 % interval, None below eight blocks. ``blocks``: their number.
    """
    logs = np.log(ours_s / reference_s)
    ends: list[float | None] = [None] * 4
    if len(logs) >= MINIMUM_GROUPS:
        drawn = np.random.default_rng(0).integers(len(logs), size=(resamples, len(logs)))
        typical = np.exp(np.median(logs[drawn], axis=1))
        total = ours_s[drawn].sum(axis=1) / reference_s[drawn].sum(axis=1)
        ends = [float(end) for draws in (typical, total) for end in np.quantile(draws, [0.025, 0.975])]
    return {
        "ratio": float(np.exp(np.median(logs))),
        "low": ends[0],
        "high": ends[1],
        "total_ratio": float(ours_s.sum() / reference_s.sum()),
        "total_low": ends[2],
        "total_high": ends[3],
        "blocks": len(logs),
    }
