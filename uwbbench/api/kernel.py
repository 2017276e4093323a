"""Several consecutive stages done in one pass over each frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from uwbbench.api.arrays import FloatArray
from uwbbench.api.block import Block
from uwbbench.api.detections import Detections
from uwbbench.api.frames import Frames
from uwbbench.api.stage import Params, Stage, ports


class Kernel(Stage[Params]):
    """The work of several stages, done together.

    A detector's YAML stays a chain of small stages; when a pipeline is assembled, a kernel that knows a run of them
    takes it over, as a database pushes a predicate into a scan. The detections must be those of the chain: the same
    rows, with values that differ by no more than the rounding of logarithms and trigonometric functions.

    Registered as an entry point of the group ``uwbbench.kernels``.

    Parameters
    ----------
    stages : sequence of Stage
        The opened stages taken over, as many as :meth:`covers` returned.
    threads : int
        Threads that a long block may be shared among.
    preface : sequence of str
        Notes that come before those of the stages.
    """

    produces: ClassVar[frozenset[str]] = ports("detections")

    def __init__(self, stages: Sequence[Stage[Any]], threads: int = 1, preface: Sequence[str] = ()) -> None:
        super().__init__(Params())
        self.stages = tuple(stages)
        self.threads = threads
        self.preface = tuple(preface)
        self.radar = stages[0].radar
        self.gather_notes()

    @classmethod
    def covers(cls, stages: Sequence[Stage[Any]]) -> int:
        """How many of these opened stages, from the first on, the kernel does in one pass; 0 for none."""
        raise NotImplementedError

    def detect(self, frames: Frames, first_path: FloatArray | None) -> Detections:
        """Detections in consecutive frames.

        Parameters
        ----------
        frames : Frames
            Invalid ones may hold any values.
        first_path : (frames,) array or None
            What an earlier stage made of it; None where the kernel finds it itself.

        Returns
        -------
        Detections
            With the valid frames as ``processed``, and the kernel's notes.
        """
        raise NotImplementedError

    def gather_notes(self) -> None:
        """Take over what the stages have noted; implementers call this whenever one may have."""
        self.notes = list(dict.fromkeys([*self.preface, *(note for stage in self.stages for note in stage.notes)]))

    def step(self, block: Block) -> Block:
        """Block with the detections."""
        return block.replace(detections=self.detect(block.frames, block.first_path))
