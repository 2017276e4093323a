"""CFAR, entropy and clutter removal: how many times faster than the same per frame, as a user writes it with numpy.

Run through ``python tests/bench/run.py cfar``. Ours are the stages alone, on one long block and, as ``a frame a
call``, on blocks of one frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import frames as made
import numpy as np
from harness import Disagreement, Effort, Row, Run, interleaved, median, ratio, told

from uwbbench.api import Block, ComplexArray, Frames, Radar, Stage
from uwbbench.api.registry import load_plugin
from uwbbench_detectors.cfar.factors import TrainingWindow, order_rank, threshold_factor

HALF, GUARD, RATE, RANK = 6, 2, 1e-3, 0.75
MEMORY = 0.97
WINDOW = 64
CREST = 7


def rows(effort: Effort) -> Iterator[Row]:
    """One group of rows for each stage."""
    capture = made.approach(effort.frames(made.FRAMES), sts=False)
    radar, whole = capture.radar, capture.frames()
    aligned = after("align", radar, whole)
    bare = after("clutter.exponential", radar, aligned, memory=MEMORY)
    for kind in ("ca", "os"):
        yield from compared(f"cfar.{kind}", radar, bare, partial(cfar, kind, radar.noise_taps), effort)
    yield from compared("segment.entropy", radar, bare, entropy, effort)
    yield from compared("clutter.exponential", radar, aligned, exponential, effort, memory=MEMORY)
    yield from compared("clutter.mean", radar, aligned, running_mean, effort, window_frames=WINDOW)
    part = aligned.part(0, min(len(aligned), 600))  # the textbook's way takes a millisecond a frame
    yield from compared("clutter.svd", radar, part, singular, effort, window_frames=WINDOW)


def cfar(kind: str, start: int, frames: Frames) -> list[tuple[int, int]]:
    """Frame and tap of each crest above its threshold, cell by cell."""
    factors = {}
    for sides in (1, 2):
        factors[sides] = threshold_factor(kind, TrainingWindow(HALF, sides, GUARD), RATE, RANK)  # type: ignore[arg-type]
    found = []
    for frame, samples in enumerate(frames.preamble):
        amplitude = np.sqrt(samples.real**2 + samples.imag**2)
        power = amplitude[start:] ** 2
        for cell in range(len(power)):
            left = power[max(cell - GUARD - HALF, 0) : max(cell - GUARD, 0)]
            right = power[cell + GUARD + 1 : cell + GUARD + 1 + HALF]
            sides = [side for side in (left, right) if len(side) == HALF]
            training = np.concatenate(sides)
            noise = np.mean(training) if kind == "ca" else np.sort(training)[order_rank(RANK, len(training)) - 1]
            if power[cell] > factors[len(sides)] * noise:
                tap = cell + start
                if np.argmax(amplitude[max(tap - GUARD, 0) : tap + GUARD + 1]) == min(tap, GUARD):
                    found.append((frame, tap))
    return found


def entropy(frames: Frames) -> list[tuple[int, int]]:
    """Frame and tap of the strongest sample of each segment, window by window."""
    found = []
    for frame, samples in enumerate(frames.preamble):
        power = np.abs(samples) ** 2
        if not power.any():
            continue
        level = np.array([np.log(np.pi * np.e * power[first : first + 5].mean()) for first in range(len(power) - 4)])
        centre = np.median(level[-16:])
        spread = 1.4826 * np.median(np.abs(level[-16:] - centre))
        hot = np.flatnonzero(level > centre + 5 * spread) + 2
        hot = hot[hot >= CREST + 3]
        for run in np.split(hot, np.flatnonzero(np.diff(hot) > 2) + 1):
            if len(run) > 1:
                found.append((frame, int(run[0] + np.argmax(power[run[0] : run[-1] + 1]))))
    return found


def exponential(frames: Frames) -> ComplexArray:
    """Frames less the exponential average of those before."""
    background = frames.preamble[0]
    cleaned = np.empty_like(frames.preamble)
    for row, frame in enumerate(frames.preamble):
        cleaned[row] = frame - background
        background = MEMORY * background + (1 - MEMORY) * frame
    return cleaned


def running_mean(frames: Frames) -> ComplexArray:
    """Frames less the mean of the last ones."""
    samples = frames.preamble
    return np.stack(
        [frame - samples[max(row - WINDOW + 1, 0) : row + 1].mean(axis=0) for row, frame in enumerate(samples)]
    )


def singular(frames: Frames) -> ComplexArray:
    """Frames less their share in the first right singular vector of the last ones."""
    samples = frames.preamble
    cleaned = np.zeros_like(samples)
    for row in range(1, len(samples)):
        shape = np.linalg.svd(samples[max(row - WINDOW + 1, 0) : row + 1], full_matrices=False)[2][0]
        cleaned[row] = samples[row] - (samples[row] @ shape.conj()) * shape
    return cleaned


def compared(
    name: str, radar: Radar, frames: Frames, naive: Callable[[Frames], Any], effort: Effort, **params: Any
) -> Iterator[Row]:
    """Rows of one stage, after a check that the naive way gives the same."""
    check(name, naive(frames), stage(name, radar, params).step(block(frames)))
    few = frames.part(0, min(len(frames), 300))
    ones = [few.part(row, row + 1) for row in range(len(few))]

    def whole() -> Run:
        return partial(stage(name, radar, params).step, block(fresh(frames)))

    def frame_by_frame() -> Run:
        opened, blocks = stage(name, radar, params), [block(fresh(one)) for one in ones]
        return lambda: [opened.step(block) for block in blocks]

    contenders = {"naive": lambda: partial(naive, few), "ours": whole, "single": frame_by_frame}
    spent = interleaved(contenders, effort.rounds(11))
    each = {key: spent[key] / (len(frames) if key == "ours" else len(few)) * 1e6 for key in spent}
    note = f"{median(each['ours']).value:.3g} us a frame; naive {median(each['naive']).value:.3g}"
    yield told(f"{name}, {frames.taps} taps: naive / ours", ratio(each["naive"], each["ours"]), "times", note)
    single = ratio(each["naive"], each["single"])
    yield told("  a frame a call", single, "times", f"{median(each['single']).value:.3g} us a frame")


def check(name: str, expected: Any, found: Block) -> None:
    """Same cells detected, or samples equal to 1e-10 of the largest one.

    Raises
    ------
    Disagreement
        If they differ.
    """
    if isinstance(expected, list):
        same = expected == list(zip(found.rows.tolist(), found.detections["tap"].astype(int).tolist(), strict=True))
    else:
        same = np.allclose(found.frames.preamble, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    if not same:
        raise Disagreement(f"{name} differs from the naive loop")


def stage(name: str, radar: Radar, params: dict[str, Any]) -> Stage[Any]:
    """An opened stage."""
    cls = load_plugin("stages", name)
    opened: Stage[Any] = cls(cls.params_type().model_validate(params))
    opened.open(radar)
    return opened


def after(name: str, radar: Radar, frames: Frames, **params: Any) -> Frames:
    """What a stage makes of the frames."""
    return stage(name, radar, params).step(Block(frames)).frames


def block(frames: Frames) -> Block:
    """Frames that are aligned to their direct path."""
    return Block(frames, first_path=np.full(len(frames), float(CREST)))


def fresh(frames: Frames) -> Frames:
    """The same frames without magnitudes computed before."""
    return frames.with_preamble(frames.preamble)
