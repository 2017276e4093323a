"""Anchorless radar SLAM with landmarks that are points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field

from uwbbench.api import Map, Mapper, Poses, Radar, Step, ports
from uwbbench_detectors.mappers.ekf import Ekf
from uwbbench_detectors.mappers.motion import MotionParams
from uwbbench_detectors.mappers.points import Points, PointsParams
from uwbbench_detectors.mappers.reckoning import Reckoning

DIVERGED = (
    "the filter has diverged: what it sees lies farther from what it expects than chance allows, so that neither its "
    "poses nor their covariances are to be relied on"
)
"""What a mapper notes of a filter whose measurements contradict it."""


class SlamPointsParams(PointsParams):
    """How points are gathered, told apart, and believed, and how odometry errs."""

    motion: MotionParams = Field(MotionParams.model_validate({}), description="How odometry errs.")


class SlamPoints(Mapper[SlamPointsParams]):
    """Simultaneous localisation and mapping with rods, corners and the like as points, by an extended Kalman filter.

    Points of all receivers gather over 0.6 m of travel in the frame of odometry; DBSCAN finds clusters, whose medians
    are measurements of range and bearing. A chi-square gate decides which landmark one is; beyond a second gate it
    begins a landmark. The state holds the pose, the scale errors of odometry, and the landmarks. Poses are handed out
    at each step; those between two windows are predicted.

    Without any point the poses are those of ``odometry``. While the robot stands nothing is learnt and nothing lost.
    A jump of odometry is noted and answered by a larger covariance, and so is noted if the filter diverges.

    What it is: the steps and parameters are those of the public successor of the source (LP_SLAM, Apache-2.0), read
    as facts; landmarks are confirmed by parallax and the scales are estimated, which is chosen here.

    References
    ----------
    Premachandra et al., anchorless radar SLAM, IEEE Robotics and Automation Letters, 2023.
    """

    consumes: ClassVar[frozenset[str]] = ports("range_m", "azimuth_rad")
    fidelity = "reconstruction"
    filter: ClassVar[type[Ekf]] = Ekf
    """What the mapper is made of; a mapper that looks back has one that keeps a log."""

    def open(self, radars: Mapping[str, Radar], start: Poses) -> None:
        """Begin where odometry begins, with an empty map."""
        super().open(radars, start)
        self.ekf = self.filter(start.pose[0], self.params.motion)
        self._reckoning = Reckoning(self.ekf, self.note)
        self.points = Points(self.params, self.ekf, radars)

    def step(self, step: Step) -> Poses:
        """Pose after odometry and, where a window ends, what it has shown."""
        if self._reckoning.move(step):
            self.points.add(step.moved, step.found)
        else:
            self.points.clear()
        if self.points.diverges:
            self.note(DIVERGED)
        return Poses.of_one(step.index, self.ekf.pose, self.ekf.pose_covariance)

    def finish(self) -> tuple[Poses | None, Map]:
        """No smoothed trajectory; the confirmed landmarks, those that the last window confirms included."""
        self.points.end()
        return None, Map(landmarks=self.points.landmarks())
