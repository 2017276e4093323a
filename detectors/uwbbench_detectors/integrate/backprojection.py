"""Evidence for fixed objects, added up in the world along the way of the robot."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    Block,
    BoolArray,
    ConfigError,
    Detections,
    FloatArray,
    IntArray,
    Params,
    Radar,
    Stage,
    ports,
    receiver_pose,
    rotate_z,
    wrap_angle,
)
from uwbbench_detectors.integrate.motion import MotionParams, places_m

LOOKS_PER_WAVELENGTH = 8
SEARCH_EVERY = 4
"""Looks from one search of the map to the next."""
HISTORY = 256
"""Looks that side lobes are worked out for, every second one."""


MOST_STRETCHES = 256
MOST_FLOODS = 8
"""Looks that may be passed over in a row because they are flooded; a level that stays is the level."""


class BackprojectionParams(MotionParams):
    """What is looked for, how well the way is known, and when a crest of the map is an object."""

    nearest_m: float = Field(0.3, ge=0, description="Least range of a cell from the receiver.")
    farthest_m: float | None = Field(
        None, gt=0, description="Largest range of a cell; null: as far as the taps reach. The map is twice as wide."
    )
    field_of_view_deg: float | None = Field(
        None,
        gt=0,
        le=360,
        description="Cells farther than half of this from boresight are not looked at; null: 90 of a radar with two "
        "antennas, whose angle is good within that, else 180.",
    )
    object_size_m: float = Field(
        0.5,
        gt=0,
        description="Width d of an object, which keeps its phase while it is seen from within lambda / (2 d): the "
        "coherent stretch of the way is range times this, 0.6 m at 8 m and 4 GHz.",
    )
    drift: float = Field(
        0.01,
        gt=0,
        lt=1,
        description="Error of the way as a share of it. The coherent stretch ends where it is lambda / 8, and evidence "
        "is forgotten over the way in which it grows to a cell of the map.",
    )
    aspect_deg: float = Field(
        30.0,
        gt=0,
        description="An object is one face within this angle: evidence is forgotten over the way that turns it so far.",
    )
    second: bool = Field(False, description="Add STS2, of the other antenna, in phase with the first. Needs STS.")
    false_alarm_rate: float = Field(
        1e-6, gt=0, lt=1, description="Probability that noise alone makes a cell of the map as high as the threshold."
    )
    level_pulses: float = Field(
        6.0,
        gt=0,
        description="The level of noise and clutter is taken from so many lengths of the pulse to both sides, and from "
        "the way so far.",
    )
    sidelobe_margin_db: float = Field(
        3.0, ge=0, description="A crest so far above the side lobe that a stronger object has there is an object."
    )
    most: int = Field(16, ge=1, le=48, description="Objects given out in a frame, at most; strongest first.")
    smoothed: bool = Field(
        False,
        description="Give all frames out at the end, with the objects of the whole way. Else each frame gets what was "
        "known when it came.",
    )


class Backprojection(Stage[BackprojectionParams]):
    r"""Fixed objects as crests of a map of evidence, which frames are back-projected into along the way.

    The map is a grid of the plane around the receiver, of cells of ``c / (4 B)``. For a point object at the cell p an
    aligned frame taken at x holds ``a exp(-2 pi i f d / c)`` at the delay ``d / c`` of the path
    ``d = |p - x_tx| + |p - x_rx|``. Along a *stretch* of the way, over which object and odometry keep their phase, N
    looks are therefore added up as

        ``S_p = sum z(d / c) exp(2 pi i f d / c)``, ``E_p = |S_p|^2 / N - 1``,

    in units of the noise: 0 on average in noise alone, N times the signal-to-noise ratio of a look for an object there,
    and less everywhere else. The evidence of a cell is the sum over its stretches, in which power alone counts. A
    stretch is as long as an object of the width d keeps its phase, ``R lambda / (2 d)`` at the range R (its angular
    pattern is lambda / (2 d) wide), at most as odometry does, ``lambda / (8 drift)``. It also ends where the next look
    is more than ``lambda / 4`` away, since directions would alias: frames that lie farther apart, such as stops a foot
    from each other, are added up by their power alone.

    A look is a frame taken ``lambda / 8`` or more behind the one before. A robot that stands adds nothing, whatever it
    records; its rows are those of the objects located so far, as the map has them. Fixed objects, moving radar: an
    object that moves does not add up.

    In noise alone the sum of n stretches is Gamma distributed, from which the threshold of the evidence follows
    (:func:`thresholds`). Local maxima above that are crests. A crest is an object only if no stronger object lies
    within the width of an object, and if it stands above what the responses of the stronger ones may be at its place,
    worked out from the looks themselves. This takes away the rings through an object that is seen from one side alone,
    its mirror image beyond a straight way, and the side lobes in range and angle.

    One row for each object in view of a frame: ``range_m`` and ``azimuth_rad`` from its receiver, ``x_m`` and ``y_m``,
    ``amplitude``, the square root of the evidence, and ``score_db``, the evidence in dB. Places lie between cells, by
    parabolas through logarithms. Heights are not known: along a straight way distances from it are slant distances,
    and ranges exact; after a turn an object h higher than the radar lies ``h^2 / (2 R)`` too far.

    Frames must be coherent from one to the next, and without what the robot sees of itself: ``align.template`` and
    ``clutter.robot_template`` before this stage do that. Of a straight way, both sides look alike; only the field of
    view and a turn tell them apart.

    References
    ----------
    Back-projection: Cumming and Wong, Digital Processing of Synthetic Aperture Radar Data, 2005.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path")
    produces: ClassVar[frozenset[str]] = ports(
        "detections", "range_m", "azimuth_rad", "amplitude", "score_db", "x_m", "y_m"
    )
    # Rows may come out at the end, so nothing that counts frames can follow.
    removes: ClassVar[frozenset[str]] = ports("frames", "first_path", "noise", "profile")

    @property
    def whole_windows(self) -> bool:
        """Whether an answer hangs on frames behind it."""
        return self.params.smoothed

    @classmethod
    def needs_with(cls, params: Params) -> frozenset[str]:
        """STS where the second antenna is asked for."""
        return ports("sts") if isinstance(params, BackprojectionParams) and params.second else ports()

    def open(self, radar: Radar) -> None:
        """Start with an empty map.

        Raises
        ------
        ConfigError
            If the farthest range is not beyond the nearest.
        """
        super().open(radar)
        from uwbbench_detectors.integrate import backprojection_loops as loops

        p = self.params
        farthest_m = min(p.farthest_m or math.inf, radar.window_m)
        if farthest_m <= p.nearest_m:
            raise ConfigError(
                f"integrate.backprojection: nearest_m is {p.nearest_m:g}, but the map ends at {farthest_m:g} m"
            )
        wave_m, cell_m = radar.wavelength_m, SPEED_OF_LIGHT_M_S / (4 * radar.bandwidth_hz)
        view_deg = p.field_of_view_deg or (90.0 if radar.has_sts else 180.0)
        settings = {
            loops.CELL_M: cell_m,
            loops.TAPS_PER_M: 1 / (SPEED_OF_LIGHT_M_S * radar.sample_interval_s),
            loops.TURN_PER_M: 2 * np.pi / wave_m,
            loops.NEAREST_M: p.nearest_m,
            loops.FARTHEST_M: farthest_m,
            loops.VIEW: math.cos(math.radians(view_deg / 2)),
            loops.LONGEST_M: wave_m / (8 * p.drift),
            loops.STRETCH_PER_M: wave_m / (2 * p.object_size_m),
            loops.FORGET_M: cell_m / p.drift,
            loops.FORGET_PER_M: math.radians(p.aspect_deg),
            loops.ARRAY_RAD: 2 * np.pi * (radar.array_spacing_m or 0.0) / wave_m if p.second else 0.0,
            loops.DIRECT_SINE: radar.baseline_m[1] / radar.baseline_length_m if radar.baseline_length_m > 0 else 0.0,
            loops.WIDE_M: p.object_size_m,
            loops.BAND_PER_M: radar.bandwidth_hz / SPEED_OF_LIGHT_M_S,
            loops.NOISE: -math.log(p.false_alarm_rate),
            loops.MARGIN: 10 ** (p.sidelobe_margin_db / 10),
        }
        self._loops = loops
        self._at: FloatArray = np.zeros(loops.SETTINGS)
        self._at[list(settings)] = list(settings.values())
        size = 2 * math.ceil(farthest_m / cell_m) + 4
        # Forgetting leaves a cell no more stretches than fit into the way that it remembers.
        self._thresholds = thresholds(p.false_alarm_rate, MOST_STRETCHES)
        self._cells: FloatArray = np.zeros((size, size, loops.FIELDS))
        self._owner = np.full((2, size), np.iinfo(np.int64).min)
        self._log_levels: FloatArray = np.full((2, radar.taps), np.nan)
        self._ceilings: FloatArray = np.full((2, radar.taps), np.inf)
        self._floods = 0
        self._reach = math.ceil(1 / (radar.bandwidth_hz * radar.sample_interval_s))
        self._half = round(p.level_pulses / (radar.bandwidth_hz * radar.sample_interval_s))
        self._step_m = wave_m / LOOKS_PER_WAVELENGTH
        self._origin_m: FloatArray | None = None
        self._last_m: FloatArray = np.full(2, np.nan)
        self._way_m, self._count = 0.0, 0
        self._history: FloatArray = np.zeros((0, loops.LOOK))
        self._objects: FloatArray = np.zeros((0, 3))
        self._waiting: list[tuple[FloatArray, FloatArray]] = []
        self._last: Block | None = None
        turn = radar.center_frequency_hz * radar.sample_interval_s if radar.samples == "rf" else 0.0
        self._to_baseband = np.exp(-2j * np.pi * turn * np.arange(radar.taps))

    def step(self, block: Block) -> Block:
        """Block with the objects in view of each frame; without rows where they come out at the end."""
        frames = block.frames
        self._last = block.cut(len(frames), len(frames))
        second = frames.sts2 if self.params.second else None
        looks, boresight_rad, usable = self._looks_of(block)
        known = []
        for row in np.flatnonzero(usable):
            self._take(frames.preamble[row], None if second is None else second[row], looks[row])
            known.append(self._objects)
        poses = np.column_stack([frames.index, boresight_rad])[usable]
        if self.params.smoothed:
            self._waiting.append((poses, looks[usable]))
            known, poses, looks = [], poses[:0], looks[:0]
        else:
            looks = looks[usable]
        return block.replace(detections=self._rows(poses, looks, known, frames.index[frames.valid]))

    def flush(self) -> Block | None:
        """All frames, with the objects of the whole way, where they were held back."""
        if self._last is None:
            return None
        if not self._count:
            self.note(
                "integrate.backprojection: no objects, as the radar did not move, or its frames hold nothing behind "
                "the clutter removal"
            )
        if not self.params.smoothed:
            return None
        poses = np.concatenate([each for each, _ in self._waiting])
        looks = np.concatenate([each for _, each in self._waiting])
        self._search(None)
        rows = self._rows(poses, looks, [self._objects] * len(poses), self._last.frames.index)
        return self._last.replace(detections=rows)

    def evidence(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Map as it is: x (n,) and y (n,) of its columns and rows in the world, and evidence (n, n), row by row."""
        loops, cells = self._loops, self._cells
        power = cells[..., loops.REAL] ** 2 + cells[..., loops.IMAGINARY] ** 2
        running = np.where(cells[..., loops.LOOKS] > 0, power / np.maximum(cells[..., loops.LOOKS], 1) - 1, 0.0)
        closed = cells[..., loops.CLOSED] - cells[..., loops.STRETCHES]
        order = np.argsort(self._owner, axis=1)
        origin_m = np.zeros(2) if self._origin_m is None else self._origin_m
        x_m, y_m = (np.sort(self._owner, axis=1) + 0.5) * self._at[loops.CELL_M] + origin_m[:, None]
        return x_m, y_m, (running + closed)[order[1]][:, order[0]]

    def _looks_of(self, block: Block) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Looks (frames, LOOK), headings of boresight (frames,), and which frames can be used."""
        loops, radar, frames = self._loops, self.radar, block.frames
        place_m, yaw_rad = places_m(self, frames)
        receiver_m, boresight_rad = receiver_pose(
            place_m, yaw_rad, np.asarray(radar.mount_position_m), radar.mount_yaw_rad
        )
        transmitter_m = place_m + rotate_z(np.asarray(radar.tx_position_m), yaw_rad)
        zero = block.part("first_path")
        usable = frames.valid & np.isfinite(receiver_m).all(axis=1) & np.isfinite(boresight_rad) & np.isfinite(zero)
        usable &= np.asarray(frames.preamble.any(axis=1))
        if self._origin_m is None and usable.any():
            self._origin_m = receiver_m[np.argmax(usable), :2].copy()  # coordinates of millions of metres cost digits
        origin_m = np.zeros(2) if self._origin_m is None else self._origin_m
        looks = np.zeros((len(frames), loops.LOOK))
        looks[:, [loops.TX_X, loops.TX_Y]] = transmitter_m[:, :2] - origin_m
        looks[:, [loops.RX_X, loops.RX_Y]] = receiver_m[:, :2] - origin_m
        looks[:, loops.AHEAD_X], looks[:, loops.AHEAD_Y] = np.cos(boresight_rad), np.sin(boresight_rad)
        flown_m = radar.baseline_length_m if radar.first_tap_delay_s is None else 0.0
        looks[:, loops.ZERO] = zero - flown_m * self._at[loops.TAPS_PER_M]
        return looks, boresight_rad, usable

    def _take(self, samples: Any, second: Any, look: FloatArray) -> None:
        """Add a frame to the map if the receiver has moved since the last look."""
        loops = self._loops
        moved_m = math.hypot(look[loops.RX_X] - self._last_m[0], look[loops.RX_Y] - self._last_m[1])
        if moved_m < self._step_m:
            return
        taken = [np.asarray(each, np.complex128) * self._to_baseband for each in (samples, second) if each is not None]
        self._floods = self._floods + 1 if loops.flooded(taken[0], self._log_levels[0]) else 0
        if 0 < self._floods <= MOST_FLOODS:
            return
        first = math.isnan(moved_m)
        breaks = look[loops.BREAKS] = not first and moved_m > LOOKS_PER_WAVELENGTH / 4 * self._step_m
        if moved_m * self._at[loops.TAPS_PER_M] * 2 > self._reach:
            self._ceilings[:] = np.inf
        self._way_m += 0.0 if first else moved_m
        self._last_m = look[[loops.RX_X, loops.RX_Y]]
        look[loops.WAY_M] = self._way_m
        self._count += 1
        share = 1 / min(self._count, max(self._at[loops.FORGET_M] / self._step_m, 1.0))
        scaled = [
            loops.in_units_of_noise(each, level, share, self._half, ceiling, self._reach)
            for each, level, ceiling in zip(taken, self._log_levels, self._ceilings, strict=False)
        ]
        loops.add_look(self._cells, self._owner, scaled[0], scaled[-1], look, self._at)
        if breaks or self._count % 2:
            self._history = np.concatenate([self._history[-HISTORY + 1 :], look[None]])
        if breaks or self._count % SEARCH_EVERY == 2:
            self._search(look)

    def _search(self, look: FloatArray | None) -> None:
        """Objects of the map, those in view of a look, or of the last one of all directions."""
        if not len(self._history):
            return
        at = self._at
        if look is None:
            look, at = self._history[-1], at.copy()
            at[[self._loops.NEAREST_M, self._loops.FARTHEST_M, self._loops.VIEW]] = 0.0, math.inf, -1.0
        found = self._loops.crests(self._cells, self._owner, look, at, self._thresholds)
        self._objects = self._loops.objects_among(found, self._history, self._at, self.params.most)

    def _rows(self, poses: FloatArray, looks: FloatArray, known: list[FloatArray], processed: IntArray) -> Detections:
        """Rows of the objects known in each frame that are in its view."""
        loops, at = self._loops, self._at
        counts = [len(each) for each in known]
        objects = np.concatenate(known) if sum(counts) else np.zeros((0, 3))
        of = np.repeat(np.arange(len(poses)), counts) if sum(counts) else np.zeros(0, np.int64)
        place_m, evidence = objects[:, :2], objects[:, 2]
        off_m = place_m - looks[of][:, [loops.RX_X, loops.RX_Y]]
        range_m = np.hypot(off_m[:, 0], off_m[:, 1])
        ahead = np.sum(off_m * looks[of][:, [loops.AHEAD_X, loops.AHEAD_Y]], axis=1)
        seen = (
            (range_m >= at[loops.NEAREST_M]) & (range_m <= at[loops.FARTHEST_M]) & (ahead >= at[loops.VIEW] * range_m)
        )
        azimuth_rad = np.arctan2(off_m[:, 1], off_m[:, 0]) - poses[of, 1]
        origin_m = np.zeros(2) if self._origin_m is None else self._origin_m
        rows = Detections(
            poses[of, 0].astype(np.int64),
            processed=processed,
            range_m=range_m,
            azimuth_rad=wrap_angle(azimuth_rad),
            amplitude=np.sqrt(evidence),
            score_db=10 * np.log10(evidence),
            x_m=place_m[:, 0] + origin_m[0],
            y_m=place_m[:, 1] + origin_m[1],
        )
        return rows.take(seen)


def thresholds(rate: float, most: int) -> FloatArray:
    """Evidence that the sum of n looks or stretches of noise alone exceeds with a probability, for n from 0 on.

    The power of noise over its mean is distributed exponentially, and the sum of n of them exceeds t with
    ``exp(-t) sum_{k<n} t^k / k!``. The evidence is that sum less its mean n.

    Parameters
    ----------
    rate : float
    most : int

    Returns
    -------
    (most + 1,) array
        Rising; infinite for no stretch.
    """
    found, goal = np.full(most + 1, np.inf), math.log(rate)
    power = -goal
    for count in range(1, most + 1):
        power += count > 1
        for _ in range(8):  # Newton's method on the logarithm, which is concave: from the left it never overshoots
            terms = np.arange(count) * math.log(power) - _LOG_FACTORIALS[:count]
            tail = math.log(np.exp(terms - terms.max()).sum()) + terms.max()
            power += (tail - power - goal) / math.exp(terms[-1] - tail)
        found[count] = power - count
    return found


_LOG_FACTORIALS: FloatArray = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, MOST_STRETCHES + 1)))])
