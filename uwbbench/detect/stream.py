"""A detector at work on one receiver."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uwbbench.api.block import Block
from uwbbench.api.detections import Detections
from uwbbench.api.frames import Frames
from uwbbench.api.kernel import Kernel
from uwbbench.api.stage import Filter, Stage


@dataclass(frozen=True)
class Opened:
    """A stage at work, and what its step of the detector is called."""

    label: str
    stage: Stage[Any]


class Stream:
    """A detector at work on one receiver, block by block.

    Made by :meth:`uwbbench.detect.pipeline.Pipeline.open`; not shared between threads.

    Parameters
    ----------
    steps : list of Opened
        Stages, and kernels that stand for several of them.
    notes : sequence of str
        What a reader of the results must know from the start.
    audit : bool
        Keep what filters drop.

    Attributes
    ----------
    chain : dict
        Detections left behind each step, in order. Not counted where kernels are at work, which describe no detection
        that will be dropped.
    answered : int
        Frames that it has answered for, from the first on; a frame behind them is held back, or was not given yet.
    """

    def __init__(self, steps: list[Opened], notes: Sequence[str], *, audit: bool = False) -> None:
        self._steps = steps
        self._preface = tuple(notes)
        self._audit = audit
        self._rejected: list[Detections] = []
        self._tracks = any("track" in stage.produces for stage in self.stages)
        self._kernel = steps[0].stage if steps and isinstance(steps[0].stage, Kernel) else None
        self._counts = not any(isinstance(step.stage, Kernel) for step in steps)
        self._noted: tuple[int, tuple[str, ...]] = (-1, ())
        self.answered = 0
        self.chain: dict[str, int] = {}

    def step(self, frames: Frames) -> Detections:
        """Detections that are ready after these frames.

        Parameters
        ----------
        frames : Frames
            The next consecutive frames, one or many.

        Returns
        -------
        Detections
            Usually of these frames; of earlier ones behind a stage that holds detections back.
        """
        if self._kernel is None:
            return self._emit(self.through(Block(frames.without_invalid())))
        detections = self._kernel.detect(frames, None)
        if len(self._steps) == 1:
            self.answered = frames.first + len(frames)
            return detections
        return self._emit(self.through(Block(frames.without_invalid(), detections=detections), 1))

    def flush(self) -> Detections:
        """Detections that were still held back; ends the stream."""
        return Detections.join([self._emit(tail) for tail in self.tails()]).annotated(notes=self.notes)

    @property
    def ports(self) -> frozenset[str]:
        """All that the stages produce."""
        return frozenset().union(*(stage.produces for stage in self.stages))

    @property
    def needs(self) -> frozenset[str]:
        """What the stages need of the capture."""
        return frozenset().union(*(stage.needs_with(stage.params) for stage in self.stages))

    @property
    def fused(self) -> bool:
        """Whether kernels stand for some of the stages."""
        return not self._counts

    @property
    def stages(self) -> tuple[Stage[Any], ...]:
        """The stages at work, in order; those that a kernel stands for included."""
        stages: list[Stage[Any]] = []
        for step in self._steps:
            stages += step.stage.stages if isinstance(step.stage, Kernel) else [step.stage]
        return tuple(stages)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the results must know, so far."""
        count = 0
        for step in self._steps:
            count += len(step.stage.notes)
        if count != self._noted[0]:
            notes = [*self._preface, *(note for step in self._steps for note in step.stage.notes)]
            self._noted = count, tuple(dict.fromkeys(notes))
        return self._noted[1]

    def candidates(self, detections: Detections) -> Detections:
        """Peaks before the filters, with ``retained`` 1 for those that passed them all, else ``rejected_by``.

        ``rejected_by`` is the place of the filter in ``chain``. A track is no peak: of a detector that makes tracks,
        those that passed are the detections that the tracks were made of.

        Parameters
        ----------
        detections : Detections
            All that the stream has handed out, in an audit.
        """
        own = detections.take(np.zeros(0, np.int64)) if self._tracks else detections
        kept = own.with_columns(retained=np.ones(len(own)), rejected_by=np.full(len(own), np.nan))
        every = Detections.join([kept, *self._rejected])
        return every.with_columns(retained=np.isnan(every["rejected_by"]))

    def tails(self) -> Iterator[Block]:
        """What stages still hold back, each taken through the steps behind it."""
        for index, opened in enumerate(self._steps):
            tail = opened.stage.flush()
            if tail is not None:
                tail = _without_rows_of_invalid(tail)
                if opened.label in self.chain:
                    self.chain[opened.label] += len(tail.detections)
                yield self.through(tail, index + 1)

    def _emit(self, block: Block) -> Detections:
        if len(block.frames):  # an empty block may begin anywhere
            self.answered = block.frames.first + len(block.frames)
        return block.detections.annotated(processed=(block.frames.first, block.frames.valid), notes=self.notes)

    def through(self, block: Block, start: int = 0) -> Block:
        """Block behind the last step, taken through the steps from ``start`` on."""
        rejected: list[Block] = []
        for opened in self._steps[start:]:
            stage = opened.stage
            if self._audit and isinstance(stage, Filter):
                keep = stage.keep(block)
                dropped = block.detections.take(~keep)
                place = np.full(len(dropped), self._place(opened.label))
                rejected.append(block.replace(detections=dropped.with_columns(rejected_by=place)))
                block = block.replace(detections=block.detections.take(keep))
            else:
                if self._audit and "track" in stage.produces:
                    passed = block.detections.with_columns(rejected_by=np.full(len(block.detections), np.nan))
                    rejected.append(block.replace(detections=passed))
                if stage.rowwise:
                    rejected = [stage.step(part) for part in rejected]
                block = stage.step(block)
                rejected = [_brought_along(part, block) for part in rejected]
            if "detections" in stage.produces:
                block = _without_rows_of_invalid(block)
            if self._counts and ("detections" in stage.produces or self.chain):
                self.chain[opened.label] = self.chain.get(opened.label, 0) + len(block.detections)
        self._rejected += [part.detections for part in rejected]
        return block

    def _place(self, label: str) -> int:
        """Place of a step in the chain, where it stands from its first block on."""
        return list(self.chain).index(label) if label in self.chain else len(self.chain)


def _without_rows_of_invalid(block: Block) -> Block:
    """Block without detections of invalid frames, whatever a stage made of their zeros."""
    frames, detections = block.frames, block.detections
    if frames.valid.all() or not len(detections):
        return block
    return block.replace(detections=detections.take(~np.isin(detections.frame, frames.index[~frames.valid])))


def _brought_along(part: Block, block: Block) -> Block:
    """Rejected detections with what a stage has just added about their frames.

    Behind a stage that holds frames back the block covers other frames; the part then keeps its own.
    """
    same = part.frames.first == block.frames.first and len(part.frames) == len(block.frames)
    return block.replace(detections=part.detections) if same else part
