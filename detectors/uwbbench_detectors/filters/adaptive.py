"""A threshold that follows the noise of each frame, what the robot's own floor is at each delay, and the distance."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    Block,
    BoolArray,
    ConfigError,
    Filter,
    FloatArray,
    Frames,
    IntArray,
    Params,
    Radar,
    ports,
)
from uwbbench_detectors.filters.false_alarms import prominence_factor, spread_factor
from uwbbench_detectors.peaks.noise import rayleigh_rms, rms

LEAST_HISTORY = 16
"""Frames from which on the floor at a delay is known well enough: at a rate of 1e-3 its spread costs 3 dB."""
MEDIAN_WORTH = math.log(2) ** 2
"""Taps of a mean square that one tap of a median is worth: its variance is ``1 / ln(2)^2`` as large."""
REACH_PULSES = 1.5
"""Pulse lengths from the crest of an echo to the end of its main lobe."""


class AdaptiveFilterParams(Params):
    """Rate, floor and law."""

    false_alarm_rate: float = Field(
        1e-3,
        gt=0,
        lt=0.1,
        description="Share of the taps of a profile of noise alone that hold a peak which passes. Of 46 taps one frame "
        "in 22 then has a false alarm.",
    )
    floor: Literal["noise", "measured"] = Field(
        "noise",
        description="'noise': the same at all delays, from the taps before any arrival. 'measured': at each delay "
        "behind the first path from earlier frames, which hold ringing of the robot and clutter that decays with the "
        "delay too; from the noise until the robot has moved far enough.",
    )
    noise_taps: int | None = Field(
        None,
        ge=1,
        description="Leading taps that the noise is measured on; null: the radar's noise_taps, and where it has none "
        "the median of all taps.",
    )
    history_frames: int = Field(
        64, ge=LEAST_HISTORY, le=1024, description="Measured: earlier frames that the floor is taken from."
    )
    spacing_m: float = Field(
        0.025,
        gt=0,
        description="Measured: way of the robot between two of those frames. Over 2.5 cm an echo from outside turns "
        "through a cycle, at 6 GHz and above, so that they differ in what is outside; a robot that stands learns "
        "nothing.",
    )
    least_echo_db: float | None = Field(
        None,
        description="Weakest echo of interest, as it would be at a range of 1 m, relative to the direct path; null: "
        "any that stands above the floor.",
    )
    spreading: Literal["mirror", "point"] = Field(
        "mirror",
        description="How that echo falls with the range R: 'mirror', a face of some wavelengths, in power as 1/R^2; "
        "'point' as 1/R^4.",
    )


class AdaptiveFilter(Filter[AdaptiveFilterParams]):
    """Keep peaks that noise makes no more often than a stated rate, wherever they are and however strong the radar is.

    A fixed threshold of prominence is relative to the direct path: the isolation of the antennas moves it, and as
    echoes fall with the distance it is too high far away; one of the score does not know how well four taps say what
    the noise is. Here the rate is stated, and the threshold follows.

    * Against the noise, with ``s^2`` the mean square of the leading taps, or by the median as in ``noise_floor``: the
      prominence, taken back from the scale of
      the profile to that of the samples, is at least ``sqrt(c) s``. The factor c is that of
      :func:`uwbbench_detectors.filters.false_alarms.prominence_factor`, with the spread of s and the extremes of
      the profile in it. A ripple of noise on the flank of a strong pulse has no more prominence than noise elsewhere.
    * Against a measured floor, with x and y the quartiles of the magnitudes of earlier frames at the same delay: the
      amplitude is at least ``x + q (y - x)``, with q of :func:`uwbbench_detectors.filters.false_alarms.spread_factor`.
      The rate holds at each delay, however the floor decays, where it is diffuse; ringing that is the same in all
      frames passes less often. As an echo reaches its crest at a delay when the robot has moved for half its length,
      the frames of the last ``1.5 c / (2 B)`` of way are left out, B the bandwidth: what arrives does not hide itself.
      What keeps its delay for more than a quarter of the history, such as a wall that the robot drives along, does.
    * Against the law of distance: ``A >= A_direct 10^(least_echo_db / 20) (1 m / R)^(1 or 2)``, with R half the way of
      the delay.

    Which of them hold is a choice; a peak passes all that are asked for, and each of them alone holds the rate. Put it
    where ``filter.prominence``, ``filter.width`` and ``filter.snr`` would be; the profile must be the magnitudes or
    a linear scale of them. Noise that a narrow receive filter correlates from tap to tap gives a higher rate.

    "Adaptive thresholds for peak properties" are future work of arXiv 2512.01018; this is one way to have them.

    Raises
    ------
    ConfigError
        From ``open``, if all taps of a frame are to be noise.
    """

    consumes: ClassVar[frozenset[str]] = ports(
        "frames", "profile", "first_path", "detections", "tap", "amplitude", "prominence"
    )
    rowwise: ClassVar[bool] = False
    fidelity = "reconstruction"

    def open(self, radar: Radar) -> None:
        """Start without a history."""
        super().open(radar)
        p = self.params
        self._noise_taps = p.noise_taps or radar.noise_taps
        if self._noise_taps >= radar.taps:
            raise ConfigError(
                f"filter.adaptive: the noise is measured on {self._noise_taps} leading taps of {radar.taps}, which "
                "leaves none; lower 'noise_taps'"
            )
        self._independent = self._noise_taps or MEDIAN_WORTH * radar.taps
        pulse_m = SPEED_OF_LIGHT_M_S / (2 * radar.bandwidth_hz)
        self._guard = math.ceil(REACH_PULSES * pulse_m / p.spacing_m)
        self._past: FloatArray = np.empty((p.history_frames + self._guard, radar.taps))
        self._seen = 0
        self._origin = 0
        self._at: tuple[float, float] | None = None
        self._floor: FloatArray | None = None

    def keep(self, block: Block) -> BoolArray:
        """Mask of the peaks above all thresholds."""
        found, row = block.detections, block.rows
        path = block.part("first_path")
        kept = self._above_floor(block, row, path)
        if self.params.least_echo_db is not None:
            kept &= found["amplitude"] >= self._least_echo(block, row, path)
        return kept

    def _above_floor(self, block: Block, row: IntArray, path: FloatArray) -> BoolArray:
        """Peaks (n,) above the noise, or above the floor that is known in their frame."""
        found = block.detections
        amplitude, leading = block.frames.amplitude, self._noise_taps
        noise = (rms(amplitude[:, :leading]) if leading else rayleigh_rms(amplitude))[row]
        if len(row) and not (noise > 0).all():
            self.note(
                "filter.adaptive: the noise is zero in some frames; no rate could be held there, and nothing passes"
            )
        taps = block.part("profile").shape[1]
        kept = np.zeros(len(row), bool)
        if len(row):
            factor = prominence_factor(self.params.false_alarm_rate, taps, self._independent)
            prominence = found["prominence"] * _scale(block)[row]
            kept = (noise > 0) & (prominence >= np.sqrt(factor) * noise)
        if self.params.floor == "noise":
            return kept
        tap = np.rint(found["tap"])
        for start, stop, floor in self._floors(block.frames, path):
            part = np.flatnonzero((row >= start) & (row < stop))
            if floor is not None and len(part):
                kept[part] = found["amplitude"][part] >= _read(floor, tap[part] - self._shift(path[row[part]]))
        return kept

    def _shift(self, path: FloatArray) -> FloatArray:
        """Taps (n,) by which frames lie later than the first one of the history."""
        return np.asarray(np.rint(path) - self._origin)

    def _floors(self, frames: Frames, path: FloatArray) -> list[tuple[int, int, FloatArray | None]]:
        """Stretches of frames, and the threshold (taps,) that earlier frames give them."""
        odometry = frames.odometry_position_m
        where = (frames.position_m if odometry is None else odometry)[:, :2].tolist()
        usable = (frames.valid & np.isfinite(path) & frames.amplitude.any(axis=1)).tolist()
        stretches: list[tuple[int, int, FloatArray | None]] = []
        start = 0
        for frame, (x, y) in enumerate(where):
            if not usable[frame]:
                continue
            if self._at is not None and not np.hypot(x - self._at[0], y - self._at[1]) >= self.params.spacing_m:
                continue
            stretches.append((start, frame + 1, self._floor))
            self._at, start = (x, y), frame + 1
            self._learn(frames.amplitude[frame], float(path[frame]))
        return [*stretches, (start, len(where), self._floor)]

    def _learn(self, amplitude: FloatArray, path: float) -> None:
        """Take a frame into the history."""
        if not self._seen:
            self._origin = round(path)
        p = self.params
        place: FloatArray = np.arange(len(amplitude)) + self._shift(np.array([path]))
        self._past[self._seen % len(self._past)] = _read(amplitude, place)
        self._seen += 1
        known = min(self._seen - self._guard, p.history_frames) // 4 * 4  # quartiles are values, and factors are few
        if known < LEAST_HISTORY:
            return
        older = self._past[np.arange(self._seen - self._guard - known, self._seen - self._guard) % len(self._past)]
        lower, upper = known // 4, 3 * known // 4
        ordered = np.partition(older, (lower - 1, upper - 1), axis=0)
        low, high = ordered[lower - 1], ordered[upper - 1]
        with np.errstate(invalid="ignore"):
            floor = low + spread_factor(p.false_alarm_rate, known, lower, upper) * (high - low)
        self._floor = np.where(np.isfinite(floor), floor, np.inf)

    def _least_echo(self, block: Block, row: IntArray, path: FloatArray) -> FloatArray:
        """Amplitude (n,) of the weakest echo of interest at the delay of each peak."""
        crest = np.rint(path)
        inside = (crest >= 0) & (crest < block.frames.taps)
        at = np.where(inside, crest, 0).astype(np.int64)
        direct = np.where(inside, block.frames.amplitude[np.arange(len(at)), at], np.nan)
        range_m = (block.detections["tap"] - path[row]) * self.radar.sample_interval_s * SPEED_OF_LIGHT_M_S / 2
        power = 1 if self.params.spreading == "mirror" else 2
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = np.where(range_m > 0, range_m, np.nan) ** -power
        return np.asarray(direct[row] * 10 ** ((self.params.least_echo_db or 0.0) / 20) * spread)


def _read(values: FloatArray, place: FloatArray) -> FloatArray:
    """Values at places (n,), infinite outside: no rate is known there, and nothing passes."""
    inside = (place >= 0) & (place < len(values))
    return np.where(inside, values[np.where(inside, place, 0).astype(np.int64)], np.inf)


def _scale(block: Block) -> FloatArray:
    """Magnitude (frames,) that is one unit of the profile."""
    profile = block.part("profile")
    magnitude = block.frames.amplitude[:, block.profile_start :]
    frame = np.arange(len(profile))
    low, high = profile.argmin(axis=1), profile.argmax(axis=1)
    rise = profile[frame, high] - profile[frame, low]
    span = magnitude[frame, high] - magnitude[frame, low]
    return np.asarray(np.divide(span, rise, out=np.full(len(profile), np.nan), where=rise > 0))
