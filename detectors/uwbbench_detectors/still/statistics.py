"""Mean and standard deviation of aligned magnitudes over windows of frames.

References
----------
B. Van Herbruggen, S. Luchie, R. Berkvens, J. Fontaine, E. De Poorter, Impact of CIR processing for UWB radar distance
estimation with the DW1000 transceiver, IPIN 2023, doi 10.1109/IPIN57070.2023.10332499: which frames are left out, and
windows of some 5 s, as a public re-implementation and a later paper quote it. That windows follow each other without
overlap, and what is done about a robot that moves, is chosen here.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import (
    Block,
    BoolArray,
    ConfigError,
    FloatArray,
    Frames,
    IntArray,
    Params,
    Radar,
    Stage,
    WindowProfile,
    ports,
    receiver_pose,
)

NO_WINDOW = -1
LEAST_SHARE = 0.5
"""Share of its frames that a window must have, and that must be fit for use."""


class StatisticParams(Params):
    """The windows, and which of their frames count."""

    window_s: float = Field(
        5.0,
        gt=0,
        description="Length of a window. Windows follow each other without overlap; the last one of a capture may be "
        "shorter, down to a half; fewer frames get no answer.",
    )
    first_path_taps: float = Field(
        10.0, gt=0, description="Frames whose first path is farther from the median of the window are left out."
    )
    power_db: float = Field(
        3.0, gt=0, description="Frames whose power is farther from the median of the window are left out."
    )
    movement_m: float = Field(
        0.01,
        ge=0,
        description="A window in which odometry moves an antenna farther than this from where it began gives nothing.",
    )


class Statistic(Stage[StatisticParams]):
    """A statistic of each bin over the frames of a window, which holds for all frames that it is made of.

    A window begins where the one before it ends, and its frames are held back until it is full. They are then taken
    together in two passes, which loses no digits and does not hang on how the frames came. Frames without a direct
    path, or whose first path or power is far from the window's median, are left out. Empty bins between filled ones are
    interpolated in straight lines, unless more of them are empty than the alignment allows.

    Raises
    ------
    ConfigError
        From ``open``, if a window is shorter than two frames.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path", "aligned")
    fidelity = "reconstruction"

    name: ClassVar[str]

    @property
    def whole_windows(self) -> bool:
        """Always."""
        return True

    def open(self, radar: Radar) -> None:
        """Start an empty window."""
        super().open(radar)
        self._length = round(self.params.window_s * radar.frame_rate_hz)
        if self._length < 2:
            raise ConfigError(
                f"{self.name}: window_s is {self.params.window_s:g}, less than two frames at "
                f"{radar.frame_rate_hz:g} a second; a statistic needs more"
            )
        self._held: list[Block] = []
        self._count = 0
        self._any_full = False

    def step(self, block: Block) -> Block:
        """Block with the frames of the windows that are full."""
        self._held.append(block)
        self._count += len(block.frames)
        full = self._count - self._count % self._length
        if not full:
            return self._with_windows(block.cut(0, 0))
        self._any_full = True
        joined = Block.join(self._held)
        self._held, self._count = [joined.cut(full, self._count)], self._count - full
        return self._with_windows(joined.cut(0, full))

    def flush(self) -> Block | None:
        """Block with the frames of the last window, which may be shorter."""
        if not self._count:
            return None
        rest = Block.join(self._held)
        self._held, self._count = [], 0
        return self._with_windows(rest)

    def parts(self, profiles: dict[str, WindowProfile]) -> dict[str, WindowProfile]:
        """Those of the profiles that this stage makes, by port."""
        raise NotImplementedError

    def _with_windows(self, block: Block) -> Block:
        """Block of whole windows with what each amounts to."""
        aligned, frames = block.aligned_profile, len(block.frames)
        starts = range(0, frames, self._length)
        row = np.full(frames, NO_WINDOW)
        found: list[tuple[FloatArray, FloatArray, IntArray]] = []
        stops: list[int] = []
        refused: list[str] = []
        for start in starts:
            stop = min(start + self._length, frames)
            window = self._window(block.cut(start, stop))
            if window is None:
                continue
            if isinstance(window, str):
                refused.append(window)
                self.note(f"{self.name}: {window}")
                continue
            usable, statistic = window
            row[start:stop][usable] = len(found)
            found.append(statistic)
            stops.append(block.frames.first + stop)
        shape = (0, aligned.bins.count)
        mean, sd, count = (np.stack(part) for part in zip(*found, strict=True)) if found else (np.empty(shape),) * 3
        counts, behind = count.astype(np.int64), np.array(stops, np.int64)
        reasons = tuple(dict.fromkeys(refused))
        profiles = {
            port: WindowProfile(aligned.bins, row, behind, value, counts, reasons)
            for port, value in (("window_mean", mean), ("window_sd", sd))
        }
        return block.replace(**self.parts(profiles))

    def _window(self, block: Block) -> tuple[BoolArray, tuple[FloatArray, FloatArray, IntArray]] | str | None:
        """Frames that one window is made of, with mean, standard deviation and count (bins,); or why not."""
        p, aligned, frames = self.params, block.aligned_profile, len(block.frames)
        if frames < LEAST_SHARE * self._length:
            if self._any_full:  # what is left of a capture at its end
                return None
            return (
                f"no answer for a capture of {frames} frames, less than half a window of {p.window_s:g} s; use a "
                "longer capture or a shorter window_s"
            )
        if self._moves(block.frames):
            return (
                f"no answer where odometry moves more than {p.movement_m * 100:g} cm within a window: this is for a "
                "robot that stands still"
            )
        usable = self._usable(block)
        if np.count_nonzero(usable) < max(LEAST_SHARE * frames, 2):
            return (
                "no answer for a window in which fewer than half of the frames have a direct path with first path and "
                "power near the median"
            )
        mean, sd, count = moments(aligned.magnitude[usable])
        filled = count > 0
        reached = np.flatnonzero(filled)
        share = float(np.mean(filled[reached[0] : reached[-1] + 1]))
        if share < aligned.minimum_filled:
            return (
                f"no answer for a window whose bins are not filled: {share:.0%} of them instead of "
                f"{aligned.minimum_filled:.0%}, as the first paths of its frames have too few different fractions of a "
                "tap"
            )
        counts = np.floor(_between(count, filled)).astype(np.int64)
        return usable, (_between(mean, filled), _between(sd, count > 1), counts)

    def _moves(self, frames: Frames) -> bool:
        """Whether odometry moves one of the two antennas away from where it was at the start of the window."""
        position_m, yaw_rad = frames.odometry_position_m, frames.odometry_yaw_rad
        if position_m is None or yaw_rad is None:
            self.note(f"{self.name}: the capture has no odometry; that the robot stands still is not checked")
            return False
        farthest = 0.0
        for mount_m in (self.radar.mount_position_m, self.radar.tx_position_m):
            place_m, _ = receiver_pose(position_m, yaw_rad, np.asarray(mount_m), 0.0)
            farthest = max(farthest, float(np.linalg.norm(place_m - place_m[0], axis=1).max()))
        return farthest > self.params.movement_m

    def _usable(self, block: Block) -> BoolArray:
        """Frames (frames,) that have a direct path, and a first path and a power near the medians of those."""
        magnitude, first_path = block.aligned_profile.magnitude, block.part("first_path")
        known = np.isfinite(magnitude)
        usable = known.any(axis=1) & block.frames.valid
        if not usable.any():
            return usable
        power = np.sum(np.where(known, magnitude, 0.0) ** 2, axis=1) / np.maximum(known.sum(axis=1), 1)
        with np.errstate(divide="ignore"):
            power_db = 10 * np.log10(power)
        near = usable.copy()
        for values, most in ((first_path, self.params.first_path_taps), (power_db, self.params.power_db)):
            near[usable] &= np.abs(values[usable] - np.median(values[usable])) <= most
        if not near[usable].all():
            self.note(f"{self.name}: frames whose first path or power is far from their window's median are left out")
        return near


def moments(values: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Mean, sample standard deviation and count (bins,) of the values (frames, bins) that are numbers, in two passes.

    The standard deviation is NaN where there are fewer than two, the mean where there are none.
    """
    known = np.isfinite(values)
    count = known.sum(axis=0)
    total = np.where(known, values, 0.0).sum(axis=0)
    mean = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
    squares = np.sum(np.where(known, values - mean, 0.0) ** 2, axis=0)
    variance = np.divide(squares, count - 1, out=np.full(len(count), np.nan), where=count > 1)
    return mean, np.sqrt(variance), count


def _between(values: FloatArray | IntArray, filled: BoolArray) -> FloatArray:
    """Values (bins,), interpolated where bins between filled ones are not; NaN or 0 outside them."""
    place = np.flatnonzero(filled)
    if len(place) in (0, len(filled)):
        return np.asarray(values, np.float64)
    inner = slice(place[0], place[-1] + 1)
    whole = np.array(values, np.float64)
    whole[inner] = np.interp(np.arange(place[0], place[-1] + 1), place, whole[place])
    return whole


class MeanStatistic(Statistic):
    """Mean magnitude of each bin over a window."""

    name = "statistic.mean"
    produces: ClassVar[frozenset[str]] = ports("window_mean")

    def parts(self, profiles: dict[str, WindowProfile]) -> dict[str, WindowProfile]:
        """The mean."""
        return {"window_mean": profiles["window_mean"]}


class DeviationStatistic(Statistic):
    """Standard deviation of the magnitude of each bin over a window, and its mean.

    What moves by parts of the wavelength, such as the chest of a person who breathes, changes the magnitude from frame
    to frame; what stands still hardly does.
    """

    name = "statistic.sd"
    produces: ClassVar[frozenset[str]] = ports("window_mean", "window_sd")

    def parts(self, profiles: dict[str, WindowProfile]) -> dict[str, WindowProfile]:
        """Both."""
        return profiles
