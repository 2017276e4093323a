"""What mappers are tried on: a small run of steps with landmarks and anchors, and one of simulated captures."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache

import numpy as np

from uwbbench.api.anchors import Anchors, Messages
from uwbbench.api.arrays import FloatArray
from uwbbench.api.capture import Capture
from uwbbench.api.detections import Detections
from uwbbench.api.drive import Drive, relative
from uwbbench.api.geometry import receiver_pose, wrap_angle
from uwbbench.api.mapper import Poses, Step
from uwbbench.api.radar import Radar
from uwbbench.api.trial import RADAR
from uwbbench.api.truth import Obstacle, Trajectory, Truth
from uwbbench.measure.robustness.scene import on_radar
from uwbbench.tools.check.inputs import usual_capture

STEPS = 160
STEP_M = 0.08
FIELD_RAD = np.radians(55)
REACH_M = (0.4, 3.5)
NOISE = (0.03, np.radians(3))
"""Standard deviations of range and azimuth."""
SCALE, TURN = 1.01, 1.01
"""What odometry makes of distance and turn."""
PLACED = 30
"""Step in which the robot sets an anchor down."""
RADARS: dict[str, Radar] = {
    "front": dataclasses.replace(RADAR, receiver="front", mount_position_m=(0.0, 0.125, 0.0)),
    "side": dataclasses.replace(
        RADAR, receiver="side", mount_position_m=(-0.125, 0.0, 0.0), mount_yaw_rad=float(np.pi / 2)
    ),
}
POINTS_M = np.array(
    [(0.0, 0.4), (0.9, -0.3), (-0.9, -0.4), (2.6, 0.2), (0.8, 2.3), (-2.4, 0.4), (-0.6, -2.3), (2.0, 1.9), (1.9, -2.0)]
)
ANCHORS_M = np.array([(3.2, 2.6), (-3.0, -2.4), (0.3, 3.0)])


@dataclass(frozen=True)
class Ride:
    """A run as a mapper sees it, and the truth about it.

    Attributes
    ----------
    start : Poses
    steps : tuple of Step
    truth : Truth
    trajectory : Trajectory
    """

    start: Poses
    steps: tuple[Step, ...]
    truth: Truth
    trajectory: Trajectory


@cache
def usual_ride() -> Ride:
    """Twice round a circle among nine points and three anchors, with noise, drifting odometry and two receivers."""
    rng = np.random.default_rng(20_251_201)
    radius_m = 1.2
    angle = np.linspace(0.0, (STEPS - 1) * STEP_M / radius_m, STEPS)
    true = np.column_stack([radius_m * np.cos(angle), radius_m * np.sin(angle), wrap_angle(angle + np.pi / 2)])
    moved = np.zeros((STEPS, 3))
    moved[1:] = relative(true[:-1], true[1:]) * (SCALE, SCALE, TURN)
    steps = tuple(_step(index, true[index], moved[index], rng) for index in range(STEPS))
    flat = np.column_stack([true[:, :2], np.zeros(STEPS)])
    objects = tuple(Obstacle(f"rod-{place}", "metal", point[None]) for place, point in enumerate(POINTS_M))
    trajectory = Trajectory(np.linspace(0.0, 0.1 * (STEPS - 1), STEPS), flat, true[:, 2])
    return Ride(Poses.of_one(0, true[0], np.zeros((3, 3))), steps, Truth(objects), trajectory)


def _step(index: int, pose: FloatArray, moved: FloatArray, rng: np.random.Generator) -> Step:
    found, messages = {}, {}
    for name, radar in RADARS.items():
        range_m, azimuth_rad = _seen(radar, pose, POINTS_M)
        range_m = range_m + NOISE[0] * rng.standard_normal(len(range_m))
        azimuth_rad = azimuth_rad + NOISE[1] * rng.standard_normal(len(azimuth_rad))
        there = (abs(azimuth_rad) < FIELD_RAD) & (range_m > REACH_M[0]) & (range_m < REACH_M[1])
        rows = int(there.sum())
        found[name] = Detections(
            np.full(rows, index),
            range_m=range_m[there],
            azimuth_rad=azimuth_rad[there],
            amplitude=1 / range_m[there],
            score_db=np.full(rows, 20.0),
            track=np.flatnonzero(there),
            range_rate_m_s=np.zeros(rows),
            range_sd_m=np.full(rows, NOISE[0]),
        )
        far_m, towards_rad = _seen(radar, pose, ANCHORS_M)
        towards_rad = towards_rad + np.radians(5) * rng.standard_normal(len(far_m))
        heard = np.flatnonzero(abs(towards_rad) < np.pi / 4)
        placed = name == "front" and index == PLACED
        if placed or (len(heard) and index > PLACED):
            own = np.array([0]) if placed else heard
            messages[name] = Messages(own, towards_rad[own], far_m[own], np.full(len(own), placed))
    return Step(index, 0.1 * index, moved, found, messages)


def _seen(radar: Radar, pose: FloatArray, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Range and azimuth (n,) of points from a receiver of a robot at a pose."""
    at, facing = receiver_pose(
        np.array([[pose[0], pose[1], 0.0]]), pose[2:], np.asarray(radar.mount_position_m), radar.mount_yaw_rad
    )
    offset = points_m - at[0, :2]
    return np.hypot(*offset.T), np.asarray(wrap_angle(np.arctan2(offset[:, 1], offset[:, 0]) - facing[0]))


@cache
def usual_drive() -> Drive:
    """A run of two receivers that record the usual capture, with drifting odometry, and messages of an anchor."""
    return Drive("usual", tuple(_receiver(radar) for radar in RADARS.values()))


def _receiver(radar: Radar) -> Capture:
    usual = usual_capture()
    mount = {name: getattr(radar, name) for name in ("receiver", "mount_position_m", "mount_yaw_rad")}
    capture = on_radar(usual, dataclasses.replace(usual.radar, **mount))
    track = capture.trajectory
    start_m = track.position_m[:1]
    heard = Messages(np.array([7]), np.array([0.1]), np.array([2.0]), np.array([False]))
    return dataclasses.replace(
        capture,
        name=f"usual/{radar.receiver}",
        odometry_position_m=start_m + SCALE * (track.position_m - start_m),
        odometry_yaw_rad=track.yaw_rad + 1e-3 * np.arange(len(track)),
        anchors=Anchors(np.array([7]), np.array([[2.0, 0.3]]), np.array([20]), heard),
    )
