"""What a scene says about the radar: pulse, frames and where the antennas are mounted."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Params, Pulse
from uwbbench_datasets.simulator.pulses import GaussianPulse, RaisedCosinePulse
from uwbbench_datasets.simulator.trajectory import Point, in_space

CHIP_S = 1 / 499.2e6
"""Chip duration of IEEE 802.15.4 HRP UWB: two taps."""


class PulseModel(Params):
    """Pulse shape."""

    shape: Literal["gauss", "raised_cosine"] = Field(
        default="gauss", description="raised_cosine: that of IEEE 802.15.4."
    )
    fwhm_ns: float = Field(
        default=3.2, gt=0, description="Width of the Gaussian at half height; unused by raised_cosine."
    )

    def pulse(self) -> Pulse:
        """The pulse itself."""
        return RaisedCosinePulse(CHIP_S) if self.shape == "raised_cosine" else GaussianPulse(self.fwhm_ns * 1e-9)


class RadarModel(Params):
    """What all receivers of the scene share."""

    channel: Literal[5, 9] = Field(default=9, description="IEEE 802.15.4 channel.")
    taps: int = Field(default=50, ge=8, le=4096, description="Samples of one frame, half a chip (1.0016 ns) apart.")
    frame_rate_hz: float = Field(default=48.0, gt=0)
    crest_tap: float = Field(default=7.0, ge=0, description="Tap of the direct path's crest.")
    noise_taps: int = Field(default=4, ge=0, description="Leading taps that precede any arrival.")
    pulse: PulseModel = PulseModel()
    array_spacing_mm: float = Field(
        default=17.8, gt=0, description="Distance of the two antennas, the same on all channels."
    )
    gain_dbi: float = Field(
        default=6.0, description="Receiving antenna's gain for echoes; the direct path is without it."
    )
    sts: bool = Field(default=True, description="Whether frames hold the two STS responses.")

    @model_validator(mode="after")
    def _taps_fit(self) -> RadarModel:
        if not self.noise_taps <= self.crest_tap < self.taps:
            raise ValueError("crest_tap must lie behind the noise_taps and before the last tap")
        return self


class ReceiverModel(Params):
    """One receiver on the robot, and the transmitter that it listens to."""

    mount_position_m: Point = Field(default=[0.0, 0.0], description="Receiver in the robot frame.")
    mount_yaw_deg: float = Field(default=0.0, description="Boresight in the robot frame.")
    tx_position_m: Point = Field(default=[0.0, -0.25], description="Transmitter in the robot frame.")

    @model_validator(mode="after")
    def _apart(self) -> ReceiverModel:
        if np.array_equal(in_space(self.mount_position_m), in_space(self.tx_position_m)):
            raise ValueError("tx_position_m and mount_position_m are equal: a direct path needs a distance to fly")
        return self
