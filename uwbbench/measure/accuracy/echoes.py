"""Where echoes can be: what the direct path covers, where the samples end, and where obstacles show a second time.

Conventions
-----------
* Ways are compared as *excess paths*, the length flown less that of the direct path, in metres. A gate on ranges is
  one on half of them, which is the same for a transmitter beside the receiver.
* A pulse of bandwidth ``B`` with a flat spectrum is ``2 / B`` wide between its zeros (Richards, Fundamentals of Radar
  Signal Processing, 2014, section 4.2). An echo that comes within that of the direct path is *masked* by it; its
  ringing is taken to last as long again, ``4 / B`` in all: 0.6 m and 1.2 m of range at 500 MHz.
* The *window* ends at the last tap. Where delays count from a direct path whose tap is not known beforehand, that path
  is taken to be the first tap that is not noise, so that the window is never called shorter than it is.
* *Ghosts* are two ways that fly further than to an obstacle and back: by way of a labelled structure, once, out or
  back, wherever the mirror reflection falls on it; and off the robot and out to the obstacle a second time. Obstacles
  are points, the ones of their outlines nearest to the receiver.
"""

from __future__ import annotations

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S, direction, excess_path, receiver_pose, rotate_z, to_world
from uwbbench.api.radar import Radar
from uwbbench.measure.accuracy.scene import Scene

DIRECT_PULSES, RINGING_PULSES = 2.0, 4.0
"""Units of ``1 / B`` behind the direct path that the pulse covers, and that the ringing after it lasts."""


def excess_m(range_m: FloatArray, azimuth_rad: FloatArray, radar: Radar) -> FloatArray:
    """Excess path of targets at the receiver's height; boresight where the azimuth is not known.

    Parameters
    ----------
    range_m, azimuth_rad : arrays of one shape
        Seen from the receiver.
    radar : Radar
    """
    towards = direction(np.nan_to_num(azimuth_rad, nan=0.0))
    return excess_path(range_m[..., None] * towards, radar.baseline_m)


def covered_m(radar: Radar, pulses: float) -> float:
    """Excess path below which an echo comes within so many pulses of the direct path."""
    return pulses * SPEED_OF_LIGHT_M_S / radar.bandwidth_hz


def window_m(radar: Radar) -> float:
    """Largest excess path whose echo falls on a tap."""
    if radar.first_tap_delay_s is None:
        return (radar.taps - 1 - radar.noise_taps) * radar.sample_interval_s * SPEED_OF_LIGHT_M_S
    last_s = radar.first_tap_delay_s + (radar.taps - 1) * radar.sample_interval_s
    return last_s * SPEED_OF_LIGHT_M_S - radar.baseline_length_m


def ghosts_m(scene: Scene, frame: IntArray) -> FloatArray:
    """Excess paths (n, ghosts) of all ghosts of labelled obstacles in some frames.

    Parameters
    ----------
    scene : Scene
    frame : (n,) int array

    Returns
    -------
    (n, ghosts) array
        NaN where there is none in that frame.
    """
    radar, track = scene.header.radar, scene.header.trajectory
    position_m, yaw_rad = track.position_m[frame], track.yaw_rad[frame]
    receiver_m, boresight_rad = receiver_pose(
        position_m, yaw_rad, np.asarray(radar.mount_position_m), radar.mount_yaw_rad
    )
    transmitter_m = position_m + rotate_z(np.asarray(radar.tx_position_m, float), yaw_rad)
    ways: list[FloatArray] = [np.empty((len(frame), 0))]
    for column in np.flatnonzero(scene.obstacle):
        range_m, azimuth_rad = scene.sight.range_m[frame, column], scene.sight.azimuth_rad[frame, column]
        flat = to_world(range_m, azimuth_rad, receiver_m, boresight_rad)
        point_m = np.column_stack([flat, receiver_m[:, 2]])
        ways.append((_distance(transmitter_m, point_m) + 3 * range_m)[:, None])
        for wall in (item for item in scene.truth.objects if item.structure):
            outline_m = np.broadcast_to(wall.outline_at(frame)[..., :2], (len(frame), wall.outline_m.shape[-2], 2))
            for first in range(outline_m.shape[1] if outline_m.shape[1] > 2 else outline_m.shape[1] - 1):
                edge_m = outline_m[:, first], outline_m[:, (first + 1) % outline_m.shape[1]]
                for one, other in ((receiver_m, transmitter_m), (transmitter_m, receiver_m)):
                    image_m, there = _reflected(point_m, one, *edge_m)
                    length = _distance(one, image_m) + _distance(other, point_m)
                    ways.append(np.where(there, length, np.nan)[:, None])
    return np.concatenate(ways, axis=1) - radar.baseline_length_m


def _distance(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(one - other, axis=-1))


def _reflected(
    point_m: FloatArray, antenna_m: FloatArray, start_m: FloatArray, end_m: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Mirror image (n, 3) of points in upright walls, and whether an antenna sees it there.

    Parameters
    ----------
    point_m, antenna_m : (n, 3) arrays
    start_m, end_m : (n, 2) arrays
        Ends of the walls.
    """
    along = end_m - start_m
    with np.errstate(divide="ignore", invalid="ignore"):
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    height, antenna_height = (np.sum((place[:, :2] - start_m) * normal, axis=1) for place in (point_m, antenna_m))
    image_m = point_m.copy()
    image_m[:, :2] -= 2 * height[:, None] * normal
    same_side = height * antenna_height > 0
    share = np.divide(height, height + antenna_height, out=np.full(len(height), np.nan), where=same_side)
    hit_m = image_m[:, :2] + share[:, None] * (antenna_m[:, :2] - image_m[:, :2])
    place = np.sum((hit_m - start_m) * along, axis=1)
    return image_m, same_side & (place >= 0) & (place <= np.linalg.norm(end_m - start_m, axis=1))
