"""Frames added up coherently along the way of the robot, for each direction that a target may have."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import SPEED_OF_LIGHT_M_S, Block, Detections, FloatArray, Params, Radar, Stage, ports
from uwbbench_detectors.integrate import bank_layout as lay
from uwbbench_detectors.integrate.motion import MotionParams, places_m, plain

LEAST_PATH = 4.0
"""One over the spread of the cosine at which rows begin: front and side can then be told apart."""


class DopplerRangeParams(MotionParams):
    """How far frames are added, over which directions, and which sums are rows."""

    length_m: float = Field(
        0.1,
        gt=0,
        description="Way over which a frame's weight falls by e. The cosine is resolved to wavelength / (4 pi length): "
        "0.03 at 8 GHz. Longer ways resolve more and suppress noise more, but a target must keep its phase along them: "
        "not for extended objects near the robot, and not where odometry errs by a tenth of a wavelength within it.",
    )
    cosines: int = Field(
        33, ge=3, description="Hypotheses of the cosine of the angle between target and motion, evenly from -1 to 1."
    )
    false_alarm_rate: float = Field(
        1e-7, gt=0, lt=1, description="Probability that noise alone exceeds the threshold in one cell of the bank."
    )
    guard_taps: float = Field(1.0, ge=0, description="Rows begin so many taps behind the direct path.")
    second: bool = Field(
        False, description="Add the power of STS2, of the other antenna, and give rows its phase difference. Needs STS."
    )
    direct_phase_rad: float | None = Field(
        None,
        description="Phase of STS2 against STS1 at the crest of the direct path, from which aligned frames count: "
        "what the geometry of the antennas says if left out. Ringing that the antennas do not share turns it, by a "
        "radian and more on some robots, and every azimuth with it.",
    )
    step_m: float = Field(
        0.001, gt=0, description="Least way between two frames that are added. In between, the last rows stay, as held."
    )
    floor_db: float = Field(
        -56.0,
        description="Power, relative to the direct path, of what its subtraction leaves at its crest, where no noise "
        "covers it: interpolation between taps is exact to -60 dB, a running template to little more.",
    )
    floor_taps: float = Field(3.0, gt=0, description="Taps over which these traces fall by e, as ringing does.")


class DopplerRange(Stage[DopplerRangeParams]):
    r"""Doppler-range bank: for each direction relative to the motion, the coherent sum of the frames along the way.

    While the robot moves by ds, the path of an echo from a target at the angle theta to the motion shortens by
    ``2 ds cos(theta)`` and its phase turns by ``-4 pi f / c * ds cos(theta)``, seen from the middle of transmitter and
    receiver, as their two paths add. For each of a grid of cosines u the bank keeps

        ``S_u <- exp(-|ds| / L) S_u + exp(-i (4 pi f / c) rho_u) z(shifted by rho_u)``,  ``rho_u += u ds``,

    the sum in the frame of a target that comes nearer at the rate u: it adds up in phase for targets in that direction
    and decays as ``1 / (1 + ((u - u') / w)^2)``, ``w = lambda / (4 pi L)``, for others. The weights sum to an effective
    ``2 L`` of way: 32 frames at 48 a second and 0.3 m/s, 15 dB over one frame. Shifts are of a cubic through four taps.
    Aliases appear where the robot moves more than half a wavelength between two frames over the width of the grid:
    beyond ``lambda / 4`` a frame, 0.45 m/s at 48 frames a second and 8 GHz, opposite directions look alike.

    The power of each cell over its noise, ``P = |S|^2 / (s sum w^2)``, added over the channels, is Gamma distributed
    with one degree a channel where there is noise alone, from which the threshold follows for a false-alarm rate. The
    noise s is the power in the last 16 taps of the frames, smoothed, plus a floor for what is left of the direct path.
    Local maxima over range and cosine become rows: ``tap`` by a parabola through logarithms, the ``motion_cosine`` u
    in the same way, ``motion_cosine_sd`` the resolution w for the way that the sums hold, ``motion_rad`` the direction
    of motion in the frame of the receiver, ``score_db`` the power, ``amplitude`` that of the first channel relative
    to the direct path of aligned frames, and ``pdoa_rad`` the phase of STS2 against the first channel, with what the
    geometry gives the direct path added, so that it is that of the target.

    What does not move is not added: a standing robot's rows are those of its last step, marked ``held``, until it has
    turned by more than the bank resolves; then there are none until it has moved again. Turns of the motion are
    forgotten over twice the resolution, as u means another direction by then.

    Frames must be aligned and without what the robot sees of itself (``align.template``, ``clutter.robot_template``),
    or coherent themselves. All-zero frames are passed over.

    References
    ----------
    Backprojection along a straight line, kept recursive: Cumming and Wong, Digital Processing of SAR Data, 2005.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path")
    produces: ClassVar[frozenset[str]] = ports(
        "detections",
        "tap",
        "amplitude",
        "score_db",
        "motion_cosine",
        "motion_cosine_sd",
        "motion_rad",
        "held",
        "pdoa_rad",
    )

    @classmethod
    def needs_with(cls, params: Params) -> frozenset[str]:
        """STS where the second channel is asked for."""
        return ports("sts") if isinstance(params, DopplerRangeParams) and params.second else ports()

    def open(self, radar: Radar) -> None:
        """Start with empty sums."""
        super().open(radar)
        from uwbbench_detectors.integrate import bank_loops

        p = self.params
        self._bank_frames = bank_loops.bank_frames
        wave = radar.wavelength_m / (4 * np.pi)
        channels = 2 if p.second else 1
        middle_m = (np.asarray(radar.mount_position_m) + np.asarray(radar.tx_position_m)) / 2
        direct_rad = geometric_phase_rad(radar) if p.direct_phase_rad is None else p.direct_phase_rad
        settings = {
            lay.LENGTH_M: p.length_m,
            lay.TURN_RAD: 2 * wave / p.length_m,
            lay.PHASE_RAD_M: 1 / wave,
            lay.TAP_M: SPEED_OF_LIGHT_M_S * radar.sample_interval_s / 2,
            lay.LEAST_POWER: least_power(p.false_alarm_rate, channels),
            lay.GUARD: p.guard_taps,
            lay.STEP_M: p.step_m,
            lay.LEAST_PATH_M: min(LEAST_PATH * wave, p.length_m / 2),
            lay.MIDDLE_X: middle_m[0],
            lay.MIDDLE_Y: middle_m[1],
            lay.MOUNT_RAD: radar.mount_yaw_rad,
            lay.DIRECT_RAD: direct_rad if p.second else 0.0,
            lay.FLOOR: 10 ** (p.floor_db / 10),
            lay.FLOOR_TAPS: p.floor_taps,
            lay.WAVE: wave,
        }
        self.at: FloatArray = np.zeros(lay.SETTINGS)
        self.at[list(settings)] = list(settings.values())
        self.bins: FloatArray = np.linspace(-1.0, 1.0, p.cosines)
        self.carried: FloatArray = np.zeros(lay.CARRIED)
        self.noise: FloatArray = np.zeros((2, 2))
        self.come: FloatArray = np.zeros(p.cosines)
        self.sums = np.zeros((p.cosines, 2 * channels, radar.taps), np.float32)
        self.rows: FloatArray = np.zeros((lay.MOST, lay.COLUMNS))
        self.rows[:, lay.PDOA_RAD] = np.nan  # and stays so with one channel
        self.names = lay.NAMES

    def step(self, block: Block) -> Block:
        """Block with rows."""
        frames = block.frames
        zero = block.part("first_path")
        if len(zero):
            self.at[lay.TO_TAP] = zero[0]
        first = plain(frames.preamble, np.complex64)
        second = plain(frames.sts2, np.complex64) if self.params.second else first
        place_m, yaw_rad = places_m(self, frames)
        valid = plain(frames.valid, np.bool_)
        state = self.bins, self.carried, self.noise, self.come, self.sums, self.at, self.rows
        table = self._bank_frames(first, second, self.params.second, valid, place_m, yaw_rad, frames.first, *state)
        made = Detections.of_table(self.names, table, (frames.first, frames.valid), self.notes)
        return block.replace(detections=made)


def least_power(rate: float, channels: int) -> float:
    """Threshold that the sum of unit exponential variables exceeds with a probability.

    One channel: ``exp(-t) = rate``. Two: ``(1 + t) exp(-t) = rate``, by Newton's method on its logarithm.

    Parameters
    ----------
    rate : float
    channels : {1, 2}
    """
    power = -math.log(rate)
    if channels == 1:
        return power
    for _ in range(20):
        power += (math.log1p(power) - power - math.log(rate)) / (power / (1 + power))
    return power


def geometric_phase_rad(radar: Radar) -> float:
    """Phase difference ``2 pi s / lambda sin(theta)`` that the geometry gives the direct path.

    0 where antenna spacing or baseline are not known.
    """
    distance_m = radar.baseline_length_m
    if radar.array_spacing_m is None or distance_m == 0:
        return 0.0
    return float(2 * np.pi * radar.array_spacing_m / radar.wavelength_m * radar.baseline_m[1] / distance_m)
