"""The stages of a detector at the start of a stream: opened, and shown what they need to see before the first frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from uwbbench.api.block import Block
from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.frames import BATCH_FRAMES
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Params, Stage
from uwbbench.api.truth import Truth
from uwbbench.detect.stream import Opened, Stream


@dataclass(frozen=True)
class Chosen:
    """A step of a detector that a capture has all for.

    Attributes
    ----------
    label : str
        What the step is called.
    stage : type
    params : Params
        Checked parameters for the capture's channel.
    load : callable
        Gives a new stage, of that label, what it has learned for the radar that it will be opened on.
    """

    label: str
    stage: type[Stage[Any]]
    params: Params
    load: Callable[[Stage[Any], str, Radar], None]


def background_of(capture: CaptureHeader) -> Capture | None:
    """Background of a capture; None where it has none, and of a header, which has no samples at all."""
    return capture.background if isinstance(capture, Capture) else None


def opened(steps: Sequence[Chosen], capture: CaptureHeader, background: Capture | None) -> list[Opened]:
    """Stages at the start of a stream.

    Parameters
    ----------
    steps : sequence of Chosen
        In the order of the detector.
    capture : Capture or CaptureHeader
        Gives the radar and the ground truth.
    background : Capture or None
        Shown to the stages that need one.
    """
    stages: list[Opened] = []
    for place, step in enumerate(steps):
        stage = step.stage(step.params)
        step.load(stage, step.label, capture.radar)
        stage.open(capture.radar)
        if "truth" in step.stage.needs and capture.truth is not None:
            stage.show_truth(capture.truth, capture.trajectory)
        needs = step.stage.needs_with(step.params)
        if "background" in needs and background is not None:
            stage.show_background(_behind(steps[:place], background, sts="sts" in needs))
        stages.append(Opened(step.label, stage))
    return stages


def _behind(steps: Sequence[Chosen], background: Capture, *, sts: bool) -> Iterator[Block]:
    """Frames of a background as these steps leave them, block by block.

    The steps are opened anew, so that nothing of the background remains in the stream that is about to start. Where no
    ground truth is given, that of a background is known: nothing.
    """
    known = background if background.truth is not None else dataclasses.replace(background, truth=Truth(()))
    stream = Stream(opened(steps, known, background), [])
    for frames in background.blocks(BATCH_FRAMES, sts=sts or "sts" in stream.needs):
        yield stream.through(Block(frames.without_invalid()))
    yield from stream.tails()
