"""Frames aligned to a running template of the direct path, each response by itself."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, ConfigError, FloatArray, Radar, Stage, ports
from uwbbench_detectors.integrate.motion import MotionParams, places_m, plain, single


class AlignTemplateParams(MotionParams):
    """Where the direct path is found, where it goes, and how its template is kept."""

    crest_within_taps: int = Field(
        8, ge=1, description="The crest of the direct path is searched in this many taps behind the noise taps."
    )
    to_tap: int = Field(7, ge=2, description="Tap that the crest is moved to.")
    lead_taps: int = Field(
        6, ge=1, description="The template is fitted from this many taps before the crest on: the flank that no echo "
        "reaches.",
    )  # fmt: skip
    trail_taps: int = Field(
        2,
        ge=0,
        description="Taps behind the crest that are fitted too. Two lower the variance of the shift by a factor of "
        "2.4; an echo from within half a metre lies on them and drags the frame along. 0 leaves it alone.",
    )
    memory: int = Field(200, ge=4, description="Looks that the template remembers.")
    step_m: float = Field(
        0.004, ge=0, description="Way between two looks that renew the template: frames of a standing robot are one."
    )
    minimum_snr_db: float = Field(
        20.0, description="Responses whose direct path stands less than this above the noise are refused."
    )


class AlignTemplate(Stage[AlignTemplateParams]):
    """Frames shifted, turned and scaled so that the direct path of each response lies on its own running template.

    The crest of a direct path alone is a noisy reference: three taps of it are used. Once a template T of the direct
    path is known, a frame near the crest is ``a(t) = g T(t - tau) + n(t)``, to first order in the shift
    ``g T + h T'`` with ``h = -g tau``. Two Gauss-Newton steps of least squares over the leading flank and the crest
    give ``tau = -Re(h / g)`` with the least variance that any unbiased estimator has there,
    ``sigma^2 / (2 |g|^2 sum |T'|^2)``; then the frame is moved by a windowed sinc and divided by g. The template is the
    mean of the aligned frames, renewed once the robot has moved, so that echoes, whose phases turn, average out of it.
    Up to the fourth look the crest itself is the reference, by parabolas through logarithms, and the zero of delay
    stays that of these first looks.

    The preamble and both STS responses are aligned each to a template of its own, since they come from accumulators
    whose clocks differ by fractions of a tap and whose direct paths ring differently. Behind this stage a sample is
    relative to the direct path of its response: phase differences between responses are those to the direct path's.
    ``first_path`` is ``to_tap``; refused frames are all zero and yield nothing. Radars whose delays count from
    transmission are coherent and pass unchanged.

    Raises
    ------
    ConfigError
        From ``open``, if search window or target lie outside the frame or too far apart.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("frames", "first_path")

    def open(self, radar: Radar) -> None:
        """Start without templates."""
        super().open(radar)
        p = self.params
        self._skips = radar.first_tap_delay_s is not None
        if self._skips:
            self.note("align.template left out: delays of this radar count from transmission")
            return
        from uwbbench_detectors.first_path import fractional
        from uwbbench_detectors.first_path import template_loops as loops

        stop = min(radar.noise_taps + p.crest_within_taps, radar.taps)
        if stop <= radar.noise_taps or p.to_tap > radar.taps - p.trail_taps - 2:
            raise ConfigError(
                f"align.template: to_tap {p.to_tap} and {p.crest_within_taps} taps behind the radar's "
                f"{radar.noise_taps} noise taps do not fit into a frame of {radar.taps} taps"
            )
        if max(stop - 1 - p.to_tap, p.to_tap - radar.noise_taps) > loops.REACH:
            raise ConfigError(
                f"align.template: a crest between taps {radar.noise_taps} and {stop - 1} cannot be moved to to_tap "
                f"{p.to_tap}: at most {loops.REACH} taps lie between"
            )
        self._align = loops.align_frames
        self.table = fractional.between_table()
        self.at: FloatArray = np.zeros(loops.SETTINGS)
        self.at[loops.TO_TAP], self.at[loops.LEAD] = p.to_tap, p.lead_taps
        self.at[loops.TRAIL] = p.trail_taps
        self.at[loops.CREST_START], self.at[loops.CREST_STOP] = radar.noise_taps, stop
        self.at[loops.MEMORY], self.at[loops.STEP_M] = p.memory, p.step_m
        self.at[loops.POWER_RATIO], self.at[loops.LEADING] = 10 ** (p.minimum_snr_db / 10), radar.noise_taps
        responses = 3 if radar.has_sts else 1
        self.templates = np.zeros((responses, 4, radar.taps), np.float32)
        self.carried: FloatArray = np.zeros((responses, loops.CARRIED))
        self.carried[:, [loops.X_M, loops.Y_M]] = np.nan

    def step(self, block: Block) -> Block:
        """Block with aligned frames."""
        frames = block.frames
        if self._skips:
            first_tap_s = self.radar.first_tap_delay_s or 0.0
            zero = np.full(len(frames), -first_tap_s / self.radar.sample_interval_s)
            return block.replace(first_path=zero)
        place_m, _ = places_m(self, frames)
        valid = plain(frames.valid, np.bool_)
        parts, refused = {}, False
        for place, name in enumerate(("preamble", "sts1", "sts2")):
            samples = getattr(frames, name)
            if samples is None:
                continue
            clear = np.empty(len(frames), bool)
            samples = single(samples)
            made = self._align(
                samples, valid, place_m, self.templates[place], self.carried[place], self.at, self.table, clear
            )
            parts[name] = plain(made, np.complex64)
            refused |= not clear[frames.valid].all()
        if refused:
            self.note_refused()
        zero = np.full(len(frames), float(self.params.to_tap))
        aligned = dataclasses.replace(frames, **parts)
        return block.replace(frames=aligned, first_path=zero)

    def note_refused(self) -> None:
        """Say that responses were refused."""
        self.note(
            "align.template: responses whose direct path stands less than "
            f"{self.params.minimum_snr_db:g} dB above the noise were refused and yield nothing"
        )
