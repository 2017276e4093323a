"""Phase difference of arrival between the two antennas behind STS1 and STS2."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from uwbbench.api import (
    Block,
    ComplexArray,
    ConfigError,
    FloatArray,
    Frames,
    IntArray,
    Params,
    Radar,
    Stage,
    ports,
    wrap_angle,
)


class PdoaParams(Params):
    """Which STS samples are compared, and how."""

    sample: Literal["aligned", "same_tap", "fractional"] = Field(
        "aligned",
        description="STS sample that belongs to a detection: 'aligned' counts taps from each response's own reported "
        "first path and rounds, 'fractional' interpolates there instead, 'same_tap' reads the preamble's tap. The "
        "three responses come from separate accumulators: a tap off costs amplitude for a lone echo, and picks the "
        "wrong scatterer where two overlap.",
    )
    phase: Literal["atan2", "arctan"] = Field(
        "atan2",
        description="'arctan' is the arctan(Q/I) of arXiv 2512.01018 ('Signal processing') taken literally: the "
        "difference is then wrong by pi with probability |alpha|/pi (10 % at 0.3 rad, 68 % at 2.13 rad).",
    )
    wrap: Literal["half_open", "closed_above"] = Field(
        "half_open", description="Interval of the result: [-pi, pi) or (-pi, pi]; they differ at pi alone."
    )
    reference: Literal["none", "direct", "aligned"] = Field(
        "none",
        description="'direct' takes the phase difference of the direct path off and adds what the geometry expects of "
        "it, which cancels a carrier offset between the STS halves and cable phases; 'aligned' adds alone, where "
        "'align.template' has taken it off already.",
    )


class Pdoa(Stage[PdoaParams]):
    """Phase difference of arrival of each detection, phase(STS2) - phase(STS1).

    Positive where the target stands left of boresight. NaN where the sample lies outside the window, or where one of
    the two is zero and so has no phase.

    With ``reference: direct`` the difference becomes ``alpha - alpha_direct + 2 pi s / lambda sin(theta_TX)``: the
    direct path is read at the block's first path by the same sampling rule, ``s`` is the antenna spacing, and
    ``sin(theta_TX)`` the lateral part of the unit vector from receiver to transmitter. With ``reference: aligned``
    responses are relative to their direct paths, which may be gone, and the last term alone is added.

    Raises
    ------
    ConfigError
        For a reference other than ``none``, if the radar has no antenna spacing, or its transmitter stands at the
        receiver and
        the direct path has no direction.

    References
    ----------
    arXiv 2512.01018 (the difference and its wrapping).
    """

    consumes = ports("frames", "first_path", "detections", "tap")
    produces = ports("pdoa_rad")
    needs = ports("sts")
    rowwise = True
    fidelity = "from-source"

    def open(self, radar: Radar) -> None:
        """Work out the phase difference that the direct path should have."""
        super().open(radar)
        self.expected_rad = 0.0 if self.params.reference == "none" else _direct_path_pdoa(radar, self.params.reference)

    def step(self, block: Block) -> Block:
        """Block whose detections carry ``pdoa_rad``."""
        rows = block.rows
        alpha = self._difference(block.frames, rows, block.detections["tap"])
        if self.params.reference == "direct":
            alpha = alpha - self._difference(block.frames, rows, block.part("first_path")[rows])
        alpha = alpha + self.expected_rad
        wrapped = wrap_angle(alpha) if self.params.wrap == "half_open" else -wrap_angle(-alpha)
        return block.with_columns(pdoa_rad=wrapped)

    def _difference(self, frames: Frames, rows: IntArray, tap: FloatArray) -> FloatArray:
        """Unwrapped phase differences (n,) at preamble taps (n,) of frames ``rows``."""
        phases = []
        for samples, first_path in (
            (frames.sts1, frames.first_path_index_sts1),
            (frames.sts2, frames.first_path_index_sts2),
        ):
            assert samples is not None  # noqa: S101  (the stage needs sts)
            at = tap
            if self.alignment(frames) and first_path is not None and frames.first_path_index is not None:
                at = first_path[rows] + (tap - frames.first_path_index[rows])
            phases.append(self._phase(self._sampled(samples, rows, at)))
        return phases[1] - phases[0]

    def alignment(self, frames: Frames) -> bool:
        """Whether taps are counted from each response's own first path; a note says if they should be and cannot."""
        if self.params.sample == "same_tap":
            return False
        paths = frames.first_path_index, frames.first_path_index_sts1, frames.first_path_index_sts2
        if any(path is None for path in paths):
            self.note("pdoa: no first path is reported for each response, so STS is read at the preamble's tap")
            return False
        return True

    def _sampled(self, samples: ComplexArray, rows: IntArray, at: FloatArray) -> ComplexArray:
        """Samples (n,) at fractional taps; NaN outside the window."""
        last = samples.shape[1] - 1
        if self.params.sample != "fractional":
            at = np.floor(at + 0.5)
        within = (at >= 0) & (at <= last)
        lower = np.floor(np.where(within, at, 0.0)).astype(np.int64)
        upper = np.minimum(lower + 1, last)
        weight = np.where(within, at, 0.0) - lower
        below, above = samples[rows, lower].astype(np.complex128), samples[rows, upper].astype(np.complex128)
        return np.where(within, (1 - weight) * below + weight * above, np.nan)

    def _phase(self, samples: ComplexArray) -> FloatArray:
        """Phase (n,) of complex samples; NaN where the sample is zero."""
        if self.params.phase == "arctan":
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.asarray(np.arctan(samples.imag / samples.real))
        return np.where(samples == 0, np.nan, np.angle(samples))


def _direct_path_pdoa(radar: Radar, reference: str) -> float:
    """Phase difference of a plane wave from the transmitter, ``2 pi s / lambda sin(theta_TX)``."""
    if radar.array_spacing_m is None:
        raise ConfigError(
            f"pdoa: reference '{reference}' needs the antenna spacing, which receiver '{radar.receiver}' lacks"
        )
    distance_m = radar.baseline_length_m
    if distance_m == 0:
        raise ConfigError(
            f"pdoa: reference '{reference}' needs a transmitter apart from receiver '{radar.receiver}': without a "
            "baseline the direct path has no direction"
        )
    return float(2 * np.pi * radar.array_spacing_m / radar.wavelength_m * radar.baseline_m[1] / distance_m)
