"""Checks of a mapper: what it answers, step by step, and that only what it is given decides."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from uwbbench.api.anchors import Messages
from uwbbench.api.arrays import FloatArray
from uwbbench.api.case import NotApplicable
from uwbbench.api.detections import Detections
from uwbbench.api.geometry import wrap_angle
from uwbbench.api.mapper import LANDMARK_KINDS, Mapped, Mapper, Poses, Step
from uwbbench.api.registry import AuthoredKind
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.drives import RADARS, Ride, usual_ride
from uwbbench.tools.check.params import working_params
from uwbbench.tools.check.subject import ClassSubject
from uwbbench.tools.check.values import Values, same

_MAPPER = "uwbbench.api.mapper.Mapper"
CLOSE = 1e-6
"""Metres and radians that rounding may make of a run that is turned and shifted."""


class MapperSubject(ClassSubject):
    """One mapper, and the usual run that it is given."""

    kind: ClassVar[AuthoredKind] = "mapper"
    base: ClassVar[type] = Mapper

    @cached_property
    def params(self) -> Any:
        """Parameters that it is examined with."""
        return working_params(self.cls.params_type(), self.given, f"mapper '{self.name}'", self.name)

    @property
    def ride(self) -> Ride:
        """The usual run, with the columns that this mapper declares."""
        ride = usual_ride()
        return dataclasses.replace(ride, steps=tuple(map(self._declared, ride.steps)))

    def _declared(self, step: Step) -> Step:
        found = {name: declared(rows, self.cls.consumes) for name, rows in step.found.items()}
        return dataclasses.replace(step, found=found)

    def opened(self, ride: Ride) -> Mapper[Any]:
        """A fresh instance at the start of a run."""
        mapper: Mapper[Any] = self.cls(self.params)
        mapper.open(RADARS, ride.start)
        if "truth" in self.cls.needs:
            mapper.show_truth(ride.truth, ride.trajectory)
        return mapper

    def driven(self, ride: Ride) -> Mapped:
        """What a fresh instance makes of a run."""
        mapper = self.opened(ride)
        poses = Poses.join([mapper.step(step) for step in ride.steps])
        smoothed, learnt = mapper.finish()
        return Mapped(poses, learnt, smoothed)

    @cached_property
    def mapped(self) -> Mapped:
        """What it makes of the usual run."""
        return self.driven(self.ride)

    def result(self) -> Values:
        """Poses and map of a fresh instance on the usual run."""
        return of_mapped(self.driven(self.ride))

    def input_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of the usual run."""
        parts: dict[str, NDArray[Any]] = {"start": np.asarray(usual_ride().start.pose)}
        for step in usual_ride().steps[:3]:
            parts[f"moved {step.index}"] = step.moved
            for name, rows in step.found.items():
                parts |= {f"{column} {name} {step.index}": values for column, values in rows.columns.items()}
        return parts


def declared(rows: Detections, columns: frozenset[str]) -> Detections:
    """Rows with nothing but the columns that a mapper consumes."""
    kept: dict[str, Any] = {name: values for name, values in rows.columns.items() if name in columns}
    return Detections(rows.frame, **kept)


def of_mapped(mapped: Mapped) -> Values:
    """Arrays of poses and map by name."""
    landmarks, grid = mapped.map.landmarks, mapped.map.grid
    values: dict[str, NDArray[Any]] = {"poses": mapped.poses.pose, "steps": mapped.poses.index}
    optional = {
        "covariance": mapped.poses.covariance,
        "smoothed": None if mapped.smoothed is None else mapped.smoothed.pose,
        "log odds": None if grid is None else grid.log_odds,
        "origin": None if grid is None else grid.origin_m,
    }
    values |= {name: array for name, array in optional.items() if array is not None}
    values |= {f"landmarks' {field.name}": getattr(landmarks, field.name) for field in dataclasses.fields(landmarks)}
    return values | {"segments": mapped.map.segments_m, "points": mapped.map.points_m}


@check(_MAPPER)
def every_step_has_a_pose(subject: MapperSubject) -> str:
    """Each step is answered once, in order, by itself or later but never before, with finite numbers."""
    ride, mapper = subject.ride, subject.opened(subject.ride)
    seen: list[int] = []
    for step in ride.steps:
        poses = mapper.step(step)
        if len(poses) and int(poses.index.max()) > step.index:
            raise Nonconformity(f"after step {step.index} poses up to it", f"one of step {int(poses.index.max())}")
        seen += poses.index.tolist()
        _finite("poses", poses.pose)
    mapper.finish()
    if seen != list(range(len(ride.steps))):
        raise Nonconformity(f"{len(ride.steps)} steps, each once and in order", f"{len(seen)} poses, or others")
    return f"{len(seen)} poses"


@check("uwbbench.api.mapper.Poses")
def covariances_are_covariances(subject: MapperSubject) -> None:
    """Covariances of poses and landmarks are finite and symmetric, with no negative eigenvalue."""
    mapped = subject.mapped
    every = {"poses": mapped.poses.covariance, "landmarks": mapped.map.landmarks.covariance}
    if mapped.poses.covariance is None and not len(mapped.map.landmarks):
        raise NotApplicable("it states none")
    for name, covariance in every.items():
        if covariance is None or not len(covariance):
            continue
        _finite(f"covariances of {name}", covariance)
        largest = np.abs(covariance).max(axis=(1, 2)) + 1e-12
        skew = np.abs(covariance - covariance.transpose(0, 2, 1)).max(axis=(1, 2)) / largest
        lowest = np.linalg.eigvalsh(covariance)[:, 0] / largest
        if skew.max() > 1e-9 or lowest.min() < -1e-9:
            found = f"skew {skew.max():.2g}, lowest eigenvalue {lowest.min():.2g} of the largest element"
            raise Nonconformity(f"symmetric, positive covariances of {name}", found)


@check("uwbbench.api.mapper.Map")
def map_is_finite(subject: MapperSubject) -> str:
    """Landmarks have kinds that exist, numbers of their own and finite places; so have segments and points."""
    learnt = subject.mapped.map
    marks = learnt.landmarks
    for name, values in (("a", marks.a), ("b", marks.b), ("segments", learnt.segments_m), ("points", learnt.points_m)):
        _finite(name, values)
    if not np.isin(marks.kind, np.arange(len(LANDMARK_KINDS))).all():
        raise Nonconformity(f"kinds 0 to {len(LANDMARK_KINDS) - 1}", str(sorted(set(marks.kind.tolist()))))
    if len(np.unique(marks.identity)) < len(marks):
        raise Nonconformity("a number for each landmark", "one that occurs twice")
    if learnt.grid is not None:
        _finite("the grid", learnt.grid.log_odds)
    kinds = ", ".join(f"{len(marks.of(kind))} of kind {kind}" for kind in LANDMARK_KINDS if len(marks.of(kind)))
    return kinds or f"{len(learnt.segments_m)} segments, {len(learnt.points_m)} points"


@check(_MAPPER)
def answer_moves_with_the_world(subject: MapperSubject) -> str:
    """A run that starts elsewhere and faces elsewhere gives the same poses and points there: nothing else is known."""
    angle, shift_m = 0.7, np.array([3.0, -1.5])
    ride = subject.ride
    moved = dataclasses.replace(
        ride,
        start=Poses.of_one(0, turned(ride.start.pose, angle, shift_m)[0], np.zeros((3, 3))),
        truth=ride.truth if "truth" not in subject.cls.needs else _turned_truth(ride, angle, shift_m),
        trajectory=_turned_trajectory(ride, angle, shift_m),
    )
    there = subject.driven(moved)
    expected = turned(subject.mapped.poses.pose, angle, shift_m)
    worst = deviation(expected, there.poses.pose)
    marks, others = subject.mapped.map.landmarks, there.map.landmarks
    if len(marks) != len(others) or not np.array_equal(marks.kind, others.kind):
        raise Nonconformity(f"{len(marks)} landmarks there too", str(len(others)))
    points = marks.kind != LANDMARK_KINDS.index("line")
    places = turned(np.column_stack([marks.position_m, np.zeros(len(marks))]), angle, shift_m)[points, :2]
    apart = float(np.abs(places - others.position_m[points]).max(initial=0.0))
    if max(worst, apart) > CLOSE:
        raise Nonconformity(f"poses and landmarks moved alike, within {CLOSE:g}", f"off by {max(worst, apart):.2g}")
    return f"within {max(worst, apart):.1g}"


def turned(pose: FloatArray, angle: float, shift_m: FloatArray) -> FloatArray:
    """Poses (n, 3) turned about the origin and shifted.

    Parameters
    ----------
    pose : (n, 3) array
    angle : float
        In radians.
    shift_m : (2,) array
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = pose[:, 0], pose[:, 1]
    places = np.column_stack([cosine * x - sine * y, sine * x + cosine * y]) + shift_m
    return np.column_stack([places, pose[:, 2] + angle])


def deviation(one: FloatArray, other: FloatArray) -> float:
    """Largest difference of poses (n, 3), in metres or radians; infinite where their numbers differ."""
    if one.shape != other.shape:
        return float("inf")
    apart = np.abs(one[:, :2] - other[:, :2]).max(initial=0.0)
    return float(max(apart, np.abs(wrap_angle(one[:, 2] - other[:, 2])).max(initial=0.0)))


def _turned_trajectory(ride: Ride, angle: float, shift_m: FloatArray) -> Any:
    track = ride.trajectory
    pose = turned(np.column_stack([track.position_m[:, :2], track.yaw_rad]), angle, shift_m)
    flat = np.column_stack([pose[:, :2], track.position_m[:, 2]])
    return dataclasses.replace(track, position_m=flat, yaw_rad=pose[:, 2])


def _turned_truth(ride: Ride, angle: float, shift_m: FloatArray) -> Any:
    def outline(points_m: FloatArray) -> FloatArray:
        return turned(np.column_stack([points_m[:, :2], np.zeros(len(points_m))]), angle, shift_m)[:, :2]

    objects = [dataclasses.replace(one, outline_m=outline(one.outline_m)) for one in ride.truth.objects]
    return dataclasses.replace(ride.truth, objects=tuple(objects))


def _without(steps: Sequence[Step], **changes: Any) -> tuple[Step, ...]:
    return tuple(dataclasses.replace(step, **changes) for step in steps)


@check(_MAPPER)
def nothing_found_is_fine(subject: MapperSubject) -> str:
    """Where no front end finds anything there are poses all the same: odometry is known."""
    ride = subject.ride
    empty = {name: Detections.empty() for name in RADARS}
    mapped = subject.driven(dataclasses.replace(ride, steps=_without(ride.steps, found=empty, messages={})))
    _finite("poses", mapped.poses.pose)
    return f"{len(mapped.poses)} poses, {len(mapped.map.landmarks)} landmarks"


@check(_MAPPER)
def rows_without_a_place_change_nothing(subject: MapperSubject) -> None:
    """Rows whose range or azimuth is not finite are left out: front ends leave NaN where they could not measure."""
    ride = subject.ride
    bare: dict[str, Any] = {name: [np.nan] for name in subject.cls.consumes if name not in ("detections", "track")}
    bare |= {"track": [-1]} if "track" in subject.cls.consumes else {}

    def spoiled(step: Step) -> Step:
        found = {
            name: Detections.join([rows, Detections([step.index], **bare)]) if len(rows) else rows
            for name, rows in step.found.items()
        }
        return dataclasses.replace(step, found=found)

    mapped = subject.driven(dataclasses.replace(ride, steps=tuple(map(spoiled, ride.steps))))
    same(of_mapped(subject.mapped), of_mapped(mapped), "the same poses and map as without such rows")


@check(_MAPPER)
def standing_robot_is_fine(subject: MapperSubject) -> str:
    """A robot that stands for the whole run has finite poses, near its start: noise alone must not carry it away."""
    ride = subject.ride
    first = ride.steps[1]
    steps = tuple(
        dataclasses.replace(first, index=step.index, time_s=step.time_s, moved=np.zeros(3), messages={})
        for step in ride.steps
    )
    mapped = subject.driven(dataclasses.replace(ride, steps=steps))
    _finite("poses", mapped.poses.pose)
    gone_m = float(np.hypot(*(mapped.poses.pose[-1, :2] - ride.start.pose[0, :2])))
    if gone_m > 0.2:
        raise Nonconformity("a pose within 20 cm of the start", f"one {100 * gone_m:.0f} cm away")
    return f"{100 * gone_m:.1f} cm from the start"


@check(_MAPPER)
def jump_of_odometry_is_survived(subject: MapperSubject) -> str:
    """Odometry that jumps by metres in one step, as of a robot that was lifted, leaves poses and map finite."""
    ride, at = subject.ride, len(subject.ride.steps) // 2
    steps = list(ride.steps)
    steps[at] = dataclasses.replace(steps[at], moved=steps[at].moved + np.array([3.0, -2.0, 2.0]))
    mapper = subject.opened(ride)
    poses = Poses.join([mapper.step(step) for step in steps])
    _, learnt = mapper.finish()
    _finite("poses", poses.pose)
    _finite("landmarks", learnt.landmarks.position_m)
    return mapper.notes[0] if mapper.notes else "no note"


@check(_MAPPER)
def wrong_identities_are_survived(subject: MapperSubject) -> str:
    """Anchors whose messages carry each other's numbers leave poses finite."""
    ride = subject.ride

    def confused(step: Step) -> Step:
        swapped = {
            name: Messages((heard.anchor + 1) % 3, heard.azimuth_rad, heard.range_m, heard.placed)
            for name, heard in step.messages.items()
        }
        return dataclasses.replace(step, messages=swapped if step.index > len(ride.steps) // 2 else step.messages)

    mapper = subject.opened(ride)
    poses = Poses.join([mapper.step(confused(step)) for step in ride.steps])
    mapper.finish()
    _finite("poses", poses.pose)
    return mapper.notes[0] if mapper.notes else "no note"


@check(_MAPPER)
def runs_share_nothing(subject: MapperSubject) -> None:
    """Two runs by turns give what each alone gives: state belongs to the instance."""
    ride = subject.ride
    one, other = subject.opened(ride), subject.opened(ride)
    poses = []
    for step in ride.steps:
        poses.append(one.step(step))
        if step.index % 3 == 0:
            other.step(dataclasses.replace(step, index=step.index // 3))
    smoothed, learnt = one.finish()
    mapped = Mapped(Poses.join(poses), learnt, smoothed)
    same(subject.usual, of_mapped(mapped), "beside another run the same result")


def _finite(what: str, values: NDArray[Any]) -> None:
    if not np.isfinite(values).all():
        raise Nonconformity(f"finite {what}", f"{int((~np.isfinite(values)).sum())} numbers that are not")


CHECKS = (
    every_step_has_a_pose,
    covariances_are_covariances,
    map_is_finite,
    answer_moves_with_the_world,
    nothing_found_is_fine,
    rows_without_a_place_change_nothing,
    standing_robot_is_fine,
    jump_of_odometry_is_survived,
    wrong_identities_are_survived,
    runs_share_nothing,
)
