"""A drive: what all receivers of a robot recorded in one run, merged by time."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray, locked
from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.errors import CaptureError
from uwbbench.api.frames import Frames
from uwbbench.api.geometry import wrap_angle, wrap_one_angle
from uwbbench.api.radar import Radar
from uwbbench.api.truth import Trajectory

AGREEMENT_M = 0.01
"""Largest difference of the odometry that two receivers of one robot may report for the same time."""

AGREEMENT_RAD = 0.01
"""The same for its heading."""


@dataclass(frozen=True)
class Drive:
    """The captures of one run.

    Its *steps* are the times at which any receiver has a frame, in order: the ticks of the robot's clock.

    Attributes
    ----------
    name : str
    captures : tuple of Capture
        One a receiver, each with odometry.

    Raises
    ------
    CaptureError
        If there are none, a receiver appears twice, odometry is missing or not finite, or two receivers disagree in
        time or odometry.
    """

    name: str
    captures: tuple[Capture, ...]

    def __post_init__(self) -> None:
        if not self.captures:
            raise CaptureError(f"run '{self.name}' has no captures")
        names = [capture.radar.receiver for capture in self.captures]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise CaptureError(f"run '{self.name}' has two captures of the receiver '{twice}'")
        for capture in self.captures:
            _check_odometry(capture)
        for other in self.captures[1:]:
            _check_agreement(self.captures[0], other)

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def radar(self) -> Radar:
        """Radar of the first receiver."""
        return self.captures[0].radar

    @property
    def trajectory(self) -> Trajectory:
        """True poses at the steps."""
        return self.header.trajectory

    @property
    def radars(self) -> dict[str, Radar]:
        """Radar of each receiver."""
        return {capture.radar.receiver: capture.radar for capture in self.captures}

    @cached_property
    def time_s(self) -> FloatArray:
        """Time of each step (steps,)."""
        return locked(np.unique(np.concatenate([capture.trajectory.timestamp_s for capture in self.captures])))

    def frames(self, start: int = 0, stop: int | None = None, *, sts: bool = True) -> dict[str, Frames]:
        """Frames of each receiver in the steps ``start`` to ``stop``; receivers without any are left out.

        Parameters
        ----------
        start, stop : int
            First step, and the one behind the last; to the end where left out.
        sts : bool
            Read the STS responses, where a receiver has them.
        """
        blocks = {}
        for capture in self.captures:
            steps = self.steps[capture.radar.receiver]
            first, last = np.searchsorted(steps, (start, len(self) if stop is None else stop))
            if last > first:
                blocks[capture.radar.receiver] = capture.frames(int(first), int(last), sts=sts)
        return blocks

    def blocks(self, size: int, *, sts: bool = True) -> Iterator[dict[str, Frames]]:
        """Frames in consecutive blocks of ``size`` steps; the last may be shorter. ``sts`` as in :meth:`frames`."""
        for start in range(0, len(self), size):
            yield self.frames(start, start + size, sts=sts)

    @cached_property
    def steps(self) -> dict[str, IntArray]:
        """Step (frames,) of each frame of each receiver."""
        times = {capture.radar.receiver: capture.trajectory.timestamp_s for capture in self.captures}
        return {name: locked(np.searchsorted(self.time_s, time_s)) for name, time_s in times.items()}

    @cached_property
    def odometry(self) -> FloatArray:
        """x, y and yaw (steps, 3) as odometry has them; of the first receiver that has a frame then."""
        poses = np.empty((len(self), 3))
        for capture in reversed(self.captures):
            poses[self.steps[capture.radar.receiver]] = odometry_of(capture)
        return locked(poses)

    @cached_property
    def moved(self) -> FloatArray:
        """Odometry of each step (steps, 3) since the one before, in the robot's frame there; zeros in the first."""
        steps = np.zeros((len(self), 3))
        if len(self) > 1:
            steps[1:] = relative(self.odometry[:-1], self.odometry[1:])
        return locked(steps)

    def __repr__(self) -> str:
        receivers = ", ".join(self.radars)
        return f"Drive({self.name!r}: {len(self)} steps of {receivers}, {self.header.duration_s:.2f} s)"

    @cached_property
    def header(self) -> CaptureHeader:
        """The run without samples: truth, true poses at the steps, and the radars of the receivers."""
        position_m, yaw_rad = np.empty((len(self), 3)), np.empty(len(self))
        for capture in reversed(self.captures):
            steps = self.steps[capture.radar.receiver]
            position_m[steps], yaw_rad[steps] = capture.trajectory.position_m, capture.trajectory.yaw_rad
        first = self.captures[0].header
        trajectory = Trajectory(self.time_s, position_m, yaw_rad)
        radars = tuple(self.radars.values())
        return dataclasses.replace(
            first, name=self.name, trajectory=trajectory, recording=first.recording, radars=radars
        )

    @cached_property
    def sha256(self) -> str:
        """Of the content of all captures, in order; of a single one that of the capture."""
        if len(self.captures) == 1:
            return self.captures[0].sha256
        text = "\n".join(f"{capture.radar.receiver} {capture.sha256}" for capture in self.captures)
        return hashlib.sha256(text.encode()).hexdigest()


def odometry_of(capture: Capture) -> FloatArray:
    """x, y and yaw (frames, 3) of a capture's odometry, which it must have."""
    position_m, yaw_rad = capture.odometry_position_m, capture.odometry_yaw_rad
    if position_m is None or yaw_rad is None:
        raise CaptureError(f"capture '{capture.name}' has no odometry, which a mapper needs")
    return np.column_stack([position_m[:, :2], yaw_rad])


def compose(pose: FloatArray, moved: FloatArray) -> FloatArray:
    """Pose (3,) that a robot is at after it has moved (3,), forward, leftward and turning, from a pose (3,)."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    return np.array(
        [
            pose[0] + cosine * moved[0] - sine * moved[1],
            pose[1] + sine * moved[0] + cosine * moved[1],
            wrap_one_angle(pose[2] + moved[2]),
        ]
    )


def relative(start: FloatArray, end: FloatArray) -> FloatArray:
    """Poses ``end`` (n, 3) as seen from the poses ``start`` (n, 3)."""
    cosine, sine = np.cos(start[:, 2]), np.sin(start[:, 2])
    x, y = (end - start)[:, 0], (end - start)[:, 1]
    return np.column_stack([cosine * x + sine * y, cosine * y - sine * x, wrap_angle(end[:, 2] - start[:, 2])])


def _check_odometry(capture: Capture) -> None:
    if not len(capture):
        raise CaptureError(f"capture '{capture.name}' has no frames")
    finite = np.isfinite(odometry_of(capture)).all(axis=1)
    if not finite.all():
        raise CaptureError(f"capture '{capture.name}': odometry is not finite in frame {int(np.argmin(finite))}")


def _check_agreement(first: Capture, other: Capture) -> None:
    """Refuse two receivers that cannot have been on one robot at one time.

    Where both have a frame at one time, their odometry must agree; in between it must lie by the way between frames.
    """
    pair = f"captures '{first.name}' and '{other.name}' are no receivers of one run"
    times = [capture.trajectory.timestamp_s for capture in (first, other)]
    start, stop = max(t[0] for t in times), min(t[-1] for t in times)
    if start > stop:
        spans = " and ".join(f"{t[0]:g} to {t[-1]:g} s" for t in times)
        raise CaptureError(f"{pair}: their times, {spans}, have nothing in common")
    shared = (times[1] >= start) & (times[1] <= stop)
    mine, theirs = odometry_of(first), odometry_of(other)[shared]
    at = times[1][shared]
    poses = np.column_stack([mine[:, :2], np.unwrap(mine[:, 2])])
    expected = np.column_stack([np.interp(at, times[0], column) for column in poses.T])
    apart_m = np.hypot(*(theirs - expected)[:, :2].T)
    apart_rad = np.abs(wrap_angle(theirs[:, 2] - expected[:, 2]))
    after = np.searchsorted(times[0], at)
    step = np.abs(poses[after] - poses[np.maximum(after - 1, 0)])
    step[times[0][after] == at] = (
        0.0  # between two frames nobody knows when the robot made the step, or turned on the spot
    )
    wrong = (apart_m > AGREEMENT_M + np.hypot(step[:, 0], step[:, 1])) | (apart_rad > AGREEMENT_RAD + step[:, 2])
    if wrong.any():
        row = int(np.argmax(wrong))
        difference = f"{100 * apart_m[row]:.1f} cm and {np.degrees(apart_rad[row]):.1f} degrees at {at[row]:g} s"
        raise CaptureError(f"{pair}: their odometry differs by {difference}")
