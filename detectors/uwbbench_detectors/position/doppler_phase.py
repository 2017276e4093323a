"""Azimuth from the Doppler of the robot's motion and the phase difference of two antennas together."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import SPEED_OF_LIGHT_M_S, Block, ConfigError, FloatArray, Params, Radar, Stage, ports


class DopplerPhaseParams(Params):
    """How well each of the two measures."""

    cosine_sd: float = Field(
        0.12,
        gt=0,
        description="Error of the cosine beside its resolution: of extended targets, whose parts lie in several "
        "directions, and of the odometry's direction.",
    )
    phase_sd_rad: float = Field(
        0.1, gt=0, description="Error of the phase difference beside noise, as antennas' phases hang on the direction."
    )
    loose_sd_rad: float = Field(
        0.25,
        gt=0,
        description="Error of the phase difference that 'angle_cost' assumes. It judges whether both agree at all, "
        "which an array that is badly calibrated should not decide.",
    )
    behind: float = Field(
        0.3,
        ge=0,
        description="Cost of a direction behind the antennas, where their patterns receive less; it decides where "
        "front and back explain both equally well.",
    )


class DopplerPhase(Stage[DopplerPhaseParams]):
    r"""Azimuth that explains best both the cosine to the motion and the phase difference.

    With psi the direction of motion in the frame of the receiver, Doppler measures ``u = cos(az - psi)``, which left
    and right of the motion share; the phase difference measures ``(2 pi s / lambda) sin(az)``, which front and back
    share, and above half a wavelength of spacing others too. Together they are unique unless the motion is along the
    axis of the antennas. Both are independent with Gaussian errors, so that the likeliest azimuth minimises

        ``((cos(az_m - psi) - u) / s_u)^2 + (wrap(phase - (2 pi s / lambda) sin(az)) / s_p)^2 + behind``,

    ``s_u^2 = cosine_sd^2 + motion_cosine_sd^2``, ``s_p^2 = phase_sd^2 + 1 / SNR``; over a grid of 5 degrees and a
    parabola through the costs. Doppler is seen from the middle ``m`` of transmitter and receiver, ``az_m``, the phase
    from the receiver, ``az``: a target at half the path away from the middle lies at ``m + (d / 2) (cos az_m, sin
    az_m)`` from the receiver. For targets near the robot they differ by up to 20 degrees.

    ``angle_cost`` is the least cost with the loose error of the phase: of an echo by way of two reflections each path
    arrives from another direction than it left to, Doppler is the mean of both and the phase that of the last, and
    they disagree. ``middle_rad`` is ``az_m``.

    Raises
    ------
    ConfigError
        From ``open``, where the radar has no antenna spacing.
    """

    consumes: ClassVar[frozenset[str]] = ports(
        "frames",
        "first_path",
        "detections",
        "tap",
        "score_db",
        "motion_cosine",
        "motion_cosine_sd",
        "motion_rad",
        "pdoa_rad",
    )
    produces: ClassVar[frozenset[str]] = ports("azimuth_rad", "angle_cost", "middle_rad")
    needs: ClassVar[frozenset[str]] = ports("sts")
    rowwise = True

    def open(self, radar: Radar) -> None:
        """Work out the geometry of the antennas."""
        super().open(radar)
        if radar.array_spacing_m is None:
            raise ConfigError(
                f"angle.doppler_phase: needs the antenna spacing, which receiver '{radar.receiver}' lacks"
            )
        from uwbbench_detectors.position import doppler_phase_loops as loops

        p = self.params
        self._joint_angles = loops.joint_angles
        self.fan = loops.directions(p.behind)
        self.at: FloatArray = np.zeros(loops.SETTINGS)
        self.at[loops.SLOPE] = 2 * np.pi * radar.array_spacing_m / radar.wavelength_m
        self.at[loops.MIDDLE_X], self.at[loops.MIDDLE_Y] = radar.baseline_m[:2] / 2
        self.at[loops.TAP_M] = SPEED_OF_LIGHT_M_S * radar.sample_interval_s / 2
        self.at[loops.BASELINE_M] = radar.baseline_length_m if radar.first_tap_delay_s is None else 0.0
        self.at[loops.COSINE_SD], self.at[loops.PHASE_SD] = p.cosine_sd, p.phase_sd_rad
        self.at[loops.LOOSE_SD], self.at[loops.BEHIND] = p.loose_sd_rad, p.behind

    def step(self, block: Block) -> Block:
        """Block whose detections carry ``azimuth_rad``, ``angle_cost`` and ``middle_rad``."""
        rows = block.detections
        given = np.empty((len(rows), 6))
        given[:, 0] = rows["tap"] - block.part("first_path")[block.rows]
        names = ("score_db", "motion_cosine", "motion_cosine_sd", "motion_rad", "pdoa_rad")
        for place, name in enumerate(names, 1):
            given[:, place] = rows[name]
        azimuth_rad, middle_rad, cost = self._joint_angles(given, self.fan, self.at)
        return block.with_columns(azimuth_rad=azimuth_rad, angle_cost=cost, middle_rad=middle_rad)
