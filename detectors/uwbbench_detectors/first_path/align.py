"""Delay, phase and gain of the direct path made equal in all frames."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, ComplexArray, ConfigError, FloatArray, Params, Radar, Stage, ports

UPSAMPLING = 16
"""Points a tap at which the band-limited response is searched for its crest."""


class AlignParams(Params):
    """Where the direct path is found, and where it goes."""

    crest_within_taps: int = Field(
        8, ge=1, description="The crest of the direct path is searched in the first taps of the frame, this many."
    )
    to_tap: float = Field(7.0, ge=0, description="Tap that the crest is moved to.")
    minimum_snr_db: float = Field(
        20.0, description="Frames whose direct path stands less than this above the noise are refused."
    )


class Align(Stage[AlignParams]):
    """Frames shifted, turned and scaled so that the crest of the direct path is 1 at a fixed tap.

    Impulse radio transceivers sample on a grid that is not locked to the direct path, with a phase and a gain of their
    own in every frame, so that nothing coherent can be done across frames before the direct path is made the
    reference: with H the spectrum of a frame and t0 the tap of its crest on a sixteenfold finer grid, refined by a
    parabola through the logarithms,

        ``aligned = IDFT(H exp(2 pi i f (t0 - to_tap))) / h(t0)``.

    The shift is circular: samples pushed over one end of the frame return at the other. A reported first path moves
    along with the samples. STS responses have accumulators and first paths of their own and stay as they are. Refused
    frames become all zero, which no stage takes for a signal. Radars whose delays count from transmission are coherent
    and pass unchanged.

    Raises
    ------
    ConfigError
        From ``open``, if search window or target lie outside the frame.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("frames")

    def open(self, radar: Radar) -> None:
        """Prepare the fine grid."""
        super().open(radar)
        self._skips = radar.first_tap_delay_s is not None
        if self._skips:
            self.note(
                "align left out: delays of this radar count from transmission, and no direct path is in the frame"
            )
            return
        p = self.params
        if p.to_tap > radar.taps - 1:
            raise ConfigError(f"align: to_tap is {p.to_tap:g}, but the last tap of a frame is {radar.taps - 1}")
        stop = min(p.crest_within_taps, radar.taps)
        if stop <= radar.noise_taps:
            raise ConfigError(
                f"align: crest_within_taps is {p.crest_within_taps}, but the radar's first {radar.noise_taps} taps "
                f"precede any arrival, and a frame has {radar.taps} taps"
            )
        grid = np.arange(radar.noise_taps * UPSAMPLING, stop * UPSAMPLING) / UPSAMPLING
        turn: FloatArray = 2 * np.pi * np.asarray(np.fft.fftfreq(radar.taps), dtype=np.float64)
        half = turn[: radar.taps // 2 + 1]
        fine = np.exp(1j * half[:, None] * grid) / radar.taps
        from uwbbench_detectors.first_path.align_loops import turned_spectra

        self._turned_spectra = turned_spectra
        self._settings: tuple[FloatArray, FloatArray, FloatArray, ComplexArray, int, float] = (
            np.stack([fine.real, fine.imag]),
            grid,
            half,
            np.exp(-1j * turn * p.to_tap),
            radar.noise_taps,
            10 ** (p.minimum_snr_db / 20),
        )

    def step(self, block: Block) -> Block:
        """Block with aligned frames."""
        if self._skips:
            return block
        frames = block.frames
        samples = np.ascontiguousarray(frames.preamble, dtype=np.complex128).view()
        samples.flags.writeable = False  # as those of a capture, or all were compiled for either
        spectra = np.fft.fft(samples, axis=1)
        turned, crest_tap, clear = self._turned_spectra(samples, spectra, frames.valid, *self._settings)
        if not clear[frames.valid].all():
            self.note(
                "align: frames whose direct path stands less than "
                f"{self.params.minimum_snr_db:g} dB above the noise were refused and yield nothing"
            )
        aligned = np.fft.ifft(turned, axis=1)
        reported = frames.first_path_index
        if reported is not None:
            reported = np.where(clear, reported + self.params.to_tap - crest_tap, reported)
        return block.replace(frames=dataclasses.replace(frames, preamble=aligned, first_path_index=reported))
