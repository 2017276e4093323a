"""When a detector hands out what it finds: after the step of which frame, found by driving it frame by frame.

Conventions
-----------
* A stream takes one frame a call, as on a robot. What a call returns was *handed out* after its frame, whatever frame
  it is about; what only the flush returns, at the end: after as many frames as the capture has.
* A detector need not say that it waits. A batch does not show it either, as one call has all frames.
* A frame a call may take a hundred times as long as a batch. So the frames go first in a few alone, then in blocks of
  many lengths: where every block is answered by itself, its own frames and no others, nothing was held back at any of
  these edges, and each detection was handed out with its own frame. At the first edge with something held back the
  whole capture is driven again, frame by frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, cycle
from typing import TYPE_CHECKING

import numpy as np

from uwbbench.api.capture import Capture
from uwbbench.api.detections import HANDED_OUT, Detections
from uwbbench.api.frames import BATCH_FRAMES, Frames
from uwbbench.detect.stream import Stream

if TYPE_CHECKING:
    from uwbbench.detect.pipeline import Pipeline

FIRST_ALONE = 64
"""Frames that go in one by one before the blocks."""

EDGES = (29, 83, 31, 79, 37, 73, 41, 71, 43, 67, 47, 61, 53, 59)
"""Lengths of the blocks behind them: primes, so that no regular wait ends at every edge."""

DIFFERENT = "not known when its detections were handed out: one frame a call, it finds others than in a batch"


def with_hand_outs(pipeline: Pipeline, capture: Capture, found: Detections, threads: int = 1) -> Detections:
    """Detections of a batch, each with the frame after whose step a stream hands it out.

    Parameters
    ----------
    pipeline : Pipeline
    capture : Capture
    found : Detections
        Of a batch of this detector on the capture.
    threads : int
        As for :meth:`uwbbench.detect.pipeline.Pipeline.open`.

    Returns
    -------
    Detections
        The same rows with the column ``handed_out``, and ``answered``. Without both, and with a note, where a stream
        finds other detections than the batch, against the contract of :class:`~uwbbench.api.stage.Stage`.
    """
    if _at_once(pipeline.open(capture, threads=threads), capture, found):
        return found.with_hand_outs(found.frame, found.processed)
    alone = driven(pipeline.open(capture), capture)
    same = np.array_equal(alone.frame, found.frame) and np.array_equal(alone.processed, found.processed)
    if alone.answered is None or not same:
        return found.annotated(notes=[*found.notes, DIFFERENT])
    return found.with_hand_outs(alone[HANDED_OUT], alone.answered)


def driven(stream: Stream, capture: Capture) -> Detections:
    """What a stream finds on a capture, one frame a call and the flush, with the frame after which it was handed out.

    Parameters
    ----------
    stream : Stream
        Fresh.
    capture : Capture
    """
    answers = [(part.first, stream.step(part)) for part in _parts(stream, capture, cycle([1]))]
    answers.append((len(capture), stream.flush()))
    after = [after for after, _ in answers]
    found = Detections.join([answer for _, answer in answers])
    named = np.concatenate([answer.processed for _, answer in answers])
    _, first = np.unique(named, return_index=True)
    answered = np.repeat(after, [len(answer.processed) for _, answer in answers])[first]
    return found.with_hand_outs(np.repeat(after, [len(answer) for _, answer in answers]), answered)


def _at_once(stream: Stream, capture: Capture, found: Detections) -> bool:
    """Whether every block was answered by itself, and the answers are those of the batch."""
    rows = frames = 0
    for part in _parts(stream, capture, chain([1] * FIRST_ALONE, cycle(EDGES))):
        answer = stream.step(part)
        own = (answer.frame >= part.first) & (answer.frame < part.first + len(part))
        if not own.all() or not np.array_equal(answer.processed, part.index[part.valid]):
            return False
        rows, frames = rows + len(answer), frames + len(answer.processed)
    rest = stream.flush()
    return not len(rest) and not len(rest.processed) and (rows, frames) == (len(found), len(found.processed))


def _parts(stream: Stream, capture: Capture, lengths: Iterator[int]) -> Iterator[Frames]:
    """Consecutive parts of a capture of these lengths, or shorter where a block that is read at once ends."""
    for block in capture.blocks(BATCH_FRAMES, sts="sts" in stream.needs):
        start = 0
        while start < len(block):
            stop = min(start + next(lengths), len(block))
            yield block.part(start, stop)
            start = stop
