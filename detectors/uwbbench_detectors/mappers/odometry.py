"""Poses by odometry alone: what every other mapper has to beat."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import Field

from uwbbench.api import Map, Mapper, Params, Poses, Radar, Step
from uwbbench_detectors.mappers.ekf import Ekf
from uwbbench_detectors.mappers.motion import MotionParams
from uwbbench_detectors.mappers.reckoning import Reckoning


class OdometryParams(Params):
    """How odometry errs, which decides the covariance of the poses and nothing else."""

    motion: MotionParams = Field(MotionParams.model_validate({}), description="How odometry errs.")


class OdometryAlone(Mapper[OdometryParams]):
    """Dead reckoning: the poses that odometry gives, with the covariance of the motion model, and no map.

    A jump of odometry, faster than ``fastest_m_s``, is not followed; a note says so.
    """

    consumes = frozenset()
    fidelity = "reference"

    def open(self, radars: Mapping[str, Radar], start: Poses) -> None:
        """Begin where odometry begins."""
        super().open(radars, start)
        self._ekf = Ekf(start.pose[0], self.params.motion)
        self._reckoning = Reckoning(self._ekf, self.note)

    def step(self, step: Step) -> Poses:
        """Pose by odometry."""
        self._reckoning.move(step)
        return Poses.of_one(step.index, self._ekf.pose, self._ekf.pose_covariance)

    def finish(self) -> tuple[Poses | None, Map]:
        """No smoothed trajectory, and an empty map."""
        return None, Map()
