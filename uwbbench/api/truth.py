"""Ground truth: outlines in the world, and what a receiver at a given pose should see of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, lock_fields
from uwbbench.api.geometry import nearest_on_outline, nearest_on_visible, receiver_pose, rotate_z, segments_cross
from uwbbench.api.radar import Radar


@dataclass(frozen=True)
class Trajectory:
    """Where the robot was, frame by frame; read-only.

    Attributes
    ----------
    timestamp_s : (frames,) array
    position_m : (frames, 3) array
    yaw_rad : (frames,) array
    """

    timestamp_s: FloatArray
    position_m: FloatArray
    yaw_rad: FloatArray

    def __post_init__(self) -> None:
        lock_fields(self, ("timestamp_s", "position_m", "yaw_rad"))

    def __len__(self) -> int:
        return len(self.timestamp_s)


@dataclass(frozen=True)
class Obstacle:
    """One labelled object.

    Attributes
    ----------
    name : str
        Identifier inside the capture.
    material : str
    outline_m : (vertices, 2 or 3) or (frames, vertices, 2 or 3) array
        Closed polygon in the world; one vertex is a point target. With a leading frame axis the object moves, and
        frames whose outline is NaN are unlabelled. Read-only.
    structure : bool
        True for walls and the like: seen and known, but no obstacle that a detector is asked to find.
    """

    name: str
    material: str
    outline_m: FloatArray
    structure: bool = False

    def __post_init__(self) -> None:
        lock_fields(self, ("outline_m",))

    @property
    def moves(self) -> bool:
        """Whether the outline has a frame axis."""
        return self.outline_m.ndim == 3

    def outline_at(self, frame: np.ndarray) -> FloatArray:
        """Outline (vertices, k), or one for each of the given frames (n, vertices, k) where the object moves."""
        return self.outline_m[frame] if self.moves else self.outline_m


@dataclass(frozen=True)
class Sight:
    """What a receiver should see: arrays (frames, objects).

    Attributes
    ----------
    range_m : array
        Distance from the receiver to the nearest point of the outline; NaN where the frame is unlabelled.
    azimuth_rad : array
        Azimuth of that point from boresight.
    occluded : bool array
        Whether another outline stands in between.
    """

    range_m: FloatArray
    azimuth_rad: FloatArray
    occluded: BoolArray


@dataclass(frozen=True)
class Truth:
    """Labelled objects of a capture.

    Attributes
    ----------
    objects : tuple of Obstacle
    exhaustive : bool
        False where unlabelled objects are visible too, so that an unmatched detection proves nothing.
    """

    objects: tuple[Obstacle, ...]
    exhaustive: bool = True

    def __repr__(self) -> str:
        return f"Truth({len(self.objects)} objects, {'exhaustive' if self.exhaustive else 'not exhaustive'})"

    def _repr_html_(self) -> str:
        from uwbbench.show.notebook.capture import truth

        return truth(self)

    def seen_from(self, radar: Radar, trajectory: Trajectory) -> Sight:
        """Range and azimuth of every object from every pose of the receiver.

        Parameters
        ----------
        radar : Radar
            Gives the mount of the receiver.
        trajectory : Trajectory
            Robot poses (frames).

        Returns
        -------
        Sight
            Arrays (frames, objects).
        """
        frames = len(trajectory)
        receiver_m, boresight_rad = receiver_pose(
            trajectory.position_m, trajectory.yaw_rad, np.asarray(radar.mount_position_m), radar.mount_yaw_rad
        )
        range_m = np.full((frames, len(self.objects)), np.nan)
        azimuth_rad = np.full_like(range_m, np.nan)
        occluded = np.zeros(range_m.shape, bool)
        for column, obstacle in enumerate(self.objects):
            dimensions = obstacle.outline_m.shape[-1]
            point = nearest_on_outline(receiver_m[:, :dimensions], obstacle.outline_m)
            offset = np.zeros((frames, 3))
            offset[:, :dimensions] = point - receiver_m[:, :dimensions]
            local = rotate_z(offset, -boresight_rad)
            range_m[:, column] = np.linalg.norm(offset, axis=1)
            azimuth_rad[:, column] = np.arctan2(local[:, 1], local[:, 0])
            for other in self.objects:
                if other is not obstacle and other.outline_m.shape[-2] > 1:
                    flat = other.outline_m[..., :2]
                    occluded[:, column] |= segments_cross(receiver_m[:, :2], point[:, :2], flat)
        return Sight(range_m, azimuth_rad, occluded)

    def distance_to(self, points_m: FloatArray, frame: np.ndarray, eyes_m: FloatArray | None = None) -> FloatArray:
        """Distance (n, objects) from world points to each outline; 0 inside.

        Parameters
        ----------
        points_m : (n, 2) array
        frame : (n,) int array
            In which each is seen.
        eyes_m : (n, 2) array, optional
            Where each is seen from: distances are then those to what can be seen of an outline from there.
        """
        distance = np.full((len(points_m), len(self.objects)), np.nan)
        for column, obstacle in enumerate(self.objects):
            outline = obstacle.outline_at(frame)[..., :2]
            if eyes_m is None:
                nearest_m = nearest_on_outline(points_m, outline)
            else:
                nearest_m = nearest_on_visible(points_m, outline, eyes_m)
            distance[:, column] = np.linalg.norm(points_m - nearest_m, axis=1)
        return distance
