"""Bodies of a scene: what a scene may say about them, their outlines, and the faces that reflect."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import EchoFading, EchoTail, FloatArray, Obstacle, Params, SceneObject, rotate_z
from uwbbench_datasets.simulator.motion import Motion, Walk, places_m
from uwbbench_datasets.simulator.trajectory import Point, in_space

_SIZES = {
    "plate": {"width_m", "depth_m", "height_m"},
    "box": {"width_m", "depth_m", "height_m"},
    "wall": {"width_m", "depth_m", "height_m"},
    "rod": {"radius_m", "height_m"},
    "person": {"radius_m", "height_m"},
    "point": set[str](),
}
_USUAL = {
    "plate": {"depth_m": 0.002},
    "wall": {"depth_m": 0.1, "height_m": 2.5},
    "person": {"radius_m": 0.2, "height_m": 1.7},
}
_CORNERS_OF_A_CIRCLE = 32


class ObjectModel(Params):
    """One object of a scene.

    Left out, a plate is 2 mm deep, a wall 0.1 m deep and 2.5 m high, and a person 0.4 m across and 1.7 m high.
    """

    id: str = Field(min_length=1, description="Name of the object; also its address for vary and --set.")
    shape: Literal["plate", "box", "rod", "wall", "person", "point"]
    center_m: Point | None = Field(
        None, description="Centre of the body; z, if left out, is the radar's height of 0. Waypoints take its place."
    )
    yaw_deg: float = Field(0.0, description="Heading of the front's outward normal; the width runs across it.")
    width_m: float | None = Field(None, gt=0)
    depth_m: float | None = Field(None, gt=0)
    height_m: float | None = Field(None, gt=0)
    radius_m: float | None = Field(None, gt=0)
    material: str = Field("metal", description="Name of a material that the echo terms know.")
    thickness_m: float | None = Field(None, gt=0, description="Thickness of a hollow body's walls, for a slab.")
    loss_db: float | None = Field(
        None, description="What the body loses against an ideal one; what is usual of its material if left out."
    )
    fading: EchoFading | None = Field(None, description="Rise and fall of the echo along the way; none if left out.")
    tail: EchoTail | None = Field(None, description="Returns from behind the face; none if left out.")
    bearing_bias_deg: float = Field(0.0, description="Constant error of the direction that echoes seem to come from.")
    bearing_sd_deg: float = Field(0.0, ge=0, description="Standard deviation of the rest of that error (glint).")
    bearing_length_m: float = Field(0.05, gt=0, description="Way of the receiver over which it becomes another.")
    motion: Motion | None = Field(None, description="How it moves; it stands still if left out. Its heading stays.")
    structure: bool | None = Field(None, description="Not an obstacle to be found; true for walls if left out.")

    @model_validator(mode="after")
    def _sizes_fit(self) -> ObjectModel:
        wanted = _SIZES[self.shape]
        given = {name for name in ("width_m", "depth_m", "height_m", "radius_m") if getattr(self, name) is not None}
        if given - wanted:
            raise ValueError(f"a {self.shape} has no {sorted(given - wanted)[0]}")
        missing = wanted - given - set(_USUAL.get(self.shape, {}))
        if missing:
            raise ValueError(f"a {self.shape} needs {', '.join(sorted(missing))}")
        mirrors = {"fading", "tail", "bearing_bias_deg", "bearing_sd_deg", "bearing_length_m"} & self.model_fields_set
        if self.shape == "wall" and mirrors:
            raise ValueError(f"a wall has no {sorted(mirrors)[0]}: its echo is that of a mirror")
        return self

    @model_validator(mode="after")
    def _has_a_place(self) -> ObjectModel:
        walks = isinstance(self.motion, Walk)
        if self.shape == "wall" and self.motion is not None:
            raise ValueError("a wall does not move")
        if walks and self.center_m is not None:
            raise ValueError("center_m and the points_m of its motion both say where it is; leave center_m out")
        if not walks and self.center_m is None:
            raise ValueError(f"a {self.shape} needs center_m")
        return self

    def _size(self, name: str) -> float:
        value = getattr(self, name)
        return float(_USUAL.get(self.shape, {}).get(name, 0.0) if value is None else value)

    def body(self) -> SceneObject:
        """The object as terms and the ground truth see it; where it moves, at the start of its way."""
        across = 2 * self._size("radius_m")
        width, depth = self._size("width_m") or across, self._size("depth_m") or across
        place = self.motion.points_m[0] if isinstance(self.motion, Walk) else self.center_m
        center, yaw = in_space(place or []), float(np.radians(self.yaw_deg))
        structure = self.shape == "wall" if self.structure is None else self.structure
        outline = center[:2] + rotate_z(_outline(self.shape, width, depth), yaw)[:, :2]
        obstacle = Obstacle(self.id, self.material, outline, structure)
        return SceneObject(
            obstacle,
            self.shape,
            center,
            yaw,
            width,
            depth,
            self._size("height_m"),
            thickness_m=self.thickness_m,
            loss_db=self.loss_db,
            fading=self.fading,
            tail=self.tail,
            bearing_bias_rad=float(np.radians(self.bearing_bias_deg)),
            bearing_sd_rad=float(np.radians(self.bearing_sd_deg)),
            bearing_length_m=self.bearing_length_m,
        )

    def moving(self, timestamp_s: FloatArray, rng: np.random.Generator) -> SceneObject:
        """The object at each of these times (frames,).

        Parameters
        ----------
        timestamp_s : (frames,) array
        rng : Generator
            Draws what is random about its motion.
        """
        body = self.body()
        if self.motion is None:
            return body
        center_m = places_m(self.motion, body.center_m, body.yaw_rad, timestamp_s, rng)
        outline_m = body.obstacle.outline_m + (center_m - body.center_m)[:, None, :2]
        return replace(body, center_m=center_m, obstacle=replace(body.obstacle, outline_m=outline_m))


def _outline(shape: str, width: float, depth: float) -> FloatArray:
    """Outline (vertices, 3) seen from above, centred, with the front along +x."""
    if shape == "point":
        return np.zeros((1, 3))
    if shape in ("rod", "person"):
        angle = np.arange(_CORNERS_OF_A_CIRCLE) * 2 * np.pi / _CORNERS_OF_A_CIRCLE
        return np.stack([width / 2 * np.cos(angle), width / 2 * np.sin(angle), np.zeros_like(angle)], axis=1)
    half = np.array([depth, width, 0.0]) / 2
    return np.array([[1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]]) * half


@dataclass(frozen=True)
class Face:
    """One upright rectangular face of a body.

    Attributes
    ----------
    center_m : (3,) array
        Or (frames, 3) where the body moves.
    normal, across : (3,) array
        Unit vectors outwards and along the width.
    width_m, height_m : float
    """

    center_m: FloatArray
    normal: FloatArray
    across: FloatArray
    width_m: float
    height_m: float


def faces(body: SceneObject) -> tuple[Face, ...]:
    """Faces of a plate, wall (front and back) or box (all four sides)."""
    sides = 4 if body.shape == "box" else 2
    upright = []
    for turn in np.arange(4)[:: 4 // sides]:
        heading = body.yaw_rad + turn * np.pi / 2
        normal = rotate_z(np.array([1.0, 0.0, 0.0]), heading)
        across = rotate_z(np.array([0.0, 1.0, 0.0]), heading)
        depth, width = (body.depth_m, body.width_m) if turn % 2 == 0 else (body.width_m, body.depth_m)
        upright.append(Face(body.center_m + depth / 2 * normal, normal, across, width, body.height_m))
    return tuple(upright)
