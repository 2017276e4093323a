"""Radar SLAM by smoothing: the landmarks of ``slam.points``, and the whole run looked at again at its end."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydantic import Field

from uwbbench.api import LANDMARK_KINDS, Landmarks, Map, Params, Poses, Radar, Step
from uwbbench_detectors.mappers.logbook import Logbook
from uwbbench_detectors.mappers.slam_points import SlamPoints, SlamPointsParams
from uwbbench_detectors.mappers.smoothing import close_loops, load_gtsam


class SlamGraphParams(SlamPointsParams):
    """Those of ``slam.points``, and how its observations are smoothed."""

    huber: float = Field(
        1.345,
        gt=0,
        description="Observations count with their square up to so many standard deviations, beyond that in "
        "proportion; 1.345 has 95 % of the efficiency of least squares where errors are normal.",
    )
    close: float = Field(
        9.21, ge=0, description="Squared Mahalanobis distance within which two landmarks of the smoothed map are one."
    )


class SlamGraph(SlamPoints):
    """Smoothing of all observations of a run in a factor graph.

    The filter of ``slam.points`` finds landmarks, says which observation is of which, and gives out the poses on the
    way. At the end all poses at which a landmark was seen, the landmarks of its map and the scale errors of odometry
    are asked for together: odometry between poses, range and bearing of landmarks with Huber's loss, by
    Levenberg-Marquardt. An observation that made the robot believe something wrong can be outvoted by later ones, as
    no filter can. Then landmarks that lie on each other are taken for one, which closes loops that the filter left
    open, and everything is smoothed again (Dellaert and Kaess, Factor Graphs for Robot Perception, 2017).

    Memory grows with the run: the log of odometry is what a smoothed trajectory is made of.
    """

    filter = Logbook

    @classmethod
    def params_type(cls) -> type[Params]:
        """Pydantic model of the parameters."""
        return SlamGraphParams

    def open(self, radars: Mapping[str, Radar], start: Poses) -> None:
        """Start with an empty graph.

        Raises
        ------
        ConfigError
            If gtsam is not installed.
        """
        load_gtsam()
        super().open(radars, start)

    @property
    def _log(self) -> Logbook:
        assert isinstance(self.ekf, Logbook)  # noqa: S101 - what it was made as
        return self.ekf

    def step(self, step: Step) -> Poses:
        """Pose of the filter."""
        self._log.begin_step(step.index)
        return super().step(step)

    def finish(self) -> tuple[Poses | None, Map]:
        """Smooth."""
        p = self.params
        assert isinstance(p, SlamGraphParams)  # noqa: S101 - what params_type says
        _, learnt = super().finish()
        points = learnt.landmarks
        problem = self._log.close(points.identity, points.position_m, p.huber)
        if not len(problem.poses):
            return None, learnt
        solution, became = close_loops(problem, p.close)
        kept, first = np.unique(became, return_index=True)
        if len(kept) < len(became):
            self.note(f"slam.graph: {len(became) - len(kept)} landmarks lay on others when the run was looked at again")
        blocks = solution.joint.reshape(len(kept), 2, len(kept), 2)
        marks = Landmarks(
            identity=points.identity[first],
            kind=np.full(len(kept), LANDMARK_KINDS.index("point")),
            a=solution.landmarks[:, 0],
            b=solution.landmarks[:, 1],
            covariance=blocks[kept, :, kept],
            support=np.bincount(became, points.support, len(kept)).astype(np.int64),
        )
        return self._log.trajectory(solution), Map(landmarks=marks)
