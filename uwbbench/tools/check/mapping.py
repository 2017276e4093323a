"""Checks of a detector file with a mapper: how it runs on a drive, and that the true poses stay withheld."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from uwbbench.api.capture import Capture
from uwbbench.api.case import NotApplicable
from uwbbench.api.detections import Detections
from uwbbench.api.drive import Drive
from uwbbench.api.errors import CaptureError
from uwbbench.api.mapper import Mapped, Poses
from uwbbench.api.registry import AuthoredKind
from uwbbench.api.truth import Trajectory
from uwbbench.config.detector import is_bound, read_detector
from uwbbench.detect.mapping import MappingPipeline
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.detector import file_says_what_it_is
from uwbbench.tools.check.drives import usual_drive
from uwbbench.tools.check.inputs import CALLS, CUTS, call_s
from uwbbench.tools.check.mapper import CLOSE, deviation, of_mapped, turned
from uwbbench.tools.check.subject import Subject
from uwbbench.tools.check.values import Values, of_detections, same

_MAPPING = "uwbbench.detect.mapping"


class MappingSubject(Subject):
    """One detector with a mapper; the parameters given are values to change in it, by path."""

    kind: ClassVar[AuthoredKind] = "detector"

    def __init__(self, name: str, params: Mapping[str, Any] | None = None, roots: tuple[Path, ...] = ()) -> None:
        super().__init__(name, params, roots)
        self.pipeline = MappingPipeline(read_detector(name, changes=self.given))

    @property
    def drive(self) -> Drive:
        """The usual drive."""
        return usual_drive()

    @cached_property
    def found(self) -> Detections:
        """Rows, poses and map of the usual drive."""
        return self.pipeline.run(self.drive)

    def result(self) -> Values:
        """Rows, poses and map of a fresh run."""
        return values_of(self.pipeline.run(self.drive))

    def input_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of the usual drive."""
        every: dict[str, NDArray[Any]] = {}
        for capture in self.drive.captures:
            parts = {**vars(capture), **vars(capture.trajectory)}
            every |= {f"{name} {capture.name}": v for name, v in parts.items() if isinstance(v, np.ndarray)}
        return every


def values_of(found: Detections) -> Values:
    """Columns of the rows, and arrays of poses and map."""
    assert found.mapped is not None  # noqa: S101 - of a mapper
    return {**of_detections(found), **of_mapped(found.mapped)}


def _streamed(subject: MappingSubject, cuts: Sequence[int]) -> Detections:
    """What the detector makes of the usual drive handed over in pieces."""
    drive, loop = subject.drive, subject.pipeline.open(subject.drive, keep=True)
    poses = [loop.step(drive.frames(start, stop)) for start, stop in pairwise([0, *cuts, len(drive)])]
    poses.append(loop.flush())
    smoothed, learnt = loop.finish()
    return loop.rows.annotated(mapped=Mapped(Poses.join(poses), learnt, smoothed), notes=loop.notes)


@check("uwbbench.config.detector")
def identity_is_stable(subject: MappingSubject) -> str:
    """Loading the file twice gives one identity, and its settings are plain JSON: runs are resumed by them."""
    again = MappingPipeline(read_detector(subject.name, changes=subject.given))
    if again.identity != subject.pipeline.identity:
        raise Nonconformity(f"identity {subject.pipeline.identity[:12]} again", again.identity[:12])
    json.dumps(subject.pipeline.config.to_dict(), allow_nan=False)
    return again.identity[:12]


@check(_MAPPING)
def stream_equals_batch(subject: MappingSubject) -> str:
    """Any cut of the frames into blocks gives the same bits and notes as the whole run at once."""
    for name, cuts in CUTS.items():
        found = _streamed(subject, cuts)
        same(subject.usual, values_of(found), f"in {name} what the whole run gives")
        if found.notes != subject.found.notes:
            raise Nonconformity(f"in {name} the notes {subject.found.notes}", str(found.notes))
    return f"{len(CUTS)} cuts"


@check(_MAPPING)
def true_poses_are_withheld(subject: MappingSubject) -> str:
    """True poses in another order, and no ground truth, change nothing: odometry is all that a mapper may know."""
    if is_bound(subject.pipeline.config):
        raise NotApplicable("it is a reference, which is shown the truth")

    def blinded(capture: Capture) -> Capture:
        track = capture.trajectory
        order = np.arange(len(track))[::-1]
        poses = Trajectory(track.timestamp_s, track.position_m[order] + 5.0, track.yaw_rad[order] - 1.0)
        return dataclasses.replace(capture, trajectory=poses, truth=None)

    drive = Drive("usual", tuple(map(blinded, subject.drive.captures)))
    same(subject.usual, values_of(subject.pipeline.run(drive)), "the same whatever the true poses are")
    return f"{len(subject.found.processed)} poses"


@check(_MAPPING)
def answer_moves_with_the_world(subject: MappingSubject) -> str:
    """A run whose truth and odometry are turned and shifted alike gives poses that are turned and shifted alike."""
    angle, shift_m = -1.1, np.array([-4.0, 2.5])

    def elsewhere(capture: Capture) -> Capture:
        track, odometry_m, odometry_rad = capture.trajectory, capture.odometry_position_m, capture.odometry_yaw_rad
        assert odometry_m is not None and odometry_rad is not None  # noqa: S101, PT018 - the usual drive has it
        true, drifted = (
            turned(np.column_stack([at[:, :2], yaw]), angle, shift_m)
            for at, yaw in ((track.position_m, track.yaw_rad), (odometry_m, odometry_rad))
        )
        flat = [np.column_stack([pose[:, :2], np.zeros(len(pose))]) for pose in (true, drifted)]
        truth = capture.truth
        if truth is not None:
            objects = [
                dataclasses.replace(one, outline_m=_turned_outline(one.outline_m, angle, shift_m))
                for one in truth.objects
            ]
            truth = dataclasses.replace(truth, objects=tuple(objects))
        return dataclasses.replace(
            capture,
            truth=truth,
            trajectory=Trajectory(track.timestamp_s, flat[0], true[:, 2]),
            odometry_position_m=flat[1],
            odometry_yaw_rad=drifted[:, 2],
        )

    found = subject.pipeline.run(Drive("usual", tuple(map(elsewhere, subject.drive.captures))))
    assert found.mapped is not None and subject.found.mapped is not None  # noqa: S101, PT018 - of a mapper
    worst = deviation(turned(subject.found.mapped.poses.pose, angle, shift_m), found.mapped.poses.pose)
    if worst > CLOSE:
        raise Nonconformity(f"poses moved alike, within {CLOSE:g}", f"off by {worst:.2g}")
    return f"within {worst:.1g}"


def _turned_outline(outline_m: NDArray[Any], angle: float, shift_m: NDArray[Any]) -> NDArray[Any]:
    flat = outline_m.reshape(-1, outline_m.shape[-1])
    there = turned(np.column_stack([flat[:, :2], np.zeros(len(flat))]), angle, shift_m)[:, :2]
    return np.column_stack([there, flat[:, 2:]]).reshape(outline_m.shape)


@check(_MAPPING)
def captures_without_odometry_are_refused(subject: MappingSubject) -> str:
    """A run without odometry is refused in one message that names the capture."""
    bare = dataclasses.replace(subject.drive.captures[0], odometry_position_m=None, odometry_yaw_rad=None)
    try:
        subject.pipeline.run(Drive("usual", (bare,)))
    except CaptureError as error:
        return str(error)
    raise Nonconformity("a refusal", "poses")


@check(_MAPPING)
def runs_share_nothing(subject: MappingSubject) -> None:
    """Two runs by turns give what each alone gives."""
    drive = subject.drive
    one, other = subject.pipeline.open(drive, keep=True), subject.pipeline.open(drive)
    poses = []
    for start, stop in pairwise([0, *CUTS["blocks of 7"], len(drive)]):
        poses.append(one.step(drive.frames(start, stop)))
        other.step(drive.frames(start, start + 2))
    poses.append(one.flush())
    smoothed, learnt = one.finish()
    found = one.rows.annotated(mapped=Mapped(Poses.join(poses), learnt, smoothed))
    same(subject.usual, values_of(found), "beside another run the same result")


@check("uwbbench.measure.latency")
def one_step_is_in_time(subject: MappingSubject) -> str:
    """A step takes less than the radar's frame period; ``uwbbench run`` measures properly."""
    drive = subject.drive
    own_s = call_s(subject.pipeline.open(drive).step, [drive.frames(row, row + 1) for row in range(CALLS)])
    period_s = 1 / drive.radar.frame_rate_hz
    if own_s > period_s:
        raise Nonconformity(f"a step within {period_s * 1e3:.1f} ms", f"{own_s * 1e3:.1f} ms")
    return f"{own_s * 1e6:.0f} us a step"


CHECKS = (
    file_says_what_it_is,
    identity_is_stable,
    stream_equals_batch,
    true_poses_are_withheld,
    answer_moves_with_the_world,
    captures_without_odometry_are_refused,
    runs_share_nothing,
    one_step_is_in_time,
)
