"""Ways of the robot: what a scene may say about them, and the pose at each frame."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import CaptureError, FloatArray, Params, Trajectory

Point = Annotated[list[float], Field(min_length=2, max_length=3)]
"""x and y, or x, y and z, in metres."""
_LONGEST = 2_000_000
"""Frames of one run: far more is a slip in a unit."""


def in_space(point: list[float]) -> FloatArray:
    """Point (3,) from two or three coordinates."""
    return np.asarray([*point, 0.0][:3], float)


class Static(Params):
    """The robot stands still."""

    kind: Literal["static"]
    position_m: Point = Field(default=[0.0, 0.0])
    yaw_deg: float = 0.0
    duration_s: float = Field(gt=0)

    def sampled(self, rate_hz: float) -> Trajectory:
        """Pose at each frame."""
        times = _times(self.duration_s, rate_hz)
        return _poses(times, np.tile(in_space(self.position_m), (len(times), 1)), np.radians(self.yaw_deg))


class Halt(Params):
    """Where the robot stands still on its way, and for how long."""

    at_m: float = Field(ge=0, description="Distance from the start of the way.")
    seconds: float = Field(gt=0)


class Straight(Params):
    """From one point straight to another at constant speed, with halts where the scene names some."""

    kind: Literal["straight"]
    start_m: Point
    end_m: Point
    speed_m_s: float = Field(0.3, gt=0)
    yaw_deg: float | None = Field(None, description="Heading; along the way if left out.")
    halts: list[Halt] = Field(default_factory=list, description="In the order of the way.")

    @model_validator(mode="after")
    def _halts_on_the_way(self) -> Straight:
        _check_halts(self.halts, _length(self.start_m, self.end_m))
        return self

    def sampled(self, rate_hz: float) -> Trajectory:
        """Pose at each frame."""
        return _along([self.start_m, self.end_m], self.speed_m_s, self.yaw_deg, rate_hz, self.halts)


class Waypoints(Params):
    """Straight legs between points at constant speed; at each point the robot turns on the spot.

    It stands still where the scene names halts.
    """

    kind: Literal["waypoints"]
    points_m: list[Point] = Field(min_length=2)
    speed_m_s: float = Field(0.3, gt=0)
    yaw_deg: float | None = Field(None, description="Heading; along each leg if left out.")
    turn_deg_s: float | None = Field(None, gt=0, description="How fast it turns; in an instant if left out.")
    halts: list[Halt] = Field(default_factory=list, description="In the order of the way.")

    @model_validator(mode="after")
    def _turns(self) -> Waypoints:
        if self.turn_deg_s is not None and self.yaw_deg is not None:
            raise ValueError("a robot that keeps its heading (yaw_deg) does not turn: leave turn_deg_s out")
        _check_halts(self.halts, float(np.sum([_length(*leg) for leg in pairwise(self.points_m)])))
        return self

    def sampled(self, rate_hz: float) -> Trajectory:
        """Pose at each frame."""
        if self.turn_deg_s is None:
            return _along(self.points_m, self.speed_m_s, self.yaw_deg, rate_hz, self.halts)
        return _turning(self.points_m, self.speed_m_s, np.radians(self.turn_deg_s), rate_hz, self.halts)


class Arc(Params):
    """Along a circle at constant speed, heading along it."""

    kind: Literal["arc"]
    center_m: Point
    radius_m: float = Field(gt=0)
    start_deg: float = Field(0.0, description="Where on the circle the robot starts, from +x.")
    sweep_deg: float = Field(360.0, description="How far it goes; negative is clockwise.")
    speed_m_s: float = Field(0.3, gt=0)

    @model_validator(mode="after")
    def _moves(self) -> Arc:
        if self.sweep_deg == 0:
            raise ValueError("sweep_deg must not be 0; a robot that stands still is kind: static")
        return self

    def sampled(self, rate_hz: float) -> Trajectory:
        """Pose at each frame."""
        sweep = np.radians(self.sweep_deg)
        times = _times(abs(sweep) * self.radius_m / self.speed_m_s, rate_hz)
        angle = np.radians(self.start_deg) + np.sign(sweep) * times * self.speed_m_s / self.radius_m
        ahead = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
        return _poses(times, in_space(self.center_m) + self.radius_m * ahead, angle + np.sign(sweep) * np.pi / 2)


class StopAndGo(Params):
    """Straight ahead in equal steps, with a halt after each."""

    kind: Literal["stop_and_go"]
    start_m: Point
    end_m: Point
    step_m: float = Field(gt=0)
    halt_s: float = Field(gt=0)
    speed_m_s: float = Field(0.3, gt=0)
    yaw_deg: float | None = Field(None, description="Heading; along the way if left out.")

    def sampled(self, rate_hz: float) -> Trajectory:
        """Pose at each frame."""
        start, end = in_space(self.start_m), in_space(self.end_m)
        length = float(np.linalg.norm(end - start))
        stops = int(np.ceil(length / self.step_m - 1e-9))
        if stops * (self.halt_s + self.step_m / self.speed_m_s) * rate_hz > _LONGEST:
            raise CaptureError(f"a trajectory of {stops} steps has more than {_LONGEST} frames")
        reached = np.minimum(np.arange(1, stops + 1) * self.step_m, length)
        arrivals = reached / self.speed_m_s + np.arange(stops) * self.halt_s
        knots_s = np.concatenate([[0.0], np.stack([arrivals, arrivals + self.halt_s], axis=1).ravel()])
        times = _times(knots_s[-1], rate_hz)
        gone = np.interp(times, knots_s, np.concatenate([[0.0], np.repeat(reached, 2)]))
        ahead = (end - start) / length if length else np.array([1.0, 0.0, 0.0])
        yaw = np.arctan2(ahead[1], ahead[0]) if self.yaw_deg is None else np.radians(self.yaw_deg)
        return _poses(times, start + gone[:, None] * ahead, float(yaw))


class FromFile(Params):
    """Poses from a CSV file beside the scene, between which the frames are interpolated.

    Columns ``timestamp_s``, ``x_m``, ``y_m``, ``yaw_rad`` and, if the height changes, ``z_m``.
    """

    kind: Literal["file"]
    file: str = Field(description="Path from the scene's folder, which it must not leave.")

    def sampled(self, rate_hz: float, folder: Path) -> Trajectory:
        """Pose at each frame."""
        path = folder / self.file
        if not path.resolve().is_relative_to(folder.resolve()):
            raise CaptureError(f"trajectory file '{self.file}' must lie in the scene's folder")
        table = _read_poses(path)
        times = table["timestamp_s"][0] + _times(float(np.ptp(table["timestamp_s"])), rate_hz)
        columns = [np.interp(times, table["timestamp_s"], table[name]) for name in ("x_m", "y_m", "z_m")]
        yaw = np.interp(times, table["timestamp_s"], np.unwrap(table["yaw_rad"]))
        return _poses(times, np.stack(columns, axis=1), yaw)


TrajectoryModel = Annotated[Static | Straight | Waypoints | Arc | StopAndGo | FromFile, Field(discriminator="kind")]


def sampled(model: TrajectoryModel, rate_hz: float, folder: Path) -> Trajectory:
    """Pose at each frame of a run.

    Parameters
    ----------
    model : TrajectoryModel
        One of the ways that a scene can name.
    rate_hz : float
        Frames a second.
    folder : Path
        The scene's folder, which holds the file of a ``kind: file``.

    Raises
    ------
    CaptureError
        If a trajectory file cannot be used, or the run is absurdly long.
    """
    return model.sampled(rate_hz, folder) if isinstance(model, FromFile) else model.sampled(rate_hz)


def _times(duration_s: float, rate_hz: float) -> FloatArray:
    """Frame times from 0 to the duration; one frame at least."""
    if duration_s * rate_hz > _LONGEST:
        raise CaptureError(f"a trajectory of {duration_s:g} s has more than {_LONGEST} frames at {rate_hz:g} Hz")
    return np.arange(int(duration_s * rate_hz * (1 + 1e-12)) + 1) / rate_hz


def _length(start: list[float], end: list[float]) -> float:
    return float(np.linalg.norm(in_space(end) - in_space(start)))


def _poses(times: FloatArray, position_m: FloatArray, yaw_rad: FloatArray | float) -> Trajectory:
    return Trajectory(times, position_m, np.broadcast_to(np.asarray(yaw_rad, float), times.shape).copy())


def _check_halts(halts: Sequence[Halt], length_m: float) -> None:
    """Refuse halts that are not in the order of the way, or behind its end."""
    reached = 0.0
    for number, halt in enumerate(halts):
        if halt.at_m > length_m:
            raise ValueError(f"halts[{number}].at_m: {halt.at_m:g} m lies behind the end of the way, {length_m:g} m")
        if number and halt.at_m <= reached:
            raise ValueError(f"halts[{number}].at_m: {halt.at_m:g} m must lie behind the halt before, {reached:g} m")
        reached = halt.at_m


def _going(duration_s: float, rate_hz: float, halts: Sequence[Halt], at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Frame times, and how long the robot has been going until each, without its halts.

    Parameters
    ----------
    duration_s : float
        Of the way without halts.
    rate_hz : float
    halts : sequence of Halt
    at_s : (halts,) array
        How long the robot has been going when it halts.
    """
    if not halts:
        times = _times(duration_s, rate_hz)
        return times, times
    halt_s = np.array([halt.seconds for halt in halts])
    left_s = at_s + np.cumsum(halt_s)
    times = _times(duration_s + halt_s.sum(), rate_hz)
    knots_s = np.concatenate([[0.0], np.stack([left_s - halt_s, left_s], axis=1).ravel(), [duration_s + halt_s.sum()]])
    return times, np.interp(times, knots_s, np.concatenate([[0.0], np.repeat(at_s, 2), [duration_s]]))


def _along(
    points: list[Point], speed_m_s: float, yaw_deg: float | None, rate_hz: float, halts: Sequence[Halt] = ()
) -> Trajectory:
    knots = np.stack([in_space(point) for point in points])
    legs = np.diff(knots, axis=0)
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(legs, axis=1))])
    at_s = np.array([halt.at_m for halt in halts]) / speed_m_s
    times, going_s = _going(reached[-1] / speed_m_s, rate_hz, halts, at_s)
    gone = np.minimum(going_s * speed_m_s, reached[-1])
    position = np.stack([np.interp(gone, reached, knots[:, axis]) for axis in range(3)], axis=1)
    if yaw_deg is not None:
        return _poses(times, position, np.radians(yaw_deg))
    leg = np.clip(np.searchsorted(reached, gone, side="right") - 1, 0, len(legs) - 1)
    return _poses(times, position, np.arctan2(legs[:, 1], legs[:, 0])[leg])


def _turning(
    points: list[Point], speed_m_s: float, turn_rad_s: float, rate_hz: float, halts: Sequence[Halt]
) -> Trajectory:
    """Legs between points, and turns on the spot by the shorter way from leg to leg."""
    stops = np.stack([in_space(point) for point in points])
    legs = np.diff(stops, axis=0)
    heading = np.unwrap(np.arctan2(legs[:, 1], legs[:, 0]))
    driven_s = np.linalg.norm(legs, axis=1) / speed_m_s
    turned_s = np.abs(np.diff(heading)) / turn_rad_s
    passed_s = np.zeros(2 * len(legs) - 1)  # a leg, a turn, a leg ...
    passed_s[0::2], passed_s[1::2] = driven_s, turned_s
    reached_s = np.concatenate([[0.0], np.cumsum(passed_s)])
    way_m = np.concatenate([[0.0], np.repeat(np.cumsum(driven_s * speed_m_s), 2)[:-1]])  # turning, it gains none
    times, going_s = _going(reached_s[-1], rate_hz, halts, np.interp([halt.at_m for halt in halts], way_m, reached_s))
    place = np.concatenate([[0], np.repeat(np.arange(1, len(legs)), 2), [len(legs)]])
    position = np.stack([np.interp(going_s, reached_s, stops[place, axis]) for axis in range(3)], axis=1)
    return _poses(times, position, np.interp(going_s, reached_s, np.repeat(heading, 2)))


def _read_poses(path: Path) -> dict[str, FloatArray]:
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise CaptureError(f"{path}: cannot be read: {error}") from error
    if len(rows) < 2:
        raise CaptureError(f"{path}: needs a header and at least two poses")
    table = {"z_m": np.zeros(len(rows))}
    for name in ("timestamp_s", "x_m", "y_m", "yaw_rad", *(("z_m",) if "z_m" in rows[0] else ())):
        if name not in rows[0]:
            raise CaptureError(f"{path}: has no column '{name}'")
        try:
            table[name] = np.array([float(row[name]) for row in rows])
        except (TypeError, ValueError) as error:
            raise CaptureError(f"{path}: column '{name}': {error}") from error
        if not np.all(np.isfinite(table[name])):
            raise CaptureError(f"{path}: column '{name}' holds a value that is not finite")
    if not np.all(np.diff(table["timestamp_s"]) > 0):
        raise CaptureError(f"{path}: column 'timestamp_s' must increase")
    return table
