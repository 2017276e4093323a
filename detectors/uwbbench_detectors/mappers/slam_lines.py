"""Radar SLAM with lines and points as landmarks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import BoolArray, FloatArray, Landmarks, Map, Mapper, Params, Poses, Radar, Step, ports, wrap_angle
from uwbbench_detectors.mappers.consistency import Consistency
from uwbbench_detectors.mappers.echoes import Echoes, Spread
from uwbbench_detectors.mappers.ekf import Ekf
from uwbbench_detectors.mappers.feet import Feet
from uwbbench_detectors.mappers.line import LineModel, along, facing, normal
from uwbbench_detectors.mappers.motion import MotionParams
from uwbbench_detectors.mappers.points import Points, PointsParams
from uwbbench_detectors.mappers.reckoning import Reckoning
from uwbbench_detectors.mappers.slam_points import DIVERGED
from uwbbench_detectors.mappers.stretch import Stretch
from uwbbench_detectors.mappers.walls import Wall, WallParams, find_walls, settle_line


class SlamLinesParams(Params):
    """Odometry, walls and points."""

    motion: MotionParams = Field(MotionParams.model_validate({}), description="How odometry errs.")
    walls: WallParams = Field(WallParams.model_validate({}), description="Which echoes are of walls.")
    points: PointsParams = Field(
        PointsParams.model_validate({"window": {"nearest_m": 1.2}}),
        description="Which of the others are of points, as of slam.points. Walls are observed in the same windows.",
    )
    fewest: int = Field(8, ge=1, description="Echoes of a known wall in a window that are taken for it.")
    gate: float = Field(
        13.8, gt=0, description="Squared Mahalanobis distance within which a wall is one that is known: 0.1 %."
    )
    normal_sd_deg: float = Field(
        1.0, ge=0, description="Standard deviation that any observed normal has: walls are not quite flat."
    )
    same_m: float = Field(0.30, ge=0, description="Walls this close, and not farther apart than errors allow, are one.")
    same_deg: float = Field(10.0, ge=0, description="The same for their directions.")
    beside_m: float = Field(0.25, ge=0, description="What lies nearer to a piece of wall that has been seen is of it.")
    least_support: int = Field(3, ge=1, description="Windows that make a wall one of the map.")


class SlamLines(Mapper[SlamLinesParams]):
    """Extended Kalman filter over walls and points, which no anchor and no radio helps.

    Echoes are gathered over a short way. Those that agree with a wall that is known are one observation of it:
    distance and direction of its normal. New walls are sought in what is left, over a longer way, and must be seen
    along more than a metre: towards what the robot drives, straight on, a rod looks like a wall. What no wall
    explains is clustered, and clusters are points, as in ``slam.points``.

    A smooth wall answers from the foot of the perpendicular alone, which moves with the robot: it is observed across
    and in heading, and says nothing of the way along it.

    In kind after H. A. G. C. Premachandra et al., UWB Radar SLAM, IEEE RA-L 2023, and the public parameters of its
    successor with lines (LP_SLAM, 2024: RANSAC at 15 mm, quadrats of 50 mm), in the units of a radar whose taps are 23
    times as long: 15 and 30 cm. Fits, association and bookkeeping are own.
    """

    consumes: ClassVar[frozenset[str]] = ports("range_m", "azimuth_rad")
    fidelity = "reconstruction"

    def open(self, radars: Mapping[str, Radar], start: Poses) -> None:
        """Start with an empty map."""
        super().open(radars, start)
        p = self.params
        self._ekf = Ekf(start.pose[0], p.motion)
        self._reckoning = Reckoning(self._ekf, self.note)
        self._line = LineModel()
        self._points = Points(p.points, self._ekf, radars)
        self._stretch = Stretch(p.walls, p.points.window, radars)
        self._feet: dict[int, Feet] = {}
        self._consistency = Consistency()

    def step(self, step: Step) -> Poses:
        """Pose after odometry and, where a window ends, what it has shown."""
        if self._reckoning.move(step):
            self._stretch.add(step.moved, step.found)
            if self._stretch.full:
                self._observe()
        else:
            self._stretch.clear()
            self._points.clear()
        if self._points.diverges or self._consistency.diverges:
            self.note(DIVERGED)
        return Poses.of_one(step.index, self._ekf.pose, self._ekf.pose_covariance)

    def finish(self) -> tuple[Poses | None, Map]:
        """No smoothed trajectory; the walls with their pieces that have been seen, and the points."""
        self._observe()
        self._points.end()
        points = self._points.landmarks()
        walls = [handle for handle in self._feet if self._ekf.support(handle) >= self.params.least_support]
        if not walls:
            self.note("no wall was seen often enough to be one of the map")
        marks = self._ekf.landmarks(handles=[*points.identity.tolist(), *walls])
        lines = marks.of("line")
        segments_m = [
            self._feet[number].segments_m(np.array([rho, alpha]))
            for number, rho, alpha in zip(lines.identity.tolist(), lines.a, lines.b, strict=True)
        ]
        return None, Map(landmarks=_facing_marks(marks), segments_m=np.concatenate([np.zeros((0, 2, 2)), *segments_m]))

    def _observe(self) -> None:
        """Take in the echoes of a window: walls that are known, then points, then walls that are not."""
        here = self._stretch.echoes
        free = np.ones(len(here), bool)
        self._see_walls(here, free)
        free &= ~self._beside_walls(here)
        for moved, found in self._stretch.steps(free):
            for sighting in self._points.add(moved, found):
                if sighting.confirmed:
                    place_m = sighting.measured[0] * normal(sighting.measured[1])
                    free &= self.params.walls.reach.squared(*here.off_point(place_m)) > 1
        self._begin_walls(self._stretch.keep(free))
        self._join_walls()

    def _see_walls(self, here: Echoes, free: BoolArray) -> None:
        """Observe walls that are known; their echoes are not free (n,) any more."""
        candidates = []
        for handle in self._ekf.near("line"):
            wall = self._wall_of(handle, here, free)
            if wall is not None:
                measured, noise = self._observed(wall)
                squared = float(self._ekf.distances(self._line, measured, noise, [handle])[1][0])
                candidates.append((squared, handle, wall))
        for _, handle, wall in sorted(candidates, key=lambda one: one[:2]):
            members = wall.members & free
            if np.count_nonzero(members) < self.params.fewest:
                continue
            measured, noise = self._observed(wall)
            squared = float(self._ekf.distances(self._line, measured, noise, [handle])[1][0])
            self._consistency.add(squared, 2)
            if squared <= self.params.gate:
                self._ekf.update(self._line, handle, measured, noise)
                free &= ~members
                self._put_feet(handle, here.take(members), measured)

    def _wall_of(self, handle: int, here: Echoes, free: BoolArray) -> Wall | None:
        """Wall that the free echoes (n,) near a known one make, if there are enough of them."""
        p = self.params
        line, spread = self._ekf.expected(self._line, handle)
        if line[0] > p.walls.farthest_m + p.walls.inlier_m:
            return None
        reach = Spread(p.walls.inlier_m + 2 * spread[0], p.walls.reach.heading_rad + 2 * spread[1])
        wall = settle_line(here, free & (reach.squared(*here.off_line(line)) <= 1), line, p.walls)
        return wall if wall is not None and np.count_nonzero(wall.members & free) >= p.fewest else None

    def _observed(self, wall: Wall) -> tuple[FloatArray, FloatArray]:
        """Distance and direction (2,) of a wall, and their covariance."""
        line, turned = facing(wall.line)
        noise = turned[:, None] * wall.covariance * turned
        noise[1, 1] += math.radians(self.params.normal_sd_deg) ** 2
        return line, noise

    def _begin_walls(self, kept: Echoes) -> None:
        """Begin a landmark with each wall among echoes that no known one explains."""
        explained = np.zeros(len(kept), bool)
        for wall in find_walls(kept, self.params.walls):
            measured, noise = self._observed(wall)
            handle = self._ekf.add(self._line, measured, noise)
            self._feet[handle] = Feet(self.params.walls.quadrat_m)
            self._put_feet(handle, kept.take(wall.members), measured)
            explained |= wall.members
        self._stretch.drop(explained)

    def _put_feet(self, handle: int, echoes: Echoes, measured: FloatArray) -> None:
        """Note which pieces of a wall have been seen: feet of the perpendiculars from the receivers."""
        beside = np.array([-math.sin(measured[1]), math.cos(measured[1])])
        feet_m = measured[0] * normal(measured[1]) + along(measured, echoes.receiver_m)[:, None] * beside
        self._feet[handle].add(along(self._ekf.place(handle), self._to_world(feet_m)))

    def _join_walls(self) -> None:
        """Take walls that cannot be told apart for one."""
        p = self.params
        handles = self._ekf.near("line")
        for number, kept in enumerate(handles):
            for other in handles[number + 1 :]:
                if self._near_each_other(kept, other) and self._ekf.apart(kept, other) <= p.gate:
                    self._ekf.merge(kept, other, np.diag([0.05**2, math.radians(p.normal_sd_deg) ** 2]))
                    self._feet[kept].join(self._feet.pop(other))
                    return self._join_walls()
        return None

    def _near_each_other(self, one: int, other: int) -> bool:
        """Whether two lines are close where the robot is."""
        first, second = (self._ekf.place(handle) for handle in (one, other))
        if abs(float(wrap_angle(first[1] - second[1]))) > math.radians(self.params.same_deg):
            return False
        place_m = self._ekf.pose[:2]
        apart_m = first[0] - place_m @ normal(first[1]) - second[0] + place_m @ normal(second[1])
        return bool(abs(apart_m) <= self.params.same_m)

    def _beside_walls(self, here: Echoes) -> BoolArray:
        """Which echoes (n,) come from places beside walls, at pieces that have been seen."""
        p = self.params
        places_m = self._to_world(here.place_m)
        beside = np.zeros(len(here), bool)
        for handle, feet in self._feet.items():
            line = self._ekf.place(handle)
            near = np.abs(line[0] - places_m @ normal(line[1])) <= p.beside_m
            beside |= near & feet.covers(along(line, places_m), p.walls.quadrat_m)
        return beside

    def _to_world(self, places_m: FloatArray) -> FloatArray:
        """Places (n, 2) in the robot's frame, in the world."""
        pose = self._ekf.pose
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        return np.asarray(pose[:2] + places_m @ np.array([[cosine, sine], [-sine, cosine]]))


def _facing_marks(marks: Landmarks) -> Landmarks:
    """Landmarks whose lines have their normal pointing away from the origin."""
    a, b, covariance = marks.a.copy(), marks.b.copy(), marks.covariance.copy()
    for row in np.flatnonzero(marks.kind == 1):
        (a[row], b[row]), turned = facing(np.array([a[row], b[row]]))
        covariance[row] = turned[:, None] * covariance[row] * turned
    return Landmarks(marks.identity, marks.kind, a, b, covariance, marks.support)
