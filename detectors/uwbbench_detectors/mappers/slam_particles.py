"""Localisation and mapping with two ears that hear ranges alone: particles of the pose, Kalman filters of the walls."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from pydantic import Field

from uwbbench.api import (
    LANDMARK_KINDS,
    BoolArray,
    ConfigError,
    Detections,
    FloatArray,
    IntArray,
    Landmarks,
    Map,
    Mapper,
    Params,
    Poses,
    Radar,
    Step,
    compose,
    ports,
    wrap_angle,
    wrap_one_angle,
)
from uwbbench_detectors.mappers import images
from uwbbench_detectors.mappers.births import Trail, born
from uwbbench_detectors.mappers.landmark_table import AA, AB, BB, HIGH, LOW, SUPPORT, WALL, A, B, LandmarkTable
from uwbbench_detectors.mappers.motion import MotionParams
from uwbbench_detectors.mappers.particles import Particles

COLLAPSED = 0.1
"""Share of the particles below which their effective number says that they disagree with all that is heard."""
WORST = 1.0
"""Largest mean squared residual, in standard deviations, of the readings that a landmark begins with."""
FORGOTTEN_M = 2.0
"""Way after which a track that was not read is forgotten."""
LONGEST = 40
"""Readings that are kept of a track that no landmark explains."""


class SlamParticlesParams(Params):
    """Particles, what is believed of ranges, and when a wall is one."""

    particles: int = Field(150, ge=1, description="Poses that are kept.")
    ears: int = Field(2, ge=2, description="Receivers that are listened to, the first ones of the run.")
    range_sd_m: float = Field(0.08, gt=0, description="Standard deviation of a range; echoes of rough walls included.")
    clutter: float = Field(
        0.05,
        gt=0,
        lt=1,
        description="Likelihood of a range that belongs to nothing, beside 1 for one exactly as expected.",
    )
    wall_merge: tuple[float, float] = Field(
        (0.20, 5.0), description="[metres, degrees]: walls no farther apart, in distance and direction, are one."
    )
    new: int = Field(3, ge=2, description="Fewest readings that a landmark begins with.")
    new_travel_m: float = Field(
        1.0,
        ge=0.5,
        description="Least way over which it has been heard by then; what is heard for less is often a ghost.",
    )
    new_bearing_sd_deg: float = Field(
        8.0, gt=0, description="Largest standard deviation of its direction then; until it is less, one waits."
    )
    read_m: float = Field(
        0.10, gt=0, description="Way between two readings of a track, whose filter remembers: the rest is not new."
    )
    nearest_m: float = Field(0.85, ge=0, description="Nearer ranges are not used: antennas ring there.")
    farthest_m: float = Field(5.0, gt=0, description="Farther ranges are not used.")
    view_deg: float = Field(
        75.0, gt=0, le=180, description="A landmark begins within this of where an ear looks, to both sides."
    )
    heard_deg: float = Field(140.0, gt=0, le=180, description="A known wall is heard within this.")
    resolution_m: float = Field(
        0.30, ge=0, description="Two echoes closer than this are one peak at the range of neither, and are not used."
    )
    trusted_support: int = Field(12, ge=0, description="Readings before a landmark has a say in where the robot is.")
    gate_sigmas: float = Field(3.0, gt=0, description="A range belongs to a landmark within these standard deviations.")
    beyond_m: float = Field(2.0, ge=0, description="By how far a wall may go on beyond where it was seen.")
    least_support: int = Field(8, ge=1, description="Readings that a landmark of the map is made of.")
    motion: MotionParams = Field(MotionParams.model_validate({}), description="How odometry errs.")
    seed: int = Field(1, ge=0, description="Of all draws.")


@dataclass
class _Track:
    """A track of one ear: when it was read, and the readings that no landmark explains, as all particles have them."""

    read_at_m: float = -math.inf
    half_m: list[float] = field(default_factory=list)
    way_m: list[float] = field(default_factory=list)
    placed: list[FloatArray] = field(default_factory=list)

    def clear(self) -> None:
        """Forget the readings: a landmark explains them."""
        self.half_m, self.way_m, self.placed = [], [], []

    def add(self, half_m: float, way_m: float, placed: FloatArray) -> None:
        """Keep a reading."""
        self.half_m, self.way_m = [*self.half_m[1 - LONGEST :], half_m], [*self.way_m[1 - LONGEST :], way_m]
        self.placed = [*self.placed[1 - LONGEST :], placed]


class SlamParticles(Mapper[SlamParticlesParams]):
    """Rao-Blackwellised particle filter over walls and points that two ears hear, by range alone.

    In kind after Zetik et al., Cooperative Localization and Object Recognition in Autonomous UWB Sensor Networks,
    InTech 2013, doi 10.5772/55077, whose text is not known; the filter is FastSLAM (Montemerlo, Thrun, Koller,
    Wegbreit, AAAI 2002), with landmarks that begin when the way has left one direction for them. All numbers are
    chosen here.
    """

    consumes = ports("range_m", "track")
    receivers = 2
    fidelity = "reconstruction"

    def open(self, radars: Mapping[str, Radar], start: Poses) -> None:
        """Start at the first pose, which the map is measured from, with nothing known."""
        super().open(radars, start)
        p = self.params
        if len(radars) < p.ears:
            raise ConfigError(f"slam.particles: 'ears' is {p.ears}, but the run has {len(radars)} receivers")
        self._ears = dict(list(radars.items())[: p.ears])
        places = [place for radar in self._ears.values() for place in (radar.mount_position_m, radar.tx_position_m)]
        self._arm_m = max(math.hypot(place[0], place[1]) for place in places)
        self._start = start.pose[0]
        self._particles = Particles(p.particles, p.motion, np.random.Generator(np.random.PCG64(p.seed)))
        self._known = LandmarkTable(p.particles)
        self._tracks: dict[tuple[str, int], _Track] = {}
        self._way_m, self._time_s = 0.0, math.nan

    def step(self, step: Step) -> Poses:
        """Pose after moving, and after what the ears heard."""
        elapsed_s = step.time_s - self._time_s if math.isfinite(self._time_s) else math.inf
        self._time_s = step.time_s
        if self._particles.move(step.moved, elapsed_s):
            self.note(
                f"slam.particles: odometry jumps at step {step.index}; poses after it are as uncertain as it is wide"
            )
        self._way_m += math.hypot(step.moved[0], step.moved[1]) + self._arm_m * abs(float(step.moved[2]))
        for name, radar in self._ears.items():
            if name in step.found:
                self._hear(name, radar, step.found[name])
        weight = self._particles.weight
        effective = 1 / float(np.sum(weight**2))
        if effective < COLLAPSED * len(weight):
            self.note(
                f"slam.particles: at step {step.index} only {effective:.0f} of {len(weight)} particles agree with what "
                "is heard: a range was taken for that of a wrong wall, or odometry is worse than assumed"
            )
        mean, covariance = self._particles.estimate(weight)
        if effective < len(weight) / 2:
            self._resample(weight)
        return Poses.of_one(step.index, compose(self._start, mean), self._turned(covariance))

    def finish(self) -> tuple[Poses | None, Map]:
        """No smoothed poses; walls with the pieces that were seen, and points."""
        return None, self._map()

    def _hear(self, name: str, radar: Radar, rows: Detections) -> None:
        """Read the tracks of an ear that have gone on since they were read."""
        p = self.params
        heard = np.isfinite(rows.range_m) & (rows.range_m >= p.nearest_m) & (rows.range_m <= p.farthest_m)
        if "amplitude" in rows.names:
            heard &= np.isfinite(rows["amplitude"])  # else the track is coasting: that is no reading
        places, placed = np.flatnonzero(heard), None
        for row in places.tolist():
            if rows["track"][row] < 0:
                continue
            key = (name, int(rows["track"][row]))
            if key not in self._tracks:
                # A track that has not been read for so long has ended.
                ended = self._way_m - FORGOTTEN_M
                self._tracks = {known: one for known, one in self._tracks.items() if one.read_at_m >= ended}
                self._tracks[key] = _Track()
            track = self._tracks[key]
            if self._way_m - track.read_at_m < p.read_m:
                continue
            track.read_at_m = self._way_m
            if placed is None:
                placed = self._placed(radar)
                taken = np.zeros((p.particles, len(self._known)), bool)
            half_m = _half_path(float(rows.range_m[row]), radar)
            if self._explained(half_m, placed, taken):
                track.clear()
                continue
            track.add(half_m, self._way_m, placed)
            if self._begin(track):
                taken = np.concatenate([taken, np.ones((p.particles, 1), bool)], axis=1)
                taken = self._settle(taken)

    def _placed(self, radar: Radar) -> FloatArray:
        """Ear, mouth and where the ear looks (5, particles), as all particles have them."""
        x, y, yaw = self._particles.pose
        cosine, sine = np.cos(yaw), np.sin(yaw)
        (ear_x, ear_y, _), (mouth_x, mouth_y, _) = radar.mount_position_m, radar.tx_position_m
        return np.stack(
            [
                x + cosine * ear_x - sine * ear_y,
                y + sine * ear_x + cosine * ear_y,
                x + cosine * mouth_x - sine * mouth_y,
                y + sine * mouth_x + cosine * mouth_y,
                yaw + radar.mount_yaw_rad,
            ]
        )

    def _explained(self, half_m: float, placed: FloatArray, taken: BoolArray) -> bool:
        """Put a reading into the landmark of each particle that it fits best; whether most have one.

        Parameters
        ----------
        half_m : float
        placed : (5, particles) array
        taken : (particles, landmarks) bool array
            What this ear has heard of in this step; written.
        """
        p, known, particles = self.params, self._known, self._particles
        best = particles.best
        near = known.near(particles.pose[:, best], best, p.farthest_m, p.beyond_m)
        if not len(near):
            return False
        expected = known.expected(near, placed[:2], placed[2:4])
        off = half_m - expected[0]
        planes = known.planes[:, :, near]
        variance = p.range_sd_m**2
        spread = (
            expected[1] ** 2 * planes[AA] + 2 * expected[1] * expected[2] * planes[AB] + expected[2] ** 2 * planes[BB]
        )
        spread += variance
        squared = off**2 / spread
        fits = (squared < p.gate_sigmas**2) & ~taken[:, near]
        # An ear hears little of what is behind it.
        away = wrap_angle(planes[B] - placed[4][:, None])
        heard = (np.abs(away) < math.radians(p.heard_deg)) | (known.kind[near] != WALL)
        fits &= heard
        likely = np.where(fits, p.range_sd_m / np.sqrt(spread) * np.exp(-0.5 * squared), 0.0)
        column = np.argmax(likely, axis=1)
        rows = np.arange(len(column))
        highest = likely[rows, column]
        weight = particles.weight
        beside = np.abs(expected[0] - expected[0][rows, column][:, None]) < p.resolution_m
        beside &= heard
        if float(weight @ ((beside.sum(axis=1) > 1) & (highest > 0))) > 0.5:
            return True  # two echoes that are not resolved: one peak, at the range of neither
        # What has just begun may be no landmark: it says nothing of the pose yet.
        highest_known = np.where(planes[SUPPORT][rows, column] >= p.trusted_support, highest, 0.0)
        particles.log_weight += np.log(p.clutter + highest_known)
        who = np.flatnonzero(highest > 0)
        if len(who):
            which = near[column[who]]
            taken[who, which] = True
            slopes = expected[1:, who, column[who]]
            known.correct(who, which, off[who, column[who]], slopes, variance)
            walls = known.kind[which] == WALL
            who, which = who[walls], which[walls]
            a, b = known.planes[A, who, which], known.planes[B, who, which]
            known.extend(who, which, images.foot_along(placed[:2, who], placed[2:4, who], a, b))
        return float(weight @ (highest > 0)) >= 0.5

    def _begin(self, track: _Track) -> bool:
        """Begin a landmark from the readings of a track, if they say where it is."""
        p = self.params
        if len(track.half_m) < p.new or track.way_m[-1] - track.way_m[0] < p.new_travel_m:
            return False
        placed = np.stack(track.placed)
        trail = Trail(np.array(track.half_m), placed[:, :2], placed[:, 2:4], placed[:, 4])
        best = self._particles.best
        birth = born(trail, best, p.range_sd_m, math.radians(p.view_deg), math.radians(p.new_bearing_sd_deg), WORST)
        if birth is None:
            return False
        planes = np.zeros((8, p.particles))
        planes[:2], planes[[AA, AB, BB]] = birth.mean, birth.covariance
        planes[LOW], planes[HIGH] = birth.along.min(axis=0), birth.along.max(axis=0)
        planes[SUPPORT] = len(track.half_m)
        self._known.add(birth.kind, planes)
        self._particles.log_weight += birth.log_likelihood - birth.log_likelihood.max()
        track.clear()
        return True

    def _settle(self, taken: BoolArray) -> BoolArray:
        """Make one of landmarks that are one; what an ear has heard of (particles, landmarks), without those gone."""
        p = self.params
        apart_m, apart_rad = p.wall_merge[0], math.radians(p.wall_merge[1])
        while (pair := self._known.twins(self._particles.best, apart_m, apart_rad)) is not None:
            variance = (0.03**2, math.radians(1.0) ** 2) if self._known.kind[pair[0]] == WALL else (0.05**2, 0.05**2)
            squared = self._known.merge(*pair, variance)
            self._particles.log_weight += np.log(p.clutter + np.exp(-0.5 * squared))
            taken[:, pair[0]] |= taken[:, pair[1]]
            taken = np.delete(taken, pair[1], axis=1)
        return taken

    def _resample(self, weight: FloatArray) -> None:
        """Draw particles anew, with all that each knows."""
        chosen: IntArray = self._particles.resample(weight)
        self._known.resample(chosen)
        for track in self._tracks.values():
            track.placed = [placed[:, chosen] for placed in track.placed]

    def _turned(self, covariance: FloatArray) -> FloatArray:
        """Covariance of a pose in the frame of the start pose, in the frame of the run."""
        cosine, sine = math.cos(self._start[2]), math.sin(self._start[2])
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(turn @ covariance @ turn.T)

    def _map(self) -> Map:
        """What the particles know together, in the frame of the run."""
        known, weight = self._known, self._particles.weight
        support = weight @ known.planes[SUPPORT]
        kept = np.flatnonzero(support >= self.params.least_support)
        walls = known.kind[kept] == WALL
        planes = known.planes[:, :, kept]
        best = self._particles.best
        # Directions are averaged about those of the best particle, so that none is counted once round the circle.
        near = planes[B, best]
        angle = near + wrap_angle(planes[B] - near)
        planes[B] = np.where(walls, angle, planes[B])
        mean = np.einsum("n,pnk->pk", weight, planes)
        off_a, off_b = planes[A] - mean[A], planes[B] - mean[B]
        spread = mean[[AA, AB, BB]] + np.stack([weight @ off_a**2, weight @ (off_a * off_b), weight @ off_b**2])
        values, covariance, segments = [], [], []
        for place, wall in enumerate(walls.tolist()):
            own = spread[[0, 1, 1, 2], place].reshape(2, 2)
            of = self._wall if wall else self._point
            value, turn = of(mean[:2, place])
            values.append(value)
            covariance.append(turn @ own @ turn.T)
            if wall:
                segments.append(self._piece(mean[:, place]))
        if not values:
            return Map()
        kind = np.where(walls, LANDMARK_KINDS.index("line"), LANDMARK_KINDS.index("point"))
        a, b = np.array(values).T
        count = np.round(support[kept]).astype(np.int64)
        landmarks = Landmarks(known.identity[kept], kind, a, b, np.array(covariance), count)
        return Map(landmarks, np.array(segments).reshape(-1, 2, 2))

    def _wall(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A wall (2,) in the frame of the run, its distance not negative; and the derivative of this (2, 2)."""
        alpha = float(value[1] + self._start[2])
        cosine, sine = math.cos(alpha), math.sin(alpha)
        rho = float(value[0]) + cosine * self._start[0] + sine * self._start[1]
        turn = np.array([[1.0, cosine * self._start[1] - sine * self._start[0]], [0.0, 1.0]])
        if rho < 0:
            rho, alpha, turn = -rho, alpha + math.pi, np.diag([-1.0, 1.0]) @ turn
        return np.array([rho, wrap_one_angle(alpha)]), turn

    def _point(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A point (2,) in the frame of the run, and the derivative of this (2, 2)."""
        cosine, sine = math.cos(self._start[2]), math.sin(self._start[2])
        turn = np.array([[cosine, -sine], [sine, cosine]])
        return self._start[:2] + turn @ value, turn

    def _piece(self, wall: FloatArray) -> FloatArray:
        """Ends (2, 2) of what was seen of a wall, in the frame of the run."""
        cosine, sine = math.cos(wall[B]), math.sin(wall[B])
        foot, across = wall[A] * np.array([cosine, sine]), np.array([-sine, cosine])
        return np.stack([self._point(foot + wall[end] * across)[0] for end in (LOW, HIGH)])


def _half_path(range_m: float, radar: Radar) -> float:
    """Half the path of a range, which the front end has made of it for an echo on boresight."""
    towards = np.array([range_m, 0.0, 0.0]) - radar.baseline_m
    return 0.5 * (range_m + float(np.linalg.norm(towards)))
