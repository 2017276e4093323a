"""Poses, mounts, bistatic ranges and outlines: all geometry of the project.

Conventions: right-handed frames, metres, x forward, y left, z up; yaw counter-clockwise from +x in radians.
Azimuth is measured at the receiver from its boresight, positive to the left. ``t`` is the vector from the receiver
to the transmitter in the receiver's frame and ``D = |t|`` their distance. A path length ``d`` is flown from the
transmitter over the target to the receiver.
"""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray

SPEED_OF_LIGHT_M_S = 299_792_458.0


def wrap_angle(angle_rad: FloatArray) -> FloatArray:
    """Angle in [-pi, pi), so that +pi becomes -pi.

    Examples
    --------
    >>> wrap_angle(np.array([np.pi, -np.pi, 7.0])).round(6).tolist()
    [-3.141593, -3.141593, 0.716815]
    """
    wrapped = np.mod(angle_rad + np.pi, 2 * np.pi) - np.pi
    return np.asarray(np.where(wrapped >= np.pi, -np.pi, wrapped))  # the modulo of a tiny negative number rounds up


def wrap_one_angle(angle_rad: float) -> float:
    """A single angle in [-pi, pi), for what is done angle by angle, where arrays cost more than the arithmetic.

    Examples
    --------
    >>> wrap_one_angle(np.pi) == -np.pi
    True
    """
    angle = math.remainder(angle_rad, 2 * math.pi)
    return -math.pi if angle >= math.pi else angle


def rotate_z(vectors: FloatArray, yaw_rad: FloatArray | float) -> FloatArray:
    """Vectors (..., 3) turned counter-clockwise about z by ``yaw_rad`` (...)."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    turned_x, turned_y, same_z = np.broadcast_arrays(cosine * x - sine * y, sine * x + cosine * y, z)
    return np.stack([turned_x, turned_y, same_z], axis=-1)


def receiver_pose(
    position_m: FloatArray, yaw_rad: FloatArray, mount_position_m: FloatArray, mount_yaw_rad: float
) -> tuple[FloatArray, FloatArray]:
    """Pose of a mounted receiver in the world.

    Parameters
    ----------
    position_m : (frames, 3) array
        Robot positions in the world.
    yaw_rad : (frames,) array
        Robot headings.
    mount_position_m : (3,) array
        Receiver in the robot frame.
    mount_yaw_rad : float
        Boresight in the robot frame.

    Returns
    -------
    (frames, 3) array, (frames,) array
        Receiver positions and boresight headings in the world.
    """
    return position_m + rotate_z(np.asarray(mount_position_m, float), yaw_rad), yaw_rad + mount_yaw_rad


def to_world(
    range_m: FloatArray, azimuth_rad: FloatArray, receiver_m: FloatArray, boresight_rad: FloatArray
) -> FloatArray:
    """World points of detections at a range and azimuth from receivers.

    Targets are taken at the receiver's height, as the radar has no elevation.

    Parameters
    ----------
    range_m : (n,) array
    azimuth_rad : (n,) array
        From boresight, positive to the left.
    receiver_m : (n, 3) array
        Receiver positions in the world.
    boresight_rad : (n,) array
        Boresight headings in the world.

    Returns
    -------
    (n, 2) array
    """
    heading = boresight_rad + azimuth_rad
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return np.asarray(receiver_m[:, :2] + range_m[:, None] * ahead)


def direction(azimuth_rad: FloatArray) -> FloatArray:
    """Unit vectors (n, 3) in the receiver frame towards targets at the receiver's height."""
    return np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad), np.zeros_like(azimuth_rad)], axis=-1)


def bistatic_range(excess_m: FloatArray, towards: FloatArray, baseline_m: FloatArray) -> FloatArray:
    r"""Range from the receiver to the target, exact for any placement of the transmitter.

    From ``|p - t|^2 = r^2 + D^2 - 2 r u.t`` and ``|p - t| = d - r`` follows ``r = (d^2 - D^2) / (2 (d - u.t))``.
    Written in the excess path ``e = d - D``, ``r = e (e + 2 D) / (2 (e + D - u.t))``, it keeps full precision next to
    the direct path, where ``d^2 - D^2`` cancels.

    Parameters
    ----------
    excess_m : (n,) array
        Path length minus the distance between transmitter and receiver.
    towards : (n, 3) array
        Unit vectors from the receiver to the target, in the receiver frame.
    baseline_m : (3,) array
        Vector from the receiver to the transmitter, in the receiver frame.

    Returns
    -------
    (n,) array
        Range in metres; NaN where the path is shorter than the baseline, which no target can cause.
    """
    baseline = np.asarray(baseline_m, float)
    distance = float(np.linalg.norm(baseline))
    along = towards @ baseline if towards.size else np.zeros(len(excess_m))
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = excess_m * (excess_m + 2 * distance) / (2 * (excess_m + (distance - along)))
    return np.asarray(np.where(excess_m > 0, range_m, np.where(excess_m == 0, 0.0, np.nan)))


def bistatic_range_sine(excess_m: FloatArray, azimuth_rad: FloatArray, distance_m: float) -> FloatArray:
    """Range by the printed sine form of arXiv 2512.01018: ``r = (d^2 - D^2) / (2 (d + D sin theta))``.

    Equal to :func:`bistatic_range` only where the transmitter stands in the array plane on the negative-azimuth side,
    ``t = (0, -D, 0)``. Kept to reproduce the paper.

    Parameters
    ----------
    excess_m : (n,) array
        Path length minus the distance between transmitter and receiver.
    azimuth_rad : (n,) array
        From boresight, positive to the left.
    distance_m : float
        Distance ``D`` between transmitter and receiver.

    Returns
    -------
    (n,) array
        Range in metres; NaN where the path is shorter than the baseline, which no target can cause.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = excess_m * (excess_m + 2 * distance_m) / (2 * (excess_m + distance_m * (1 + np.sin(azimuth_rad))))
    return np.asarray(np.where(excess_m > 0, range_m, np.where(excess_m == 0, 0.0, np.nan)))


def excess_path(points_m: FloatArray, baseline_m: FloatArray) -> FloatArray:
    """Excess path ``|p - t| + |p| - D`` of points (n, 3) in the receiver frame."""
    baseline = np.asarray(baseline_m, float)
    flown = np.linalg.norm(points_m - baseline, axis=-1) + np.linalg.norm(points_m, axis=-1)
    return np.asarray(flown - np.linalg.norm(baseline))


def nearest_on_outline(points_m: FloatArray, outline_m: FloatArray) -> FloatArray:
    """Nearest point of a closed outline to each point; the point itself where it lies inside a flat outline.

    Parameters
    ----------
    points_m : (n, k) array
        Points, k = 2 or 3.
    outline_m : (vertices, k) or (n, vertices, k) array
        One outline for all points, or one for each. One vertex is a point target; two are a segment.

    Returns
    -------
    (n, k) array
    """
    outline = np.broadcast_to(outline_m, (len(points_m), *np.shape(outline_m)[-2:]))
    starts, ends = outline, np.roll(outline, -1, axis=1)
    edge = ends - starts
    length2 = np.sum(edge**2, axis=-1)
    offset = points_m[:, None, :] - starts
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(length2 > 0, np.sum(offset * edge, axis=-1) / length2, 0.0)
    foot = starts + np.clip(along, 0.0, 1.0)[..., None] * edge
    distance2 = np.sum((points_m[:, None, :] - foot) ** 2, axis=-1)
    best = foot[np.arange(len(points_m)), np.argmin(distance2, axis=1)]
    if points_m.shape[-1] == 2 and outline.shape[1] >= 3:
        best = np.where(inside(points_m, outline)[:, None], points_m, best)
    return np.asarray(best)


def nearest_on_visible(points_m: FloatArray, outline_m: FloatArray, eyes_m: FloatArray) -> FloatArray:
    """Nearest point to each point on the part of a closed flat outline that can be seen from somewhere.

    An edge is cut where the rays through the vertices meet it; between two cuts it is seen as a whole or not at all.
    Where nothing is seen, as from a place on the outline itself, all of the outline counts.

    Parameters
    ----------
    points_m : (n, 2) array
    outline_m : (vertices, 2) or (n, vertices, 2) array
        One outline for all points, or one for each; its edges do not cross. One vertex is a point target; two are a
        segment.
    eyes_m : (n, 2) array
        Where each point's outline is seen from.

    Returns
    -------
    (n, 2) array
    """
    outlines = np.broadcast_to(outline_m, (len(points_m), *np.shape(outline_m)[-2:]))
    nearest = np.empty((len(points_m), 2))
    most = max(1, 500_000 // outlines.shape[1] ** 3)
    for first in range(0, len(points_m), most):
        rows = slice(first, first + most)
        nearest[rows] = _nearest_seen(points_m[rows, None, None], outlines[rows], eyes_m[rows, None])
    return nearest


def _nearest_seen(points: FloatArray, outlines: FloatArray, eyes: FloatArray) -> FloatArray:
    """Nearest points (n, 2) to points (n, 1, 1, 2) on what eyes (n, 1, 2) see of outlines (n, vertices, 2)."""
    edges = 1 if outlines.shape[1] == 2 else outlines.shape[1]  # a segment is there and back
    starts, edge = outlines[:, :edges], (np.roll(outlines, -1, axis=1) - outlines)[:, :edges]
    with np.errstate(divide="ignore", invalid="ignore"):
        rays = (outlines - eyes)[:, None]
        cuts = _cross((eyes - starts)[:, :, None], rays) / _cross(edge[:, :, None], rays)
        cuts = np.sort(np.clip(np.nan_to_num(cuts, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0), axis=2)
        low = np.concatenate([np.zeros_like(cuts[:, :, :1]), cuts], axis=2)
        high = np.concatenate([cuts, np.ones_like(cuts[:, :, :1])], axis=2)
        middle = starts[:, :, None] + ((low + high) / 2)[..., None] * edge[:, :, None]
        # The way to the middle of a piece (n, edges, pieces) is stopped by any other edge that it meets.
        way, offset = (middle - eyes[:, :, None])[:, :, :, None], (starts - eyes)[:, None, None]
        across = _cross(way, edge[:, None, None])
        on_way, on_edge = _cross(offset, edge[:, None, None]) / across, _cross(offset, way) / across
        stopped = (across != 0) & (on_way > 0) & (on_way < 1 - 1e-9) & (on_edge >= 0) & (on_edge <= 1)
        stopped &= ~np.eye(edges, dtype=bool)[:, None]
        seen = ~stopped.any(axis=3) & ((high - low > 1e-12) | (outlines.shape[1] == 1))
        seen |= ~seen.any(axis=(1, 2), keepdims=True)
        length2 = np.sum(edge**2, axis=-1)[:, :, None]
        along = np.where(length2 > 0, np.sum((points - starts[:, :, None]) * edge[:, :, None], axis=-1) / length2, 0.0)
    foot = starts[:, :, None] + np.clip(along, low, high)[..., None] * edge[:, :, None]
    distance = np.where(seen, np.linalg.norm(foot - points, axis=-1), np.inf)
    best = np.argmin(distance.reshape(len(distance), -1), axis=1)
    return np.asarray(foot.reshape(len(foot), -1, 2)[np.arange(len(foot)), best])


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of flat vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def inside(points_m: FloatArray, outline_m: FloatArray) -> BoolArray:
    """Whether 2-D points (n, 2) lie inside a closed outline (vertices, 2) or (n, vertices, 2), by the crossing rule."""
    outline = np.broadcast_to(outline_m, (len(points_m), *np.shape(outline_m)[-2:]))
    starts, ends = outline, np.roll(outline, -1, axis=1)
    x, y = points_m[:, 0, None], points_m[:, 1, None]
    spans = (starts[..., 1] > y) != (ends[..., 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (ends[..., 0] - starts[..., 0]) / (ends[..., 1] - starts[..., 1])
        crossed = spans & (x < slope * (y - starts[..., 1]) + starts[..., 0])
    return np.asarray(np.sum(crossed, axis=1) % 2 == 1)


def segments_cross(from_m: FloatArray, to_m: FloatArray, outline_m: FloatArray) -> BoolArray:
    """Whether open 2-D segments cross any edge of an outline.

    Touching an end does not count, so that a target never hides behind its own nearest point.

    Parameters
    ----------
    from_m, to_m : (n, 2) arrays
        Ends of the segments.
    outline_m : (vertices, 2) or (n, vertices, 2) array
        One closed outline for all segments, or one for each.

    Returns
    -------
    (n,) bool array
    """
    outline = np.broadcast_to(outline_m, (len(from_m), *np.shape(outline_m)[-2:]))
    starts, edge = outline, np.roll(outline, -1, axis=1) - outline
    ray = (to_m - from_m)[:, None, :]
    offset = starts - from_m[:, None, :]
    cross = ray[..., 0] * edge[..., 1] - ray[..., 1] * edge[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along_ray = (offset[..., 0] * edge[..., 1] - offset[..., 1] * edge[..., 0]) / cross
        along_edge = (offset[..., 0] * ray[..., 1] - offset[..., 1] * ray[..., 0]) / cross
    hit = (cross != 0) & (along_ray > 1e-9) & (along_ray < 1 - 1e-9) & (along_edge >= 0) & (along_edge <= 1)
    return np.asarray(np.any(hit, axis=1))
