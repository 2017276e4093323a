"""Walls: their mirror image of the transmitter, and the many weak echoes of what stands on them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
from pydantic import Field

from uwbbench.api import BoolArray, ComplexArray, FloatArray, Params, Paths, SceneObject, Term, View
from uwbbench_datasets.simulator.shapes import Face, faces
from uwbbench_datasets.simulator.terms.echo import face_echo, reflected


def walls(view: View) -> Iterator[tuple[int, SceneObject]]:
    """Walls of a scene with their column among the objects."""
    return ((column, body) for column, body in enumerate(view.objects) if body.shape == "wall")


def mirrored(points_m: FloatArray, face: Face) -> FloatArray:
    """Points (..., 3) on the other side of a face's plane."""
    return np.asarray(points_m - 2 * ((points_m - face.center_m) @ face.normal)[..., None] * face.normal)


def reflection_point(
    face: Face, one_m: FloatArray, other_m: FloatArray, slack_m: float = 0.0
) -> tuple[FloatArray, BoolArray]:
    """Where the way from one point to another by a face's mirror meets its plane, and whether it is on the face.

    Parameters
    ----------
    face : Face
    one_m, other_m : (frames, 3) array
    slack_m : float
        By how much a point may lie behind the face.

    Returns
    -------
    (frames, 3) array
    (frames,) bool array
        False too where not both points lie before the face.
    """
    one, other = (one_m - face.center_m) @ face.normal, (other_m - face.center_m) @ face.normal
    front = (one > -slack_m) & (other > -slack_m) & (one + other > 0)
    share = np.where(front, one, 1.0) / np.where(front, one + other, 2.0)
    hit = one_m + share[:, None] * (other_m - one_m) - face.center_m
    inside = (np.abs(hit @ face.across) <= face.width_m / 2) & (np.abs(hit[:, 2]) <= face.height_m / 2)
    return face.center_m + hit, np.asarray(front & inside)


class WallParams(Params):
    """How walls reflect."""

    infinite: bool = Field(False, description="Walls without ends: mirrors that reflect from wherever they are seen.")


class WallEcho(Term[WallParams]):
    """Echoes of walls: the transmitter's mirror image, faded by the Fresnel integral towards the wall's ends.

    An endless wall returns ``G lambda / (4 pi L)`` over the length ``L`` from the image of the transmitter to the
    receiver, with the reflection coefficient ``G`` of the material or slab at normal incidence, which is how a radar
    whose antennas stand close together meets its walls.
    """

    def bound(self, view: View) -> float:
        """All walls of a frame in phase, each at the most that its distance allows."""
        paths = self._all(view, bound=True)
        return 0.0 if paths is None else float(np.max(np.sum(np.abs(paths.amplitude), axis=1)))

    def paths(self, view: View, rng: np.random.Generator) -> Paths | None:
        """One path for each side of each wall."""
        return self._all(view, bound=False)

    def _finite(self, face: Face, view: View, *, bound: bool) -> tuple[FloatArray, FloatArray]:
        return face_echo(face, view.transmitter_m, view.receiver_m, view.radar.wavelength_m, bound=bound)

    def _mirror(self, face: Face, view: View) -> tuple[FloatArray, FloatArray]:
        """Point of reflection (frames, 3) and amplitude (frames,) of an endless perfect mirror."""
        endless = dataclasses.replace(face, width_m=np.inf, height_m=np.inf)
        point, seen = face_echo(endless, view.transmitter_m, view.receiver_m, view.radar.wavelength_m)
        length = np.linalg.norm(mirrored(view.transmitter_m, face) - view.receiver_m, axis=1)
        return point, np.where(seen > 0, view.radar.wavelength_m / (4 * np.pi * np.maximum(length, 1e-9)), 0.0)

    def _all(self, view: View, *, bound: bool) -> Paths | None:
        points, amplitudes = [], []
        for column, wall in walls(view):
            strength = reflected(wall, view.radar.center_frequency_hz)
            for face in faces(wall):
                seen = self._mirror(face, view) if self.params.infinite else self._finite(face, view, bound=bound)
                points.append(seen[0])
                amplitudes.append(strength * seen[1] * view.visibility[:, column])
        return view.echoes(np.stack(points, axis=1), np.stack(amplitudes, axis=1)) if points else None


class ClutterParams(Params):
    """How rough walls are."""

    per_m2: float = Field(0.5, gt=0, le=1000, description="Mean number of scatterers on a square metre of wall.")
    rcs_m2: float = Field(0.01, gt=0, description="Mean radar cross section of a scatterer.")
    depth_m: float = Field(0.1, ge=0, description="Scatterers stand out from the wall by up to this.")
    seed: int | None = Field(
        None, ge=0, description="Of a room whose scatterers are the same in all runs; drawn once a run if left out."
    )


class WallClutter(Term[ClutterParams]):
    """Weak echoes of sockets, frames and shelves: points scattered over the walls, drawn once a run or once for all.

    Their number is Poisson's, their cross section exponential (Swerling's first case), their places even; each echo
    follows the radar equation. They stand still in the world and are the same for all receivers.
    """

    shared = True
    of_place = True
    _scatterers: list[tuple[int, Face, FloatArray, ComplexArray]]

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Draw the scatterers of both sides of each wall."""
        p = self.params
        rng = rng if p.seed is None else np.random.Generator(np.random.SFC64(p.seed))
        self._scatterers = []
        for column, wall in walls(view):
            for face in faces(wall):
                count = rng.poisson(p.per_m2 * face.width_m * face.height_m)
                along, up = rng.uniform(-0.5, 0.5, (2, count, 1))
                out = rng.uniform(0, p.depth_m, (count, 1))
                place = face.center_m + along * face.width_m * face.across + out * face.normal
                place[:, 2:] += up * face.height_m
                root = np.sqrt(rng.exponential(p.rcs_m2, count)) * np.exp(2j * np.pi * rng.uniform(size=count))
                self._scatterers.append((column, face, place, root))
        return view

    def bound(self, view: View) -> float:
        """All scatterers of a frame in phase."""
        largest = [np.max(np.sum(np.abs(paths.amplitude), axis=1)) for paths in self._each(view)]
        return float(np.sum(largest))

    def paths(self, view: View, rng: np.random.Generator) -> Paths | None:
        """One path for each scatterer, from the sides of walls that face the radar."""
        parts = list(self._each(view))
        if not parts:
            return None
        names = ("delay_s", "amplitude", "azimuth_rad")
        return Paths(*(np.concatenate([getattr(one, name) for one in parts], axis=1) for name in names))

    def _each(self, view: View) -> Iterator[Paths]:
        for column, face, place, root in self._scatterers:
            out = np.linalg.norm(place - view.transmitter_m[:, None], axis=-1)
            back = np.linalg.norm(place - view.receiver_m[:, None], axis=-1)
            front = ((view.receiver_m - face.center_m) @ face.normal > 0) & (
                (view.transmitter_m - face.center_m) @ face.normal > 0
            )
            shown = (front * view.visibility[:, column])[:, None]
            scale = view.radar.wavelength_m / (4 * np.pi) ** 1.5
            yield view.echoes(place, shown * scale * root / np.maximum(out * back, 1e-6))
