"""Removal of the stationary part of STS responses, whose phase difference gives the bearing."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, ComplexArray, FloatArray, Frames, Params, Radar, Stage, ports
from uwbbench_detectors.clutter.background import ExponentialClutter, ExponentialClutterParams
from uwbbench_detectors.first_path.align import Align, AlignParams


class StsClutterParams(Params):
    """Where the direct path goes, and how fast the background forgets."""

    to_tap: float = Field(7.0, ge=0, description="Tap that the crest of the direct path is moved to; as of 'align'.")
    memory: float = Field(0.985, gt=0, lt=1, description="Share of the background that survives a frame.")


class StsClutter(Stage[StsClutterParams]):
    """STS responses without an exponential average of those before, on the taps of aligned frames.

    Ringing of the chassis and the tail of the direct path are in the STS responses too, and drag the phase difference
    of a weaker echo towards their own: in simulation a rod 85 cm away at 34 degrees is seen at 11. Each response
    is aligned and cleaned as ``align`` and ``clutter.exponential`` do it with the preamble, and then gets back the
    phase and gain of its own direct path, so that the difference between the two antennas is what it was. Read it
    with ``pdoa: {sample: same_tap}``: both responses then lie on the taps of the aligned preamble.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("frames")
    needs: ClassVar[frozenset[str]] = ports("sts")

    def open(self, radar: Radar) -> None:
        """Start without a background."""
        super().open(radar)
        self._skips = radar.first_tap_delay_s is not None
        self._turn: FloatArray = 2 * np.pi * np.asarray(np.fft.fftfreq(radar.taps), dtype=np.float64)
        align = AlignParams.model_validate({"to_tap": self.params.to_tap})
        clutter = ExponentialClutterParams.model_validate({"memory": self.params.memory})
        self._antennas = [(Align(align), ExponentialClutter(clutter)) for _ in range(2)]
        for stages in self._antennas:
            for stage in stages:
                stage.open(radar)

    def step(self, block: Block) -> Block:
        """Block with cleaned STS responses."""
        frames = block.frames
        assert frames.sts1 is not None  # noqa: S101  (the stage needs sts)
        assert frames.sts2 is not None  # noqa: S101
        cleaned = [
            self._cleaned(frames, samples, *stages)
            for samples, stages in zip((frames.sts1, frames.sts2), self._antennas, strict=True)
        ]
        for align, _ in self._antennas:
            for text in align.notes:
                self.note(f"clutter.sts: {text}")
        return block.replace(frames=dataclasses.replace(frames, sts1=cleaned[0], sts2=cleaned[1]))

    def _cleaned(
        self, frames: Frames, samples: ComplexArray, align: Align, clutter: ExponentialClutter
    ) -> ComplexArray:
        """One response (frames, taps) aligned, cleaned, and with the phase and gain of its direct path."""
        own = dataclasses.replace(frames.with_preamble(samples), first_path_index=np.zeros(len(frames)))
        aligned = align.step(Block(own))
        left = clutter.step(aligned).frames.preamble
        moved = aligned.frames.first_path_index
        if self._skips or moved is None:
            return left
        spectra = np.fft.fft(samples.astype(np.complex128), axis=1)
        crest = (spectra * np.exp(1j * self._turn * (self.params.to_tap - moved)[:, None])).mean(axis=1)
        return np.asarray(left * crest[:, None])
