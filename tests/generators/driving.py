"""A robot on two wheels that is steered through points: it speeds up and slows down, turns, halts, and slips.

Poses are integrated step by step from speed and turn rate, each with a limited acceleration; short corners are cut
in an arc where the robot need not turn far, and else it turns on the spot.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uwbbench.api import FloatArray

ACCELERATION_M_S2, ACCELERATION_RAD_S2 = 0.6, 4.0
ARC_RAD = np.radians(50)
"""Up to here the robot steers while it drives."""
NEAR_M = 0.04
TRACK_M, TICK_M = 0.3, 0.4e-3
"""Distance of the wheels, and what one tick of an encoder is."""
LONGEST_S = 150.0


@dataclass
class Robot:
    """State of the robot, and the poses that it has gone through.

    Attributes
    ----------
    place_m : (2,) array
    yaw_rad : float
    rate_hz : float
    """

    place_m: FloatArray
    yaw_rad: float
    rate_hz: float
    speed_m_s: float = 0.0
    turn_rad_s: float = 0.0
    poses: list[tuple[float, float, float]] = field(default_factory=list)

    def step(self, speed_m_s: float, turn_rad_s: float) -> None:
        """One frame with the speeds that are wanted, as far as the motors follow."""
        dt = 1 / self.rate_hz
        most = np.array([ACCELERATION_M_S2, ACCELERATION_RAD_S2]) * dt
        change = np.clip([speed_m_s - self.speed_m_s, turn_rad_s - self.turn_rad_s], -most, most)
        self.speed_m_s += change[0]
        self.turn_rad_s += change[1]
        self.yaw_rad += self.turn_rad_s * dt
        self.place_m = self.place_m + self.speed_m_s * dt * np.array([np.cos(self.yaw_rad), np.sin(self.yaw_rad)])
        self.poses.append((*self.place_m, self.yaw_rad))

    def halt(self, seconds: float) -> None:
        """Come to rest, and stay so."""
        while self.speed_m_s or self.turn_rad_s:
            self.step(0.0, 0.0)
        for _ in range(int(seconds * self.rate_hz)):
            self.step(0.0, 0.0)

    def error_rad(self, goal_m: FloatArray) -> float:
        """How far the heading is off a goal."""
        way = goal_m - self.place_m
        return float(np.angle(np.exp(1j * (np.arctan2(way[1], way[0]) - self.yaw_rad))))


def steered(
    points_m: FloatArray, speed_m_s: float, turn_rad_s: float, halts_s: dict[int, float], rate_hz: float
) -> FloatArray:
    """Poses (frames, 3), x, y and heading, of a robot on its way through points.

    Parameters
    ----------
    points_m : (n, 2) array
    speed_m_s, turn_rad_s : float
        As fast as it drives and turns.
    halts_s : dict of int to float
        For how long it stands still amid the way to a point, by the point's number.
    rate_hz : float
        Frames a second.
    """
    first = points_m[1] - points_m[0]
    robot = Robot(points_m[0].astype(float), float(np.arctan2(first[1], first[0])), rate_hz)
    for number, goal in enumerate(points_m[1:], 1):
        if abs(robot.error_rad(goal)) > ARC_RAD:
            robot.halt(0.0)
            while abs(error := robot.error_rad(goal)) > 5e-3 or abs(robot.turn_rad_s) > 0.1:
                fastest = min(turn_rad_s, 0.8 * np.sqrt(2 * ACCELERATION_RAD_S2 * abs(error)), 8 * abs(error))
                robot.step(0.0, float(np.sign(error)) * fastest)
        half = float(np.linalg.norm(goal - robot.place_m)) / 2
        waits = halts_s.get(number)
        while (left := float(np.linalg.norm(goal - robot.place_m))) > NEAR_M and len(robot.poses) < LONGEST_S * rate_hz:
            if waits is not None and left < half:
                robot.halt(waits)
                waits = None
            error = robot.error_rad(goal)
            if left < 0.3 and abs(error) > ARC_RAD:  # it has passed by: near enough
                break
            last = number == len(points_m) - 1
            ahead = min(speed_m_s, np.sqrt(2 * ACCELERATION_M_S2 * left) * 0.9) if last else speed_m_s
            robot.step(ahead * max(float(np.cos(error)), 0.2), float(np.clip(3 * error, -turn_rad_s, turn_rad_s)))
    return np.array(robot.poses)


def encoders(poses: FloatArray, slips: int, rng: np.random.Generator) -> FloatArray:
    """Poses (frames, 3) as the robot believes in them: wheels of unequal size, counted in ticks, that slip.

    Parameters
    ----------
    poses : (frames, 3) array
    slips : int
        Times that one wheel spins for a quarter of a second while the robot drives.
    rng : Generator
    """
    steps = np.diff(poses, axis=0)
    middle = poses[:-1, 2] + steps[:, 2] / 2
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    wheels = ahead[:, None] + steps[:, 2:] * TRACK_M / 2 * np.array([-1, 1])
    wheels = wheels * (1 + 0.008 * rng.standard_normal(2))
    driving = np.flatnonzero(np.abs(ahead) > 1e-4)
    for _ in range(slips):
        start, wheel = int(rng.choice(driving)), int(rng.integers(2))
        wheels[start : start + 12, wheel] += rng.uniform(0.01, 0.05) / 12
    counted = np.diff(np.round(np.cumsum(np.vstack([np.zeros(2), wheels]), axis=0) / TICK_M) * TICK_M, axis=0)
    yaw = poses[0, 2] + np.concatenate([[0.0], np.cumsum((counted[:, 1] - counted[:, 0]) / TRACK_M)])
    between = (yaw[1:] + yaw[:-1]) / 2
    way = counted.mean(axis=1)[:, None] * np.stack([np.cos(between), np.sin(between)], axis=1)
    return np.column_stack([poses[0, :2] + np.vstack([np.zeros(2), np.cumsum(way, axis=0)]), yaw])
