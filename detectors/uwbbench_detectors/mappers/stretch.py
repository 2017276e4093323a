"""Echoes along the way: those of the window that is being gathered, and those that no wall has explained so far."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from uwbbench.api import BoolArray, Detections, FloatArray, Radar, compose, wrap_angle
from uwbbench_detectors.mappers.echoes import Echoes
from uwbbench_detectors.mappers.walls import WallParams
from uwbbench_detectors.mappers.window import Way, WindowParams


@dataclass(frozen=True)
class _Found:
    """Rows of one receiver in one step, and which of them are echoes that count."""

    receiver: str
    rows: Detections
    counts: BoolArray


class Stretch:
    """Gathers echoes in the frame of odometry, window by window.

    Each echo is in one window only, as the same data in two would be counted twice. What a window leaves unexplained
    is kept for a few windows more, in which a new wall may show.

    Parameters
    ----------
    params : WallParams
    window : WindowParams
        How long a window is.
    radars : mapping of str to Radar
        By receiver.
    """

    def __init__(self, params: WallParams, window: WindowParams, radars: Mapping[str, Radar]) -> None:
        self._params, self._way = params, Way(window)
        self._mounts = {
            name: np.array([*radar.mount_position_m[:2], radar.mount_yaw_rad]) for name, radar in radars.items()
        }
        self._kept: deque[Echoes] = deque(maxlen=max(1, round(params.stretch_m / window.travel_m)))
        self.clear()

    def clear(self) -> None:
        """Forget all echoes, as where they and those to come have no frame in common."""
        self._pose: FloatArray = np.zeros(3)
        self._kept.clear()
        self._begin()

    def add(self, moved: FloatArray, found: Mapping[str, Detections]) -> None:
        """Take in a step.

        Parameters
        ----------
        moved : (3,) array
            Odometry since the step before.
        found : mapping of str to Detections
            By receiver. Rows whose range or azimuth is not finite are left out.
        """
        self._pose = compose(self._pose, moved)
        counts = self._way.add(moved)
        self._steps.append((moved, [self._take_in(name, rows) for name, rows in found.items()] if counts else []))

    @property
    def full(self) -> bool:
        """Whether the robot has gone as far as a window reaches."""
        return self._way.full

    @property
    def echoes(self) -> Echoes:
        """Echoes (n,) of the window, in the robot's frame now."""
        return Echoes.join(self._fresh).seen_from(self._pose)

    def steps(self, free: BoolArray) -> list[tuple[FloatArray, dict[str, Detections]]]:
        """Movements and rows of the window, step by step, without the rows of echoes (n,) that are not free."""
        left, start = [], 0
        for moved, parts in self._steps:
            found = {}
            for part in parts:
                stop = start + int(np.count_nonzero(part.counts))
                keeps = np.ones(len(part.rows), bool)
                keeps[part.counts] = free[start:stop]
                found[part.receiver] = part.rows.take(keeps)
                start = stop
            left.append((moved, found))
        return left

    def keep(self, unexplained: BoolArray) -> Echoes:
        """Begin the next window, and keep some echoes (n,) of the last one for walls to come.

        Returns
        -------
        Echoes
            All that are kept, in the robot's frame now.
        """
        self._kept.append(Echoes.join(self._fresh).take(unexplained))
        self._begin()
        return Echoes.join(list(self._kept)).seen_from(self._pose)

    def drop(self, explained: BoolArray) -> None:
        """Keep no longer what is explained (n,), of all that :meth:`keep` has returned."""
        ends = np.cumsum([len(part) for part in self._kept])[:-1]
        for place, gone in enumerate(np.split(explained, ends)):
            self._kept[place] = self._kept[place].take(~gone)

    def _begin(self) -> None:
        self._way.begin()
        self._steps: list[tuple[FloatArray, list[_Found]]] = []
        self._fresh: list[Echoes] = []

    def _take_in(self, receiver: str, rows: Detections) -> _Found:
        p = self._params
        range_m, azimuth_rad = rows.range_m, rows.azimuth_rad
        counts = (range_m >= p.nearest_m) & (range_m <= p.farthest_m)
        counts &= np.abs(azimuth_rad) <= np.radians(p.azimuth_deg)
        pose = compose(self._pose, self._mounts[receiver])
        receiver_m = np.tile(pose[:2], (int(np.count_nonzero(counts)), 1))
        self._fresh.append(Echoes(receiver_m, range_m[counts], wrap_angle(pose[2] + azimuth_rad[counts])))
        return _Found(receiver, rows, counts)
