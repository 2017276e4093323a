"""Range from delay, and position from range and azimuth."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    Block,
    ConfigError,
    FloatArray,
    Params,
    Radar,
    Stage,
    bistatic_range,
    bistatic_range_sine,
    direction,
    ports,
    receiver_pose,
    to_world,
)
from uwbbench_detectors.position.receivers import of_receiver

PAPER_BIAS_M = {5: 0.15, 9: 0.13}
"""Distance offsets of arXiv 2512.01018 by channel."""
ROUNDED_SPEED_M_S = 3.0e8


class RangeParams(Params):
    """How a delay becomes a range."""

    geometry: Literal["exact", "paper"] = Field(
        "exact",
        description="'exact' holds for any place of the transmitter; 'paper' is the sine form of arXiv 2512.01018 (end "
        "of 'Angle of Arrival'), right only for a transmitter beside the receiver on its right, and long by about "
        "10 cm for one 20 cm behind it.",
    )
    includes_baseline: bool = Field(
        True,
        description="Path d = c tau + D: the direct path that delays count from has flown the baseline D already. "
        "false takes d = c tau, which shortens ranges by about D/2.",
    )
    bias_m: float | Literal["paper"] | dict[str, float] = Field(
        0.0,
        description="Calibration offset that is subtracted, one for all receivers or by their names; 'paper' is 0.15 "
        "on channel 5 and 0.13 on channel 9 (table of key parameters of arXiv 2512.01018).",
    )
    speed_of_light: Literal["exact", "rounded"] = Field(
        "exact",
        description="'rounded' is the 3e8 m/s of arXiv 2512.01018 (table of symbols): 0.24 cm more at 3.4 m.",
    )
    tap_ns: float | None = Field(
        None,
        gt=0,
        description="Spacing of the taps that delays are made of; null takes the radar's own. arXiv 2512.01018 prints "
        "1 ns (table of radar configurations), while its chip samples every 1.0016 ns: 0.5 cm less at 3.4 m.",
    )


class Range(Stage[RangeParams]):
    """Delay and range of each detection.

    The delay is ``(tap - first path) * sample interval``, the radar's unless ``tap_ns`` gives another. Detections
    without an azimuth are taken to lie at boresight.
    The range is NaN where the path would be shorter than the baseline, which no target can cause.

    Raises
    ------
    ConfigError
        For ``bias_m: paper`` on a capture of neither channel 5 nor 9, or a receiver that ``bias_m`` does not name.

    References
    ----------
    arXiv 2512.01018 (sine form and offsets); law of cosines in the triangle transmitter, target, receiver
    (:func:`uwbbench.api.geometry.bistatic_range`).
    """

    consumes = ports("frames", "first_path", "detections", "tap")
    produces = ports("delay_s", "range_m")
    rowwise = True
    implied = True
    fidelity = "from-source"

    def open(self, radar: Radar) -> None:
        """Look up the bias of the radar's channel."""
        super().open(radar)
        bias = self.params.bias_m
        if bias == "paper":
            if radar.channel not in PAPER_BIAS_M:
                raise ConfigError(
                    f"range: bias_m 'paper' is known for channels 5 and 9; the capture's channel is {radar.channel}: "
                    "give a number in metres"
                )
            bias = PAPER_BIAS_M[radar.channel]
        self.bias_m = of_receiver(bias, radar, "range: bias_m")

    @property
    def speed_ratio(self) -> float:
        """Speed that is assumed, over the speed of light."""
        return 1.0 if self.params.speed_of_light == "exact" else ROUNDED_SPEED_M_S / SPEED_OF_LIGHT_M_S

    @property
    def interval_s(self) -> float:
        """Spacing of the taps that delays are made of."""
        return self.radar.sample_interval_s if self.params.tap_ns is None else self.params.tap_ns * 1e-9

    def recalibrated(self, column: str, offset: float) -> dict[str, float]:
        """A bias of ``offset`` metres more."""
        if column != "range_m":
            return {}
        if isinstance(self.params.bias_m, str):
            raise ConfigError(
                f"bias_m: a measured offset can be added to a number, not to the preset '{self.params.bias_m}'"
            )
        bias_m = of_receiver(self.params.bias_m, getattr(self, "radar", None), "bias_m")
        return {"bias_m": bias_m + offset}

    def step(self, block: Block) -> Block:
        """Block whose detections carry ``delay_s`` and ``range_m``, those of segments the ranges of their ends."""
        delay_s = self._delay_s(block, "tap")
        columns = {"delay_s": delay_s, "range_m": self._range_m(block, delay_s)}
        if "start_tap" in block.detections.names:
            columns["range_start_m"] = self._range_m(block, self._delay_s(block, "start_tap"))
            columns["range_stop_m"] = self._range_m(block, self._delay_s(block, "stop_tap"))
        return block.with_columns(**columns)

    def _delay_s(self, block: Block, tap: str) -> FloatArray:
        """Delays (n,) behind the first path of a column of taps."""
        return np.asarray((block.detections[tap] - block.part("first_path")[block.rows]) * self.interval_s)

    def _range_m(self, block: Block, delay_s: FloatArray) -> FloatArray:
        """Ranges (n,) of delays (n,)."""
        radar = self.radar
        flown_s = delay_s * self.speed_ratio
        if self.params.includes_baseline:
            excess_m = radar.excess_m(flown_s)
        else:
            excess_m = flown_s * SPEED_OF_LIGHT_M_S - radar.baseline_length_m
        azimuth_rad = np.nan_to_num(block.detections.azimuth_rad, nan=0.0)
        if self.params.geometry == "exact":
            range_m = bistatic_range(excess_m, direction(azimuth_rad), radar.baseline_m)
        else:
            range_m = bistatic_range_sine(excess_m, azimuth_rad, radar.baseline_length_m)
        return np.asarray(range_m - self.bias_m)


class PositionParams(Params):
    """Which pose carries detections into the world."""

    use_odometry: bool = Field(
        False, description="Use the robot's drifting odometry instead of the reference pose, where the capture has it."
    )


class Position(Stage[PositionParams]):
    """World position of each detection: robot pose, then mount, then range and azimuth (arXiv 2512.01018).

    Targets are taken to stand at the receiver's height. Where odometry is asked for and the capture has none, the
    reference pose is used and the results say so.
    """

    consumes = ports("frames", "detections", "range_m", "azimuth_rad")
    produces = ports("x_m", "y_m")
    rowwise = True
    fidelity = "from-source"

    def step(self, block: Block) -> Block:
        """Block whose detections carry ``x_m`` and ``y_m``."""
        frames, rows = block.frames, block.rows
        position_m, yaw_rad = frames.position_m, frames.yaw_rad
        if self.params.use_odometry:
            if frames.odometry_position_m is None or frames.odometry_yaw_rad is None:
                self.note("position: the capture has no odometry, so the reference pose was used")
            else:
                position_m, yaw_rad = frames.odometry_position_m, frames.odometry_yaw_rad
        receiver_m, boresight_rad = receiver_pose(
            position_m[rows], yaw_rad[rows], np.asarray(self.radar.mount_position_m), self.radar.mount_yaw_rad
        )
        points_m = to_world(block.detections.range_m, block.detections.azimuth_rad, receiver_m, boresight_rad)
        return block.with_columns(x_m=points_m[:, 0], y_m=points_m[:, 1])
