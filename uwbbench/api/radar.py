"""What is known of a radar before its first frame."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from uwbbench.api.arrays import FloatArray, locked
from uwbbench.api.errors import CaptureError
from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S, rotate_z
from uwbbench.api.text import quoted

Vector = tuple[float, float, float]

CHANNEL_CENTER_HZ = {5: 6489.6e6, 9: 7987.2e6}
"""Carriers of the two channels that DW3000 radios have (IEEE 802.15.4-2020, HRP UWB band plan)."""

_LEAST, _MOST = 1e-18, 1e18
"""Of any frequency and interval, far beyond what there is: products of them neither overflow nor vanish."""


@dataclass(frozen=True)
class Radar:
    """One receiver of a radar and its transmitter.

    Parameters
    ----------
    model : str
        Device name, for people.
    center_frequency_hz, bandwidth_hz : float
        Carrier and bandwidth.
    sample_interval_s : float
        Fast-time spacing of the taps.
    frame_rate_hz : float
        Frames a second of this receiver.
    taps : int
        Samples of one frame.
    samples : {"iq", "rf"}
        How the device stores them; frames are always handed out as complex (analytic) samples.
    channel : int or None
        IEEE 802.15.4 channel number, where there is one.
    receiver : str
        Name of the receiver inside the capture.
    mount_position_m : tuple of float
        Receiver in the robot frame.
    mount_yaw_rad : float
        Boresight in the robot frame.
    tx_position_m : tuple of float
        Transmitter in the robot frame; equal to the mount of a monostatic radar.
    noise_taps : int
        Leading taps that precede any arrival; 0 if none.
    array_spacing_m : float or None
        Distance of the two antennas behind STS1 and STS2.
    first_tap_delay_s : float or None
        Delay of tap 0 from transmission; None where delays count from the direct path instead.
    has_sts : bool
        Whether both STS responses are present.
    has_first_path : bool
        Whether the device reports the direct path's tap.
    """

    model: str
    center_frequency_hz: float
    bandwidth_hz: float
    sample_interval_s: float
    frame_rate_hz: float
    taps: int
    samples: Literal["iq", "rf"] = "iq"
    channel: int | None = None
    receiver: str = "main"
    mount_position_m: Vector = (0.0, 0.0, 0.0)
    mount_yaw_rad: float = 0.0
    tx_position_m: Vector = (0.0, 0.0, 0.0)
    noise_taps: int = 0
    array_spacing_m: float | None = None
    first_tap_delay_s: float | None = None
    has_sts: bool = False
    has_first_path: bool = False

    def __post_init__(self) -> None:
        for name in ("sample_interval_s", "center_frequency_hz", "bandwidth_hz", "frame_rate_hz"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise CaptureError(f"radar {name} must be positive and finite, not {value!r}")
            if not _LEAST <= value <= _MOST:
                raise CaptureError(f"radar {name} must lie between {_LEAST:g} and {_MOST:g}, not {quoted(value)}")
        if self.taps < 1:
            raise CaptureError(f"a frame must have at least one tap, not {self.taps}")
        if not 0 <= self.noise_taps <= self.taps:
            raise CaptureError(f"noise_taps must lie between 0 and the {self.taps} taps, not {self.noise_taps}")

    @property
    def wavelength_m(self) -> float:
        """Carrier wavelength."""
        return SPEED_OF_LIGHT_M_S / self.center_frequency_hz

    @cached_property
    def baseline_m(self) -> FloatArray:
        """Vector (3,) from receiver to transmitter in the receiver frame (x = boresight)."""
        offset = np.subtract(self.tx_position_m, self.mount_position_m).astype(float)
        return locked(rotate_z(offset, -self.mount_yaw_rad))

    @property
    def baseline_length_m(self) -> float:
        """Distance D between transmitter and receiver."""
        return float(np.linalg.norm(self.baseline_m))

    @property
    def window_m(self) -> float:
        """Largest monostatic-equivalent range that the taps can hold, c T / 2."""
        first = self.first_tap_delay_s or 0.0
        return (first + self.taps * self.sample_interval_s) * SPEED_OF_LIGHT_M_S / 2

    def excess_m(self, delay_s: FloatArray) -> FloatArray:
        """Path length beyond the direct path for delays as a capture counts them.

        Where ``first_tap_delay_s`` is known a delay counts from transmission and the baseline is still inside it;
        otherwise it counts from the direct path, which has flown the baseline itself.
        """
        flown = delay_s * SPEED_OF_LIGHT_M_S
        return flown - self.baseline_length_m if self.first_tap_delay_s is not None else flown

    def differences(self, other: Radar) -> dict[str, tuple[Any, Any]]:
        """What makes another radar's frames no frames of this one, by name: this one's value, and the other's.

        The frame rate is no part of it: one radar may be run at several. Numbers that a file has rounded are equal.
        """
        pairs = {
            item.name: (getattr(self, item.name), getattr(other, item.name))
            for item in dataclasses.fields(self)
            if item.name != "frame_rate_hz"
        }
        return {name: pair for name, pair in pairs.items() if not _alike(*pair)}

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return dataclasses.asdict(self)


def _alike(one: Any, other: Any) -> bool:
    """Whether two values of a field are the same up to rounding."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, float) and isinstance(other, float | int):
        return math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-15)
    return bool(one == other)
