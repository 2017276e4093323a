"""Removal of what does not change from frame to frame: direct path, ringing of the chassis, standing structure.

On a robot these stages are meant for what moves along with it. They cannot separate it from an obstacle that keeps its
distance, which vanishes likewise: while the robot stands, or drives along a wall.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import ClassVar, Literal, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Block, ComplexArray, IntArray, Params, Radar, Stage, ports

P = TypeVar("P", bound=Params)


class ClutterRemoval(Stage[P]):
    """Frames without their stationary part.

    Invalid and all-zero frames are passed over: they come out as zeros and leave no trace in the background.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("frames")

    def remove(self, samples: ComplexArray, index: IntArray) -> ComplexArray:
        """What is left of consecutive usable frames.

        Parameters
        ----------
        samples : (frames, taps) complex128 array
        index : (frames,) int array
            Their indices in the capture.
        """
        raise NotImplementedError

    def open(self, radar: Radar) -> None:
        """Load the inner loops."""
        super().open(radar)
        from uwbbench_detectors.clutter import loops as clutter_loops

        self.loops = clutter_loops

    def step(self, block: Block) -> Block:
        """Block with cleaned frames."""
        frames = block.frames
        samples = np.ascontiguousarray(frames.preamble, dtype=np.complex128)
        usable = self.loops.usable_frames(samples, frames.valid)
        if usable.all():
            return block.replace(frames=frames.with_preamble(self.remove(samples, frames.index)))
        cleaned = np.zeros_like(samples)
        if usable.any():
            cleaned[usable] = self.remove(samples[usable], frames.index[usable])
        return block.replace(frames=frames.with_preamble(cleaned))


LEAST_FRAMES = 16
"""Of a background whose length is given in seconds: a sixteenth of an echo, 0.6 dB, goes with it at worst."""


def frames_within(seconds: float, radar: Radar) -> int:
    """Frames that a radar takes in some time, at least :data:`LEAST_FRAMES`."""
    return max(round(seconds * radar.frame_rate_hz), LEAST_FRAMES)


class MeanClutterParams(Params):
    """What the mean is taken over."""

    window_frames: int | None = Field(
        None, ge=2, description="Frames of the running mean, the current one included; null: all frames so far."
    )
    window_s: float | None = Field(
        None,
        gt=0,
        description="Seconds of the running mean, so that one window fits radars of any frame rate; at least "
        f"{LEAST_FRAMES} frames. window_frames, where it is given too, goes before.",
    )

    def frames_for(self, radar: Radar) -> int | None:
        """Frames of the window for a radar; None for all so far."""
        if self.window_frames is not None or self.window_s is None:
            return self.window_frames
        return frames_within(self.window_s, radar)


class MeanClutter(ClutterRemoval[MeanClutterParams]):
    """Frame minus the mean of the frames so far.

    The mean is causal and includes the current frame, so that the first frame comes out as zero and an echo that has
    just arrived loses one part in the number of frames. A static obstacle vanishes. Frames whose phase is random must
    be aligned first.

    No frame is ever subtracted from a running sum, which would leave its rounding error behind for good: a windowed
    sum is put together from the rows of the current stretch of ``window_frames`` frames and from partial sums of the
    stretch before it (van Herk, Pattern Recognition Letters 13, 1992).
    """

    def open(self, radar: Radar) -> None:
        """Start with an empty background."""
        super().open(radar)
        self._count = 0
        self._head = np.zeros(radar.taps, dtype=np.complex128)
        self._stretch = np.zeros((self.params.frames_for(radar) or 0, radar.taps), dtype=np.complex128)
        self._tail = np.zeros_like(self._stretch)

    def remove(self, samples: ComplexArray, index: IntArray) -> ComplexArray:  # noqa: ARG002
        """Frames minus their running mean."""
        residue: ComplexArray = self.loops.less_mean(samples, self._count, self._head, self._stretch, self._tail)
        self._count += len(samples)
        return residue


class ExponentialClutterParams(Params):
    """How fast the background forgets."""

    memory: float = Field(0.97, gt=0, lt=1, description="Share of the background that survives a frame; 0.95 to 0.99.")
    memory_s: float | None = Field(
        None,
        gt=0,
        description="Time constant of the background, so that one value fits radars of any frame rate; at least "
        f"{LEAST_FRAMES} frames. memory, where it is given too, goes before.",
    )
    adaptive: bool = Field(
        False, description="Update only taps near the background, so that echoes do not enter it (selective average)."
    )
    gate_sigmas: float = Field(3.0, gt=0, description="Adaptive: a tap is updated within this many deviations.")
    spread_memory: float = Field(0.9, gt=0, lt=1, description="Adaptive: memory of the deviation of each tap.")

    def gain_for(self, radar: Radar) -> float:
        """Share of a new frame in the background of a radar."""
        if self.memory_s is None or "memory" in self.model_fields_set:
            return 1 - self.memory
        return -math.expm1(-1 / max(self.memory_s * radar.frame_rate_hz, LEAST_FRAMES))


class ExponentialClutter(ClutterRemoval[ExponentialClutterParams]):
    """Frame minus an exponential average of the frames before it.

    ``y_k = x_k - b_{k-1}``, ``b_k = b_{k-1} + (1 - memory) (x_k - b_{k-1})``, starting from the first frame, which
    comes out as zero. The background is that of the frame before, so that an echo keeps its full height. An obstacle
    that stands still fades with a time constant of ``1 / (1 - memory)`` frames. What is left within the rounding error
    of the average becomes zero, such as the crest of aligned frames, which is 1 in all of them. Frames whose phase is
    random must be aligned first.

    With ``adaptive`` a tap is updated, background and deviation alike, only where it lies within ``gate_sigmas``
    deviations of the background. During the first ``1 / (1 - spread_memory)`` frames every tap is updated and the
    deviation is a plain mean. An obstacle that arrives later and stays is kept in sight, and so is any later change of
    the clutter itself.
    """

    def open(self, radar: Radar) -> None:
        """Start without a background."""
        super().open(radar)
        self._gain = self.params.gain_for(radar)
        self._background = np.zeros(radar.taps, dtype=np.complex128)
        self._variance = np.zeros(radar.taps)
        self._count = 0

    def remove(self, samples: ComplexArray, index: IntArray) -> ComplexArray:  # noqa: ARG002
        """Frames minus the background before them."""
        p = self.params
        gain = self._gain
        operations = float(math.ceil(4 / gain))
        if self._count == 0 and len(samples):
            self._background[:] = samples[0]
        if p.adaptive:
            settings = (gain, 1 - p.spread_memory, p.gate_sigmas**2, operations)
            residue: ComplexArray = self.loops.less_selective(
                samples, self._background, self._variance, self._count, settings
            )
        else:
            residue = self.loops.less_exponential(samples, self._background, gain, operations)
        self._count += len(samples)
        return residue


class TemplateClutterParams(Params):
    """What the template is made of, and how it is fitted."""

    source: Literal["frames", "background"] = Field(
        "frames",
        description="'frames': the first ones of the capture itself. 'background': the capture of the same radar with "
        "nothing in view, which the capture must bring along.",
    )
    frames: int = Field(
        100, ge=1, description="First frames, known to hold no obstacle, whose mean is the template; with 'frames'."
    )
    span_ns: float | None = Field(
        3.0, gt=0, description="The gain is fitted this far to both sides of the template's crest; null: on all taps."
    )

    @model_validator(mode="after")
    def _frames_are_used(self) -> Self:
        if self.source == "background" and "frames" in self.model_fields_set:
            raise ValueError("'frames' has no meaning with source 'background', whose mean is over all of its frames")
        return self


class TemplateClutter(ClutterRemoval[TemplateClutterParams]):
    """Frame minus a fixed template with a complex gain of its own.

    The template c is the mean of the first frames, or of all frames of a background; every later frame x loses ``a c``
    with the least-squares gain ``a = c^H x / |c|^2`` over the taps around the crest of c, which follows gain and phase
    of the direct path. The first frames come out as zero where the template is made of them. Frames whose phase is
    random must be aligned first, or the template averages out.

    Behind a background an obstacle that stands still stays in sight, as long as radar and structure do not move either.
    """

    @classmethod
    def needs_with(cls, params: Params) -> frozenset[str]:
        """A background, where the template is made of one."""
        return ports("background") if getattr(params, "source", None) == "background" else cls.needs

    def open(self, radar: Radar) -> None:
        """Start collecting frames."""
        super().open(radar)
        self._collected: list[ComplexArray] = []
        self._count = 0
        self._made_of = self.params.frames if self.params.source == "frames" else 0

    def show_background(self, blocks: Iterable[Block]) -> None:
        """Make the template of the usable frames of a background."""
        total = np.zeros(self.radar.taps, dtype=np.complex128)
        for block in blocks:
            samples = np.ascontiguousarray(block.frames.preamble, dtype=np.complex128)
            for frame in samples[self.loops.usable_frames(samples, block.frames.valid)]:
                total += frame  # one by one, so that the sum does not hang on the blocks
                self._made_of += 1
        self._count = self._made_of
        if not self._made_of:
            self.note("clutter.template: the background has no usable frame, so that nothing is taken away")
        self._finish(total / max(self._made_of, 1))

    def remove(self, samples: ComplexArray, index: IntArray) -> ComplexArray:  # noqa: ARG002
        """Frames minus the fitted template; zeros while it is being made."""
        missing = self._made_of - self._count
        if missing > 0:
            self.note(f"clutter.template: the first {self.params.frames} frames make the template and yield nothing")
            self._collected.append(samples[:missing])
            self._count += len(samples[:missing])
            if self._count == self._made_of:
                self._finish(np.concatenate(self._collected).mean(axis=0))
                self._collected = []
        cleaned = np.zeros_like(samples)
        later = samples[max(missing, 0) :]
        if len(later):
            operations = float(self._made_of + later.shape[1])
            cleaned[-len(later) :] = self.loops.less_template(later, self._template, self._weights, operations)
        return cleaned

    def flush(self) -> None:
        """Say so if the capture ended before the template was complete."""
        if self._count < self._made_of:
            self.note(f"clutter.template: the capture has only {self._count} usable frames of {self.params.frames}")

    def _finish(self, template: ComplexArray) -> None:
        """Template with a crest of 1, and the weights that turn a frame into its gain."""
        height = np.abs(template)
        crest = int(np.argmax(height))
        if height[crest] > 0:
            template = template / height[crest]
        near = np.ones(len(template), dtype=bool)
        if self.params.span_ns is not None:
            reach = self.params.span_ns * 1e-9 / self.radar.sample_interval_s + 1e-6  # 3 ns are 3 taps of 1e-9 s
            near = np.abs(np.arange(len(template)) - crest) <= reach
        power = np.sum(np.abs(template[near]) ** 2)
        self._template = template
        self._weights = np.where(near, template.conj(), 0) / (power if power > 0 else 1.0)
