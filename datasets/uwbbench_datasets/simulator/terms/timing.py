"""Frames that do not arrive, arrive twice or arrive late.

These terms change the finished recording. They belong at the end of a scene's list, behind whatever reports something
for each frame.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from pydantic import Field

from uwbbench.api import BoolArray, Capture, FloatArray, IntArray, Params, Term, Trajectory, Truth

_PER_FRAME = (
    "preamble",
    "sts1",
    "sts2",
    "first_path_index",
    "first_path_index_sts1",
    "first_path_index_sts2",
    "odometry_position_m",
    "odometry_yaw_rad",
)


def taken(capture: Capture, frame: IntArray | BoolArray) -> Capture:
    """Capture of the given frames only: samples, times, poses, messages and moving outlines stay together.

    A frame that is delivered twice brings the messages of anchors once.
    """
    parts: dict[str, Any] = {
        name: getattr(capture, name)[frame] for name in _PER_FRAME if getattr(capture, name) is not None
    }
    if capture.anchors is not None:
        source = np.arange(len(capture))[frame]
        parts["anchors"] = capture.anchors.of_frames(np.where(np.diff(source, prepend=-1) > 0, source, -1))
    track = capture.trajectory
    truth = capture.truth and Truth(
        tuple(
            dataclasses.replace(obstacle, outline_m=obstacle.outline_m[frame]) if obstacle.moves else obstacle
            for obstacle in capture.truth.objects
        ),
        capture.truth.exhaustive,
    )
    trajectory = Trajectory(track.timestamp_s[frame], track.position_m[frame], track.yaw_rad[frame])
    return dataclasses.replace(capture, trajectory=trajectory, truth=truth, **parts)


class LostParams(Params):
    """How many frames get lost."""

    share: float = Field(0.01, ge=0, lt=1, description="Part of the frames that is lost, in the long run.")
    burst: float = Field(1.0, ge=1, description="Mean number of frames that are lost in a row.")


class LostFrames(Term[LostParams]):
    """Frames that never arrive, one by one or in bursts (Gilbert's two-state channel); one frame always does.

    Losses last a geometric number of frames. The others keep their times, poses and truth.
    """

    def record(self, capture: Capture, rng: np.random.Generator) -> Capture:
        """Leave frames out."""
        kept = ~self._lost(len(capture), rng)
        if not kept.any():
            kept[0] = True
        return taken(capture, kept)

    def _lost(self, frames: int, rng: np.random.Generator) -> BoolArray:
        """Which frames are lost: runs of kept and lost frames in turn, of geometric lengths."""
        p = self.params
        if p.share == 0:
            return np.zeros(frames, bool)
        end = 1 / p.burst
        begin = max(end * p.share / (1 - p.share), float(np.finfo(float).tiny))
        if begin >= 1:  # more is lost than bursts of this length can: every kept frame stands alone
            begin, end = 1.0, (1 - p.share) / p.share
        lost_first = bool(rng.random() < p.share)
        runs: IntArray = np.zeros(0, np.int64)
        while runs.sum() < frames:
            # Rare losses are so far apart that sums of their distances would overflow: the recording's length will do.
            pair = np.stack([np.minimum(rng.geometric(one, frames // 8 + 8), frames) for one in (begin, end)], axis=1)
            runs = np.concatenate([runs, (pair[:, ::-1] if lost_first else pair).ravel()])
        runs = runs[: int(np.searchsorted(np.cumsum(runs), frames)) + 1]
        return np.repeat((np.arange(len(runs)) % 2 == 0) == lost_first, runs)[:frames]


class DuplicatedParams(Params):
    """How many frames arrive twice."""

    share: float = Field(0.01, ge=0, le=1, description="Probability that a frame is delivered once more.")


class DuplicatedFrames(Term[DuplicatedParams]):
    """Frames that arrive twice in a row, with the same time, pose and samples."""

    def record(self, capture: Capture, rng: np.random.Generator) -> Capture:
        """Repeat frames."""
        again = rng.random(len(capture)) < self.params.share
        return taken(capture, np.repeat(np.arange(len(capture)), 1 + again))


class LateParams(Params):
    """How frames are delayed."""

    share: float = Field(0.01, ge=0, le=1, description="Probability that a frame is held up.")
    delay_ms: float = Field(50.0, gt=0, description="Mean of the delay, which is exponential.")


class LateFrames(Term[LateParams]):
    """Frames held up on their way to the host: times are those of arrival, and frames wait for those before them.

    Poses and truth stay those of the moment when a frame was taken, and so does odometry: receivers of one run whose
    frames are held up by different times contradict each other about where the robot was, and are refused as a run.
    """

    def record(self, capture: Capture, rng: np.random.Generator) -> Capture:
        """Replace the times."""
        frames = len(capture)
        held: FloatArray = rng.exponential(self.params.delay_ms * 1e-3, frames)
        held = np.where(rng.random(frames) < self.params.share, held, 0.0)
        track = capture.trajectory
        arrival = np.maximum.accumulate(track.timestamp_s + held)
        return dataclasses.replace(capture, trajectory=dataclasses.replace(track, timestamp_s=arrival))
