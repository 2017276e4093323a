"""What a scene says about the radar: pulse, frames and where the antennas are mounted."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import CHANNEL_CENTER_HZ, Params, Pulse, Radar
from uwbbench_datasets.simulator.pulses import GaussianPulse, RaisedCosinePulse
from uwbbench_datasets.simulator.trajectory import Point, in_space

CHIP_S = 1 / 499.2e6
"""Chip duration of IEEE 802.15.4 HRP UWB: two taps."""

_GAUSSIAN = 2 * np.sqrt(2 * np.log(2) * np.log(10)) / np.pi
"""Width at half height times bandwidth, where its power has fallen to -10 dB, of a Gaussian pulse: 1.14."""


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


class DeviceModel(Params):
    """A radar that is no IEEE 802.15.4 radio, with carrier, band and sampling of its own."""

    model: str = Field(min_length=1, description="Name of the device, for people.")
    carrier_ghz: float = Field(gt=0)
    bandwidth_ghz: float = Field(
        gt=0, description="Of what it records, at -10 dB; the width of the pulse follows from it."
    )
    sample_interval_ns: float = Field(gt=0, description="Time between two taps.")
    samples: Literal["iq", "rf"] = Field("iq", description="What it stores: the envelope's I and Q, or real RF.")
    first_tap_delay_ns: float | None = Field(
        None, description="Delay of tap 0 from transmission, which delays then count from; the direct path if left out."
    )


class RadarModel(Params):
    """What all receivers of the scene share."""

    device: DeviceModel | None = Field(default=None, description="A radar of another kind; a DW3000 if left out.")
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
        if self.counts_from_transmission:
            return self
        if not self.noise_taps <= self.crest_tap < self.taps:
            raise ValueError("crest_tap must lie behind the noise_taps and before the last tap")
        return self

    @model_validator(mode="after")
    def _device_alone(self) -> RadarModel:
        if self.device is None:
            return self
        given = self.model_fields_set & {"channel", "array_spacing_mm"}
        given |= {"sts"} if self.sts and "sts" in self.model_fields_set else set()
        given |= {"crest_tap", "noise_taps"} & self.model_fields_set if self.counts_from_transmission else set()
        if given:
            raise ValueError(f"a radar with a device of its own has no {sorted(given)[0]}; leave it out")
        if self.device.carrier_ghz <= self.device.bandwidth_ghz / 2:
            raise ValueError("device: carrier_ghz must be more than half of bandwidth_ghz")
        return self

    @property
    def counts_from_transmission(self) -> bool:
        """Whether delays count from transmission, so that the direct path need not be among the taps."""
        return self.device is not None and self.device.first_tap_delay_ns is not None

    def shape(self) -> Pulse:
        """The pulse: as the scene says, or as wide as the band of its device allows."""
        if self.device is None or "pulse" in self.model_fields_set:
            return self.pulse.pulse()
        return GaussianPulse(float(_GAUSSIAN) / (self.device.bandwidth_ghz * 1e9))

    def radar(self, receiver: str, mount: ReceiverModel) -> Radar:
        """Radar of one receiver.

        Parameters
        ----------
        receiver : str
            Its name.
        mount : ReceiverModel
        """
        mounted: dict[str, Any] = {
            "frame_rate_hz": self.frame_rate_hz,
            "taps": self.taps,
            "receiver": receiver,
            "mount_position_m": _triple(mount.mount_position_m),
            "mount_yaw_rad": float(np.radians(mount.mount_yaw_deg)),
            "tx_position_m": _triple(mount.tx_position_m),
            "noise_taps": 0 if self.counts_from_transmission else self.noise_taps,
        }
        if self.device is not None:
            first_ns = self.device.first_tap_delay_ns
            return Radar(
                model=f"simulated {self.device.model}",
                center_frequency_hz=self.device.carrier_ghz * 1e9,
                bandwidth_hz=self.device.bandwidth_ghz * 1e9,
                sample_interval_s=self.device.sample_interval_ns * 1e-9,
                samples=self.device.samples,
                first_tap_delay_s=None if first_ns is None else first_ns * 1e-9,
                **mounted,
            )
        return Radar(
            model="simulated DW3000",
            center_frequency_hz=CHANNEL_CENTER_HZ[self.channel],
            bandwidth_hz=1 / CHIP_S,
            sample_interval_s=CHIP_S / 2,
            channel=self.channel,
            array_spacing_m=self.array_spacing_mm * 1e-3,
            has_sts=self.sts,
            **mounted,
        )


def _triple(point: list[float]) -> tuple[float, float, float]:
    x, y, z = in_space(point)
    return float(x), float(y), float(z)


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
