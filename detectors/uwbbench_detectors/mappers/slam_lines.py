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
from uwbbench_detectors.mappers.motion import Motion, MotionParams
from uwbbench_detectors.mappers.point import PointModel
from uwbbench_detectors.mappers.stretch import Stretch
from uwbbench_detectors.mappers.walls import Wall, WallParams, find_walls, settle_line

STILL = 1e-4
"""Metres or radians of a step below which a robot stands: it sees the same again."""


class PointParams(Params):
    """Which clusters of what no wall explains are points, and how well they are measured."""

    farthest_m: float = Field(3.5, gt=0, description="Largest range.")
    eps_m: float = Field(0.15, gt=0, description="Neighbourhood radius of DBSCAN.")
    min_samples: int = Field(6, ge=1, description="Echoes in the neighbourhood of a core echo, itself included.")
    range_sd_m: float = Field(0.06, gt=0, description="Standard deviation of the range of a cluster.")
    bearing_sd_deg: float = Field(6.0, gt=0, description="Standard deviation of its bearing.")
    gate: float = Field(9.21, gt=0, description="Chi-square, two degrees of freedom, up to which it is a known point.")
    begin: float = Field(25.0, gt=0, description="The same from which it is a new one; between, it is left out.")
    wall_margin_m: float = Field(0.25, ge=0, description="A cluster nearer to a wall is of that wall.")


class SlamLinesParams(Params):
    """Odometry, walls and points."""

    motion: MotionParams = Field(
        MotionParams.model_validate({"fastest_rad_s": 100.0}), description="How far odometry is to be believed."
    )
    walls: WallParams = Field(WallParams.model_validate({}), description="Which echoes are of walls.")
    points: PointParams = Field(PointParams.model_validate({}), description="Which of the others are of points.")
    travel_m: float = Field(0.6, gt=0, description="Way over which echoes are gathered. Windows do not overlap.")
    fewest: int = Field(8, ge=1, description="Echoes of a known wall in a window that are taken for it.")
    gate: float = Field(
        13.8, gt=0, description="Chi-square, two degrees of freedom, up to which a wall is one that is known: 0.1 %."
    )
    normal_sd_deg: float = Field(
        1.0, ge=0, description="Standard deviation that any observed normal has: walls are not quite flat."
    )
    same_m: float = Field(0.30, ge=0, description="Walls this close, and not as far apart as errors allow, are one.")
    same_deg: float = Field(10.0, ge=0, description="The same for their directions.")
    least_support: int = Field(3, ge=1, description="Observations that make a landmark of the map.")


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
        reach_m = p.walls.farthest_m
        self._ekf = Ekf(start.pose[0], p.motion, near_m=2 * reach_m, reach_m=reach_m)
        self._motion = Motion(p.motion)
        self._line, self._point = LineModel(), PointModel()
        self._stretch = Stretch(p.walls, radars, max(1, round(p.walls.stretch_m / p.travel_m)))
        self._feet: dict[int, Feet] = {}
        self._consistency = Consistency()
        self._way_m = 0.0
        self._last_s = math.nan

    def step(self, step: Step) -> Poses:
        """The pose of this step."""
        moved = step.moved
        way_m = math.hypot(moved[0], moved[1])
        self._ekf.predict(moved)
        if self._motion.jumped(moved, step.time_s - self._last_s):
            self._ekf.doubt(self._motion.doubt(moved))
            self._stretch.clear()
            self.note("odometry jumped: the pose is in doubt since then")
        self._last_s = step.time_s
        self._stretch.move(moved)
        if step.index == 0 or way_m > STILL or abs(moved[2]) > STILL:
            self._stretch.add(step.found)
        self._way_m += way_m
        if self._way_m >= self.params.travel_m:
            self._way_m = 0.0
            self._observe()
        return Poses.of_one(step.index, self._ekf.pose, self._ekf.pose_covariance)

    def finish(self) -> tuple[Poses | None, Map]:
        """The map; the trajectory is not smoothed."""
        marks = self._ekf.landmarks(self.params.least_support)
        lines = marks.of("line")
        if not len(marks):
            self.note("no landmark was seen often enough: poses are odometry's")
        elif not len(lines):
            self.note("no wall was seen often enough: poses rest on points alone")
        segments = [
            self._feet[int(number)].segments_m(np.array([rho, alpha]))
            for number, rho, alpha in zip(lines.identity, lines.a, lines.b, strict=True)
        ]
        segments_m = np.concatenate(segments) if segments else np.zeros((0, 2, 2))
        return None, Map(landmarks=_facing_marks(marks), segments_m=segments_m)

    def _observe(self) -> None:
        """Take in the echoes of a window: walls that are known, then points, then walls that are not."""
        here = self._stretch.close()
        free = np.ones(len(here), bool)
        self._see_walls(here, free)
        kept = self._stretch.keep(free)
        self._see_points(here.take(free & (here.range_m <= self.params.points.farthest_m)))
        self._begin_walls(kept)
        self._join_walls()
        if self._consistency.diverges:
            self.note("the filter diverges: measurements lie farther from what it expects than chance allows")

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
            for point in self._ekf.near("point"):
                if self._covers(handle, self._ekf.place(point)):
                    self._ekf.remove(point)
        self._stretch.drop(explained)

    def _put_feet(self, handle: int, echoes: Echoes, measured: FloatArray) -> None:
        """Note which pieces of a wall have been seen: feet of the perpendiculars from the receivers."""
        beside = np.array([-math.sin(measured[1]), math.cos(measured[1])])
        feet_m = measured[0] * normal(measured[1]) + along(measured, echoes.receiver_m)[:, None] * beside
        pose = self._ekf.pose
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        world_m = pose[:2] + feet_m @ np.array([[cosine, sine], [-sine, cosine]])
        self._feet[handle].add(along(self._ekf.place(handle), world_m))

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

    def _see_points(self, echoes: Echoes) -> None:
        """Observe points: clusters of echoes that no wall explains."""
        p = self.params.points
        if len(echoes) < p.min_samples:
            return
        from uwbbench_detectors.clusters.incremental import dbscan  # compiled

        places_m = echoes.place_m
        labels, _ = dbscan(places_m, p.eps_m, p.min_samples)
        noise = np.diag([p.range_sd_m**2, math.radians(p.bearing_sd_deg) ** 2])
        for label in range(int(labels.max(initial=-1)) + 1):
            place_m = np.median(places_m[labels == label], axis=0)
            measured = np.array([math.hypot(*place_m), math.atan2(place_m[1], place_m[0])])
            if any(self._covers(wall, self._point.placed(self._ekf.pose, measured)[0]) for wall in self._feet):
                continue
            handles, squared = self._ekf.distances(self._point, measured, noise)
            best = int(np.argmin(squared)) if handles else -1
            if handles and squared[best] <= p.gate:
                self._consistency.add(self._ekf.update(self._point, handles[best], measured, noise), 2)
            elif not handles or squared[best] > p.begin:
                self._ekf.add(self._point, measured, noise)

    def _covers(self, wall: int, place_m: FloatArray) -> bool:
        """Whether a place (2,) in the world lies at a piece of a wall that has been seen."""
        p, line = self.params, self._ekf.place(wall)
        near = abs(line[0] - float(place_m @ normal(line[1]))) <= p.points.wall_margin_m
        return near and self._feet[wall].covers(float(along(line, place_m[None])[0]), p.walls.quadrat_m)


def _facing_marks(marks: Landmarks) -> Landmarks:
    """Landmarks whose lines have their normal pointing away from the origin."""
    a, b, covariance = marks.a.copy(), marks.b.copy(), marks.covariance.copy()
    for row in np.flatnonzero(marks.kind == 1):
        (a[row], b[row]), turned = facing(np.array([a[row], b[row]]))
        covariance[row] = turned[:, None] * covariance[row] * turned
    return Landmarks(marks.identity, marks.kind, a, b, covariance, marks.support)
