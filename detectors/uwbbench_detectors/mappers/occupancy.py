"""Which cells of the plane are occupied, by what front ends detect along the way."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator

from uwbbench.api import (
    Detections,
    FloatArray,
    Map,
    Mapper,
    Params,
    Poses,
    Radar,
    Step,
    compose,
    load_plugin,
    ports,
    wrap_angle,
)
from uwbbench_detectors.mappers.cells import Cells

SIGMAS = 2.0
"""Standard deviations of range and azimuth within which a detection says anything of a cell."""


class PosesFrom(Params):
    """Another mapper, whose poses the grid is drawn from."""

    use: str = Field(description="Registered name of the mapper.")
    params: dict[str, Any] = Field(default_factory=dict, description="Its parameters.")

    @model_validator(mode="after")
    def _is_usable(self) -> Self:
        mapper = load_plugin("mappers", self.use)
        if "truth" in mapper.needs:
            raise ValueError(f"the mapper '{self.use}' needs the truth, which is withheld from a grid")
        try:
            self.made()
        except ValidationError as error:
            first = error.errors()[0]
            raise ValueError(f"{self.use}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
        return self

    def made(self) -> Mapper[Any]:
        """The mapper, not opened."""
        mapper = load_plugin("mappers", self.use)
        made: Mapper[Any] = mapper(mapper.params_type().model_validate(self.params))
        return made


class OccupancyParams(Params):
    """How large cells are, what a detection says of them, and where the robot is taken to be."""

    cell_m: float = Field(0.10, gt=0, description="Side of a cell.")
    range_sd_m: float = Field(
        0.06, gt=0, description="Standard deviation of a measured range; half a cell where that is more."
    )
    azimuth_sd_deg: float = Field(5.0, gt=0, le=45, description="Standard deviation of a measured azimuth.")
    occupied: float = Field(0.85, gt=0, description="Log-odds that a detection adds at its place.")
    free: float = Field(0.40, ge=0, description="Log-odds that it takes from what lies before it in its direction.")
    clamp: tuple[float, float] = Field(
        (-2.0, 3.5),
        description="Least and largest log-odds of a cell, so that a place that changes is not held to be what it was.",
    )
    reach_m: tuple[float, float] = Field((0.5, 3.5), description="Detections nearer or farther than this are left out.")
    azimuth_deg: float = Field(50.0, gt=0, le=180, description="So are those further from the boresight than this.")
    extent_m: float = Field(
        100.0, gt=0, description="Cells further than this from the origin, in x or in y, are not kept."
    )
    poses: PosesFrom | None = Field(
        None,
        description="Mapper whose poses are taken, as {use: NAME, params: {...}}; null: odometry as it is. Landmarks, "
        "segments and points of its map stay in the map.",
    )

    @field_validator("clamp")
    @classmethod
    def _clamp_holds_nothing(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not value[0] < 0 < value[1]:
            raise ValueError(f"[least, largest] must be below and above 0, which is nothing known, found {list(value)}")
        return value

    @field_validator("reach_m")
    @classmethod
    def _reach_is_a_span(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not 0 <= value[0] < value[1]:
            raise ValueError(f"[nearest, farthest] must be 0 <= nearest < farthest, found {list(value)}")
        return value


class Occupancy(Mapper[OccupancyParams]):
    r"""A grid of the log-odds that cells are occupied, from detections with range and azimuth.

    The inverse sensor model of the textbook (Thrun, Burgard, Fox, Probabilistic Robotics, 2005, table 9.2), with the
    beam's profile of sonar maps (Elfes, Computer 22(6), 1989). Of a cell at the distance d from the receiver, and the
    angle :math:`\theta` from a detection of range r, it says

    .. math::
        l = \begin{cases}
            l_{occ}\, e^{-\theta^2 / 2 \sigma_\theta^2}\, e^{-(d - r)^2 / 2 \sigma_r^2} & |d - r| \le 2 \sigma_r \\
            -l_{free}\, e^{-\theta^2 / 2 \sigma_\theta^2} & d < r - 2 \sigma_r
        \end{cases}

    within :math:`2 \sigma_\theta`, and nothing beyond. Of the detections of one receiver in one step the one that says
    the most counts, and occupied goes before free, as a radar sees what is behind a rod too. The sums of all steps are
    kept between bounds (numbers of OctoMap: Hornung et al., Autonomous Robots 34, 2013).

    Poses are those of odometry, or of another mapper as it hands them out on the way; a step without a pose of its own
    continues from the one before by odometry. What has been drawn is not drawn again when later poses correct earlier
    ones, so that memory is bounded by the area and not by the length of the run.

    A frame without a detection says nothing, as a radar's silence has many causes: free is only what a detection lies
    behind. A robot that stands repeats itself until the bounds stop it.
    """

    consumes: ClassVar[frozenset[str]] = ports("range_m", "azimuth_rad")

    def open(self, radars: Mapping[str, Radar], start: Poses) -> None:
        """Start with an empty grid."""
        super().open(radars, start)
        p = self.params
        self._radars = dict(radars)
        self._cells = Cells(p.cell_m, p.clamp, p.extent_m)
        self._pose = start.pose[0]
        self._locate: Mapper[Any] | None = None
        if p.poses is not None:
            self._locate = p.poses.made()
            self._locate.open(radars, start)
            if len(radars) < self._locate.receivers:
                self.note(f"poses: '{p.poses.use}' works with {self._locate.receivers} receivers, not {len(radars)}")

    def step(self, step: Step) -> Poses:
        """Draw what was found from where the robot is."""
        self._pose = compose(self._pose, step.moved)
        poses = Poses.of_one(step.index, self._pose)
        if self._locate is not None:
            poses = self._locate.step(step)
            if len(poses) and poses.index[-1] == step.index:
                self._pose = poses.pose[-1]
        for receiver, found in step.found.items():
            self._draw(self._radars[receiver], found)
        return poses

    def finish(self) -> tuple[Poses | None, Map]:
        """The grid, beside whatever the mapper of the poses has mapped."""
        smoothed, other = (None, Map()) if self._locate is None else self._locate.finish()
        if self._locate is not None:
            for text in self._locate.notes:
                self.note(text)
        return smoothed, dataclasses.replace(other, grid=self._cells.grid())

    def _draw(self, radar: Radar, found: Detections) -> None:
        p = self.params
        range_m, azimuth_rad = found.range_m, found.azimuth_rad
        nearest_m, farthest_m = p.reach_m
        usable = (range_m >= nearest_m) & (range_m <= farthest_m) & (np.abs(azimuth_rad) <= np.radians(p.azimuth_deg))
        if not usable.any():
            return
        range_m, azimuth_rad = range_m[usable], azimuth_rad[usable]
        *eye_m, boresight_rad = compose(self._pose, np.array([*radar.mount_position_m[:2], radar.mount_yaw_rad]))
        heading = boresight_rad + azimuth_rad
        range_sd_m, azimuth_sd_rad = max(p.range_sd_m, p.cell_m / 2), np.radians(p.azimuth_sd_deg)
        # The box of eye and beams: the ends of their middles and sides, and the bulge of the arcs between these.
        end_m = (range_m + SIGMAS * range_sd_m)[:, None]
        sides = heading[:, None] + SIGMAS * azimuth_sd_rad * np.array([-1.0, 0.0, 1.0])
        bulge_m = end_m.max() * (1.0 - np.cos(SIGMAS * azimuth_sd_rad / 2))
        ends_m = np.stack([(end_m * turned).ravel() for turned in (np.cos(sides), np.sin(sides))])
        low_m = eye_m + np.minimum(ends_m.min(axis=1), 0.0) - bulge_m
        high_m = eye_m + np.maximum(ends_m.max(axis=1), 0.0) + bulge_m
        x_m, y_m = self._cells.around(low_m, high_m)
        if not self._cells.holds(low_m, high_m):
            self.note(f"map.occupancy: what lies more than {p.extent_m:g} m from the origin is not in the map")
        evidence = says(x_m[None, :] - eye_m[0], y_m[:, None] - eye_m[1], range_m, heading, range_sd_m, azimuth_sd_rad)
        self._cells.add(x_m, y_m, np.where(evidence > 0, p.occupied, p.free) * evidence)


def says(
    x_m: FloatArray,
    y_m: FloatArray,
    range_m: FloatArray,
    heading_rad: FloatArray,
    range_sd_m: float,
    azimuth_sd_rad: float,
) -> FloatArray:
    """What the detections of a receiver say of cells, from -1, free, to 1, occupied; 0 where they say nothing.

    Parameters
    ----------
    x_m, y_m : arrays that broadcast to (rows, columns)
        Centres of the cells from the receiver, in the directions of the map's axes.
    range_m, heading_rad : (n,) arrays
        Of the detections, headings in the map's frame.
    range_sd_m, azimuth_sd_rad : float

    Returns
    -------
    (rows, columns) array
    """
    distance_m, bearing_rad = np.hypot(x_m, y_m)[..., None], np.arctan2(y_m, x_m)[..., None]
    aside = np.abs(wrap_angle(bearing_rad - heading_rad)) / azimuth_sd_rad
    beyond = (distance_m - range_m) / range_sd_m
    beam = np.where(aside <= SIGMAS, np.exp(-0.5 * aside**2), 0.0)
    occupied = np.where(np.abs(beyond) <= SIGMAS, beam * np.exp(-0.5 * beyond**2), 0.0).max(axis=-1)
    free = np.where(beyond < -SIGMAS, beam, 0.0).max(axis=-1)
    return np.asarray(np.where(occupied > 0, occupied, -free))
