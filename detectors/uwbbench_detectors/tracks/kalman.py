"""Tracks of constant velocity through the ranges of detections."""

from __future__ import annotations

from operator import itemgetter
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from uwbbench.api import Block, Detections, Params, Radar, Stage, ports


class KalmanTrackParams(Params):
    """How objects move, how well ranges are measured, and when a track begins and ends."""

    acceleration_m_s2: float = Field(
        0.5, gt=0, description="Standard deviation of the object's acceleration, white from frame to frame."
    )
    range_sd_m: float = Field(0.045, gt=0, description="Standard deviation of a measured range.")
    start_rate_sd_m_s: float = Field(
        1.0, gt=0, description="Standard deviation of the range rate of a track that begins, whose mean is 0."
    )
    gate_sigmas: float = Field(
        3.0,
        gt=0,
        description="A detection belongs to a track only within this many standard deviations of the difference "
        "between detection and prediction.",
    )
    confirm: tuple[int, int] = Field(
        (3, 5),
        description="[m, n]: a track is confirmed by m detections within its first n frames. In frames, as it is the "
        "number of chances that keeps noise out.",
    )
    drop_s: float = Field(
        0.25,
        gt=0,
        description="A track ends when its last detection is older than this, at any frame rate. One frame "
        "may always pass without.",
    )
    tracks: Literal["one", "many"] = Field(
        "one",
        description="'one': at most one confirmed track at a time, and no other begins while it lives. 'many': a track "
        "from every detection that no track takes; echoes by way of walls move too, and become tracks.",
    )
    start: Literal["nearest", "strongest"] = Field(
        "nearest",
        description="Of the one track: which detection of a frame it may begin from, and which of several goes before "
        "that are confirmed in one frame.",
    )
    odometry: bool = Field(
        True,
        description="Where the capture has odometry, take the robot's own motion out of the prediction, in the "
        "direction of the track's last detection with an azimuth, else of the boresight.",
    )
    emit: Literal["confirmed", "all"] = Field(
        "confirmed", description="'all' gives out tentative tracks too, behind the others of a frame, as track -1."
    )

    @field_validator("confirm")
    @classmethod
    def _confirm_is_possible(cls, value: tuple[int, int]) -> tuple[int, int]:
        if not 1 <= value[0] <= value[1]:
            raise ValueError(f"[m, n] must be 1 <= m <= n: m detections within n frames, found {list(value)}")
        return value


class KalmanTrack(Stage[KalmanTrackParams]):
    """Ranges of moving objects by Kalman filters of constant velocity.

    The state is range and range rate; ``F = [[1, T], [0, 1]]``, ``Q = q^2 [[T^4/4, T^3/2], [T^3/2, T^2]]`` with the
    true time T between two frames, so that lost frames and other frame rates need no other settings. Detections go to
    tracks so that the sum of squared distances, in standard deviations, is least; first to confirmed tracks, what is
    left to tentative ones. Frames that are not valid, or all zero and without a
    detection, as those that were refused, count as time that has passed, and as nothing else.

    One row for each confirmed track in each valid frame: ``range_m`` as filtered, ``range_rate_m_s`` (how it changes,
    the robot's own motion included), ``range_sd_m``, the ``track`` number, which never returns, and ``amplitude`` (and
    ``score_db`` and ``azimuth_rad``, where there are any) of the detection that belongs to it. Where there is none the
    track is coasting, and these are NaN. A track is given out from the frame that confirms it: nothing is held back.

    What it is: the textbook's filter (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and
    Navigation, 2001). Behind a background and a CFAR it stands for the detector of Smeenk et al., of which no more is
    known than these three words; all numbers are chosen here.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "detections", "range_m", "amplitude")
    produces: ClassVar[frozenset[str]] = ports(
        "detections", "range_m", "amplitude", "track", "range_rate_m_s", "range_sd_m"
    )
    # A track has no tap: what is measured in a frame is smoothed over many.
    removes: ClassVar[frozenset[str]] = ports(
        "tap", "delay_s", "prominence", "width_taps", "pdoa_rad", "x_m", "y_m", "cluster"
    )
    fidelity = "reconstruction"

    def open(self, radar: Radar) -> None:
        """Start without tracks."""
        super().open(radar)
        from uwbbench_detectors.tracks import loops, state

        p = self.params
        self._follow = loops.follow
        self._tracks = np.zeros((8, state.FIELDS))
        self._carried = np.zeros(state.CARRIED)
        self._carried[state.TIME_S] = np.nan
        self._carried[state.BORESIGHT] = radar.mount_yaw_rad
        settings = {
            state.ACCELERATION: p.acceleration_m_s2,
            state.VARIANCE: p.range_sd_m**2,
            state.GATE: p.gate_sigmas**2,
            state.START_RATE_VARIANCE: p.start_rate_sd_m_s**2,
            state.HITS_ASKED: p.confirm[0],
            state.FRAMES_ALLOWED: p.confirm[1],
            state.LIVES_S: max(p.drop_s, 1.5 / radar.frame_rate_hz),
            state.ONE: p.tracks == "one",
            state.NEAREST: p.start == "nearest",
            state.EMITS_ALL: p.emit == "all",
            state.MOUNT_X_M: radar.mount_position_m[0],
            state.MOUNT_Y_M: radar.mount_position_m[1],
            state.MOUNT_YAW: radar.mount_yaw_rad,
        }
        self._settings = np.zeros(state.SETTINGS)
        self._settings[list(settings)] = list(settings.values())
        self._azimuth, self._counted, self._numbered = state.AZIMUTH, state.COUNT, state.NEXT
        self._moves = p.odometry
        self._seen = False
        self._given: frozenset[str] = frozenset()

    def step(self, block: Block) -> Block:
        """Block whose detections are tracks."""
        frames, rows = block.frames, block.detections
        columns, count = rows.columns, len(frames.timestamp_s)
        if columns.keys() != self._given:
            self._look_at(rows)
        self._seen |= count > 0
        place_m, yaw_rad = frames.odometry_position_m, frames.odometry_yaw_rad
        if not self._moves or place_m is None or yaw_rad is None:
            clock = np.empty((2, count))
        else:
            clock = np.empty((5, count))
            clock[2:4] = place_m[:, :2].T
            clock[4] = yaw_rad
        if count == 1:  # what a stream brings: numbers are set faster than rows of one number
            clock[0, 0], clock[1, 0] = frames.timestamp_s.item(), frames.valid.item()
        else:
            clock[0], clock[1] = frames.timestamp_s, frames.valid
        found = np.array(self._taken(columns))
        if count > 1 or not found.size:  # in a single frame with a detection somebody has looked
            looked = np.asarray(frames.preamble.any(axis=1))
            looked[block.rows] = True
            clock[1] *= looked
        if count > 1:
            found = found.take(np.argsort(found[0], kind="stable"), axis=1)
        room = int(self._carried.item(self._counted)) + found.shape[1]
        if room > len(self._tracks):  # each detection may begin a track
            self._tracks = np.concatenate([self._tracks, np.zeros((room, self._tracks.shape[1]))])
        table = self._follow(self._tracks, self._carried, clock, found, self._settings, frames.first)
        return block.replace(
            detections=Detections.of_table(self._names, table, (frames.first, frames.valid), rows.notes)
        )

    def flush(self) -> None:
        """Say so if nothing was tracked."""
        if self._seen and not self._carried[self._numbered]:
            hits, frames = self.params.confirm
            self.note(
                f"track.kalman: no track: nowhere did {hits} detections within {frames} frames lie near each other; "
                "behind a background of past frames nothing is left of what stands still"
            )

    def _look_at(self, rows: Detections) -> None:
        """Settle which columns tracks take over."""
        self._given = frozenset(rows.names)
        taken = ("amplitude", *(name for name in ("score_db", "azimuth_rad") if name in rows.names))
        read = ("frame", "range_m", *taken)
        self._taken = itemgetter(*read)
        self._names = ("track", "range_m", "range_rate_m_s", "range_sd_m", *taken)
        self._settings[self._azimuth] = read.index("azimuth_rad") if "azimuth_rad" in taken else -1
