"""Radar SLAM with anchors that the robot sets down on its way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Landmarks, Map, Params, Poses, Radar, Step
from uwbbench_detectors.mappers.hearing import AnchorParams, Hearing
from uwbbench_detectors.mappers.slam_points import SlamPoints, SlamPointsParams


class SlamAnchorsParams(SlamPointsParams):
    """Those of ``slam.points``, and how anchors are heard."""

    anchors: AnchorParams = Field(AnchorParams.model_validate({}), description="How anchors are placed and heard.")


class SlamAnchors(SlamPoints):
    """``slam.points`` with anchors among its landmarks.

    Where there is nothing to see the robot sets down a radio of known identity, and hears from which direction, and
    from how far, its messages come when it returns. The anchor stands in the frame of the map as well as the pose was
    known when it was set down; hearing it again closes the loop, and tells how much odometry is short of.

    In kind after arXiv 2507.15474 (2025), of which the abstract is known; which messages count, and how much, is chosen
    here.
    """

    needs: ClassVar[frozenset[str]] = frozenset(("anchors",))

    @classmethod
    def params_type(cls) -> type[Params]:
        """Pydantic model of the parameters."""
        return SlamAnchorsParams

    def open(self, radars: Mapping[str, Radar], start: Poses) -> None:
        """Start without anchors."""
        super().open(radars, start)
        assert isinstance(self.params, SlamAnchorsParams)  # noqa: S101 - what params_type says
        self._hearing = Hearing(self.params.anchors, radars)

    def step(self, step: Step) -> Poses:
        """Pose after what was seen and heard."""
        super().step(step)
        self._hearing.take_in(self.ekf, step.messages)
        return Poses.of_one(step.index, self.ekf.pose, self.ekf.pose_covariance)

    def finish(self) -> tuple[Poses | None, Map]:
        """Points and anchors."""
        smoothed, learnt = super().finish()
        for note in self._hearing.notes:
            self.note(f"slam.anchors: {note}")
        points, anchors = learnt.landmarks.of("point"), self.ekf.landmarks().of("anchor")
        columns = ("identity", "kind", "a", "b", "covariance", "support")
        both = (np.concatenate([getattr(points, name), getattr(anchors, name)]) for name in columns)
        return smoothed, Map(landmarks=Landmarks(*both))
