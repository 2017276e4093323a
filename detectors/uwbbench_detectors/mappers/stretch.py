"""Echoes along the way: those of the window that is being gathered, and those that no wall has explained so far."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import numpy as np

from uwbbench.api import BoolArray, Detections, FloatArray, Radar, wrap_angle
from uwbbench_detectors.mappers.echoes import Echoes
from uwbbench_detectors.mappers.motion import composed
from uwbbench_detectors.mappers.walls import WallParams


class Stretch:
    """Gathers echoes in the frame of odometry, window by window.

    Each echo is in one window only, as the same data in two would be counted twice. What a window leaves unexplained
    is kept for a few windows more, in which a new wall may show.

    Parameters
    ----------
    params : WallParams
    radars : mapping of str to Radar
        By receiver.
    windows : int
        Windows that unexplained echoes are kept for.
    """

    def __init__(self, params: WallParams, radars: Mapping[str, Radar], windows: int) -> None:
        self._params = params
        self._mounts = {
            name: np.array([*radar.mount_position_m[:2], radar.mount_yaw_rad]) for name, radar in radars.items()
        }
        self._pose: FloatArray = np.zeros(3)
        self._fresh: list[Echoes] = []
        self._kept: deque[Echoes] = deque(maxlen=windows)

    def clear(self) -> None:
        """Forget all echoes, as where they and those to come have no frame in common."""
        self._fresh.clear()
        self._kept.clear()

    def move(self, moved: FloatArray) -> None:
        """Move by a step (3,) of odometry."""
        self._pose = composed(self._pose, moved)

    def add(self, found: Mapping[str, Detections]) -> None:
        """Take in what receivers have found where the robot is now.

        Parameters
        ----------
        found : mapping of str to Detections
            By receiver. Rows whose range or azimuth is not finite are left out.
        """
        p = self._params
        for name, rows in found.items():
            range_m, azimuth_rad = rows.range_m, rows.azimuth_rad
            counts = (range_m >= p.nearest_m) & (range_m <= p.farthest_m)
            counts &= np.abs(azimuth_rad) <= np.radians(p.azimuth_deg)
            pose = composed(self._pose, self._mounts[name])
            receiver_m = np.tile(pose[:2], (int(np.count_nonzero(counts)), 1))
            self._fresh.append(Echoes(receiver_m, range_m[counts], wrap_angle(pose[2] + azimuth_rad[counts])))

    def close(self) -> Echoes:
        """Echoes of the window, in the robot's frame now; the next one begins when :meth:`keep` has been called."""
        return Echoes.join(self._fresh).seen_from(self._pose)

    def keep(self, unexplained: BoolArray) -> Echoes:
        """Begin the next window, and keep some echoes (n,) of the last one for walls to come.

        Returns
        -------
        Echoes
            All that are kept, in the robot's frame now.
        """
        self._kept.append(Echoes.join(self._fresh).take(unexplained))
        self._fresh.clear()
        return Echoes.join(list(self._kept)).seen_from(self._pose)

    def drop(self, explained: BoolArray) -> None:
        """Keep no longer what is explained (n,), of all that :meth:`keep` has returned."""
        ends = np.cumsum([len(part) for part in self._kept])[:-1]
        for place, gone in enumerate(np.split(explained, ends)):
            self._kept[place] = self._kept[place].take(~gone)
