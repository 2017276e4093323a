"""Objects that stand still in the world, kept while nothing can be measured of them."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, Detections, FloatArray, Radar, Stage, ports
from uwbbench_detectors.integrate.motion import MotionParams, places_m
from uwbbench_detectors.tracks import fixed_layout as lay


class FixedTrackParams(MotionParams):
    """When an object is believed, how well it is measured, and where it is shown."""

    look_m: float = Field(0.05, gt=0, description="Way of the robot that makes two looks at an object independent.")
    detected: float = Field(0.6, gt=0, lt=1, description="Probability that a look at an object in view finds it.")
    by_chance: float = Field(0.1, gt=0, lt=1, description="Probability that a look finds something else in its place.")
    most_evidence: float = Field(5.0, gt=0, description="Log odds that an object can gather: it is lost in so many.")
    shown: float = Field(0.0, description="Log odds from which on an object is a row.")
    holds: float = Field(
        2.2, description="Log odds from which on an object is a row where it is not measured: nine to one."
    )
    birth: float = Field(-0.8, description="Log odds of what was detected once.")
    range_sd_m: float = Field(0.06, gt=0, description="Error of a range, of the parts of an extended object.")
    azimuth_sd_deg: float = Field(6.0, gt=0, description="Error of an azimuth.")
    wander_m: float = Field(0.1, ge=0, description="By which the part that reflects moves, over a metre of way.")
    gate: float = Field(9.0, gt=0, description="Squared distance of a detection from its object, at most.")
    apart_m: float = Field(0.3, ge=0, description="Objects nearer to each other are one.")
    mirror_db: float = Field(
        3.0,
        description="An object that reflects so much more than another one, farther away, is taken for a mirror that "
        "may show it.",
    )
    plane_m: float = Field(
        0.15,
        ge=0,
        description="What lies so near the plane of a mirror, or behind it, may be its image, or part of it.",
    )
    view_deg: float = Field(47.0, gt=0, description="Azimuth up to which objects are rows.")
    looks_deg: float = Field(90.0, gt=0, description="Azimuth up to which an object should be found by a look.")
    near_m: float = Field(0.2, ge=0, description="Range from which on objects are rows.")
    step_m: float = Field(0.001, gt=0, description="Way below which a frame is no look.")


class FixedTrack(Stage[FixedTrackParams]):
    """Objects that stand still in the world: believed after several looks, held where nothing can be measured.

    Each object has a place with a covariance, renewed by a Kalman filter from ranges and azimuths, and log odds that it
    is there. A frame is ``way / look_m`` of a look, as echoes along a shorter way fade together: the odds of an object
    that is found rise by that share of ``log(detected / by_chance)``, those of one in view that is not fall by it of
    ``log((1 - detected) / (1 - by_chance))``. Detections go to the nearest object within the gate, in standard
    deviations; others begin one. Objects nearer than ``apart_m`` are one. A robot that does not move has no looks:
    nothing is learned and nothing forgotten, however long it stands, and however it turns.

    One row for each believed object in view in each valid frame: the range of its detection, or, ``held`` 1, where the
    object should be by odometry; its azimuth; amplitude and score of its last detection; ``track``, its number;
    ``probability_there``. Rows that are held need more evidence (``holds``), since nothing renews it.

    A mirror, such as a wall, stands across the line along which it is seen; whatever reflects less and lies behind that
    plane is what the mirror shows, hides, or carries, such as corners and fittings. An object behind the plane of a
    nearer one that is shown and reflects ``mirror_db`` more, by amplitude times range, is no row.

    Frames must be relative to the direct path, as amplitudes are compared between frames.

    References
    ----------
    Log odds of looks: Elfes, Computer 22(6):46, 1989.
    """

    consumes: ClassVar[frozenset[str]] = ports(
        "frames", "detections", "range_m", "azimuth_rad", "amplitude", "score_db"
    )
    produces: ClassVar[frozenset[str]] = ports(
        "detections", "range_m", "azimuth_rad", "amplitude", "score_db", "held", "track", "probability_there"
    )
    removes: ClassVar[frozenset[str]] = ports("tap", "delay_s", "pdoa_rad", "motion_cosine", "motion_rad")
    fidelity = "baseline"

    def open(self, radar: Radar) -> None:
        """Start without objects."""
        super().open(radar)
        from uwbbench_detectors.tracks.fixed_loops import follow

        p = self.params
        self._follow = follow
        settings = {
            lay.LOOK_M: p.look_m,
            lay.HIT: np.log(p.detected / p.by_chance),
            lay.MISS: np.log((1 - p.detected) / (1 - p.by_chance)),
            lay.MOST_EVIDENCE: p.most_evidence,
            lay.SHOWN: p.shown,
            lay.HOLDS: p.holds,
            lay.FORGOTTEN: p.birth - 1,
            lay.BIRTH: p.birth,
            lay.RANGE_VARIANCE: p.range_sd_m**2,
            lay.AZIMUTH_VARIANCE: np.deg2rad(p.azimuth_sd_deg) ** 2,
            lay.WANDER: p.wander_m**2,
            lay.GATE: p.gate,
            lay.APART_M: p.apart_m,
            lay.PLANE_M: p.plane_m,
            lay.MIRROR: 10 ** (p.mirror_db / 20),
            lay.LOOKS_RAD: np.deg2rad(p.looks_deg),
            lay.VIEW_RAD: np.deg2rad(p.view_deg),
            lay.NEAR_M: p.near_m,
            lay.FAR_M: radar.window_m,
            lay.MOUNT_X: radar.mount_position_m[0],
            lay.MOUNT_Y: radar.mount_position_m[1],
            lay.MOUNT_RAD: radar.mount_yaw_rad,
            lay.STEP_M: p.step_m,
        }
        self.at: FloatArray = np.zeros(lay.SETTINGS)
        self.at[list(settings)] = list(settings.values())
        self.objects: FloatArray = np.zeros((lay.MOST, lay.FIELDS))
        self.carried: FloatArray = np.zeros(lay.CARRIED)

    def step(self, block: Block) -> Block:
        """Block whose detections are objects."""
        frames, rows = block.frames, block.detections
        place_m, yaw_rad = places_m(self, frames)
        looked = frames.valid & np.asarray(frames.preamble.any(axis=1))
        looked[block.rows] = True
        found = np.zeros((len(rows), lay.GIVEN))
        for place, name in enumerate(("range_m", "azimuth_rad", "amplitude", "score_db"), 1):
            found[:, place] = rows[name]
        found[:, lay.DETECTED_HELD] = rows["held"] if "held" in rows.names else 0.0
        starts = np.searchsorted(block.rows, np.arange(len(frames) + 1))
        table = self._follow(self.objects, self.carried, found, starts, looked, place_m, yaw_rad, frames.first, self.at)
        tracks = Detections.of_table(lay.NAMES, table, (frames.first, frames.valid), rows.notes)
        return block.replace(detections=tracks)
