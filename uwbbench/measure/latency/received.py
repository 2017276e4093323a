"""Frames as a radio hands them over: raw samples that lie in memory, and nothing made of them yet.

What a robot pays for a frame begins here. ``capture.frames(i, i + 1)`` of such a capture does what a driver must do for
each frame: put its samples beside its pose, look whether they are finite, and make their analytic signal where the
radio gives real ones.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from uwbbench.api.capture import PER_FRAME, Capture
from uwbbench.api.drive import Drive
from uwbbench.api.truth import Trajectory
from uwbbench.measure.latency.played import Played

_SAMPLES = ("preamble", "sts1", "sts2")


def received_run(drive: Drive, steps: int | None = None) -> Drive:
    """First steps of a run, as :func:`received` gives the frames of a capture."""
    stop = len(drive) if steps is None else min(steps, len(drive))
    counts = {name: int(np.searchsorted(numbers, stop)) for name, numbers in drive.steps.items()}
    parts = [received(capture, counts[capture.radar.receiver]) for capture in drive.captures]
    return Drive(drive.name, tuple(parts))


def received(capture: Capture, frames: int | None = None) -> Capture:
    """First frames of a capture, their raw samples in memory; without truth, which no radio hands over.

    Parameters
    ----------
    capture : Capture
        From a file or from anywhere; detectors are opened on this one.
    frames : int, optional
        At most so many; all by default.
    """
    count = len(capture) if frames is None else min(frames, len(capture))
    capture.frames(0, count)  # a damaged file is named here
    parts: dict[str, Any] = {name: _copied(getattr(capture, name), count) for name in _SAMPLES if _has(capture, name)}
    parts |= {name: getattr(capture, name)[:count] for name in PER_FRAME if _has(capture, name)}
    if capture.anchors is not None:
        parts["anchors"] = capture.anchors.of_frames(np.arange(count))
    track = capture.trajectory
    poses = Trajectory(track.timestamp_s[:count], track.position_m[:count], track.yaw_rad[:count])
    return dataclasses.replace(capture, truth=None, trajectory=poses, **parts)


def _copied(samples: Any, count: int) -> Any:
    """Samples as they are stored, but in memory, in one piece and in the byte order of this machine."""
    rows = np.asarray(samples[:count])
    return np.array(rows, dtype=rows.dtype.newbyteorder("="), order="C")


def _has(capture: Capture, name: str) -> bool:
    return getattr(capture, name) is not None


def laps(capture: Played, frames: int, *, renumbered: bool = True) -> tuple[Played, list[int]]:
    """Received frames handed over again and again, with numbers and times that go on.

    A run is handed over once: a robot that is back at its start of a sudden is another problem.

    A stream then sees one long recording, in which the robot is back at its start now and then. A detector that looks
    up the truth must get the old numbers again, which alone have one: not ``renumbered``.

    Parameters
    ----------
    capture : Capture or Drive
        Received, of one frame or more.
    frames : int
        So many in all.
    renumbered : bool
        Go on counting frames; otherwise numbers and times start again with each lap.

    Returns
    -------
    source : Capture or Drive
        To take frames from, one by one.
    numbers : list of int
        Those that it has, in order.
    """
    if not isinstance(capture, Capture):
        return capture, list(range(min(frames, len(capture))))
    if renumbered:
        return _again(capture, frames), list(range(frames))
    return capture, [number % len(capture) for number in range(frames)]


def _again(capture: Capture, frames: int) -> Capture:
    parts: dict[str, Any] = {name: _Again(getattr(capture, name), frames) for name in _SAMPLES if _has(capture, name)}
    lap, place = np.divmod(np.arange(frames), len(capture))
    parts |= {name: getattr(capture, name)[place] for name in PER_FRAME if _has(capture, name)}
    if capture.anchors is not None:
        parts["anchors"] = capture.anchors.of_frames(place)
    track = capture.trajectory
    lap_s = float(track.timestamp_s[-1] - track.timestamp_s[0]) + 1 / capture.radar.frame_rate_hz
    poses = Trajectory(track.timestamp_s[place] + lap * lap_s, track.position_m[place], track.yaw_rad[place])
    return dataclasses.replace(capture, truth=None, trajectory=poses, **parts)


class _Again:
    """Rows of samples repeated without end, of which single ones are taken."""

    def __init__(self, rows: Any, frames: int) -> None:
        self._rows, self._period = rows, len(rows)
        self.shape = (frames, *rows.shape[1:])

    def __getitem__(self, key: slice) -> Any:
        start = key.start % self._period
        return self._rows[start : start + 1]
