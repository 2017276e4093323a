r"""Single echoes of objects, in free sight and by way of physical optics.

An upright flat face at distance ``r`` returns ``A = G lambda / (8 pi r) 2 |F_x F_z|``, with the reflection coefficient
``G`` and, along each side, ``F = (E(u_2) - E(u_1)) / 2`` from the Fresnel integral ``E = C + jS`` at the two edges,
``u = 2 x / sqrt(lambda r)``, where ``x`` counts from the point of mirror reflection. It is the two-way integral of
physical optics to second order (Born and Wolf, Principles of Optics, section 8.7), and holds between both limits: a
face much larger than ``sqrt(lambda r)`` is a mirror, ``G lambda / (8 pi r)``; a small one follows the radar equation
with ``sigma = 4 pi G^2 area^2 / lambda^2``. A tilted face is one whose point of mirror reflection lies off its centre:
far away the integral becomes ``sinc(2 width sin(tilt) / lambda)``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from pydantic import Field
from scipy.special import fresnel

from uwbbench.api import FloatArray, P, Params, Paths, SceneObject, Term, View
from uwbbench_datasets.simulator.materials import SHAPE_LOSS_DB, reflection
from uwbbench_datasets.simulator.shapes import Face, faces
from uwbbench_datasets.simulator.terms.object_echo import bearing_error_rad, fading, tail

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)
_LARGEST_INTEGRAL = 0.95
"""Above the largest ``|C(u) + jS(u)|``, which it takes at u = 1.21."""


class PlateParams(Params):
    """How flat faces reflect."""

    ripple: float = Field(0.1, ge=0, lt=1, description="Power is averaged over this part of the range to either side.")
    diffuse_db: float = Field(-15.0, description="Scattering of a face that mirrors elsewhere, against the mirror.")


def reflected(body: SceneObject, frequency_hz: float) -> complex:
    """Reflection coefficient of an object at normal incidence, less its loss.

    Where a scene does not say the loss, it is the fitted one of real bodies of the material, and none of walls.
    """
    usual_db = 0.0 if body.shape == "wall" else SHAPE_LOSS_DB.get(body.material, 0.0)
    loss_db = usual_db if body.loss_db is None else body.loss_db
    return reflection(body.material, frequency_hz, body.thickness_m) * 10 ** (-loss_db / 20)


class _Echo(Term[P]):
    """Echoes of objects of some shapes, each from one or more points of the body."""

    shapes: ClassVar[tuple[str, ...]]

    def _echo(self, body: SceneObject, view: View, *, bound: bool) -> tuple[FloatArray, FloatArray]:
        """Points (frames, n, 3) of a perfectly conducting body, and what isotropic antennas exchange by them.

        With ``bound``, an upper bound of these amplitudes (frames, n) that costs less.
        """
        raise NotImplementedError

    def _all(self, view: View, *, bound: bool) -> Paths | None:
        points, amplitudes, errors_rad = [], [], []
        for column, body in enumerate(view.objects):
            if body.shape in self.shapes:
                where, amplitude = self._echo(body, view, bound=bound)
                material = reflected(body, view.radar.center_frequency_hz)
                strength = material * amplitude * view.visibility[:, column, None]
                echoes = [(where, strength)]
                if body.fading is not None:
                    echoes = [(where, strength * fading(body, body.fading, view, bound=bound)[:, None])]
                if body.tail is not None:
                    echoes.append(tail(body, body.tail, where, strength, view, bound=bound))
                points += [where for where, _ in echoes]
                amplitudes += [strength for _, strength in echoes]
                errors_rad += [bearing_error_rad(body, view)] * sum(where.shape[1] for where, _ in echoes)
        if not points:
            return None
        paths = view.echoes(np.concatenate(points, axis=1), np.concatenate(amplitudes, axis=1))
        if not np.any(errors_rad):
            return paths
        return dataclasses.replace(paths, azimuth_rad=paths.azimuth_rad + np.stack(errors_rad, axis=1))

    def bound(self, view: View) -> float:
        """All echoes of a frame in phase, each at the most that its distance allows."""
        paths = self._all(view, bound=True)
        return 0.0 if paths is None else float(np.max(np.sum(np.abs(paths.amplitude), axis=1)))

    def paths(self, view: View, rng: np.random.Generator) -> Paths | None:
        """One path for each face or body."""
        return self._all(view, bound=False)


class PlateEcho(_Echo[PlateParams]):
    """Echoes of plates and boxes: Fresnel plates with a diffuse floor.

    The ideal plate's deep ripples over distance are smoothed by averaging power over part of the range.
    """

    shapes: ClassVar = ("plate", "box")

    def _echo(self, body: SceneObject, view: View, *, bound: bool) -> tuple[FloatArray, FloatArray]:
        echoes = [self._face(face, view, bound=bound) for face in faces(body)]
        seen = [one for one in echoes if np.any(one[1])] or echoes[:1]
        return np.stack([where for where, _ in seen], axis=1), np.stack([amplitude for _, amplitude in seen], axis=1)

    def _face(self, face: Face, view: View, *, bound: bool) -> tuple[FloatArray, FloatArray]:
        """Point (frames, 3) nearest to mirror reflection and amplitude (frames,) of a perfect conductor."""
        return face_echo(
            face,
            view.transmitter_m,
            view.receiver_m,
            view.radar.wavelength_m,
            ripple=self.params.ripple,
            diffuse=10 ** (self.params.diffuse_db / 20),
            bound=bound,
        )


class CylinderEcho(_Echo[Params]):
    """Echoes of rods and persons: upright cylinders, spread by their curvature.

    A mirror of radius ``a`` spreads the wave across by ``sqrt(a / (a + r))`` (geometrical optics); upwards the Fresnel
    integral holds. Far away this is the radar cross section ``2 pi a height^2 / lambda``.
    """

    shapes: ClassVar = ("rod", "person")

    def _echo(self, body: SceneObject, view: View, *, bound: bool) -> tuple[FloatArray, FloatArray]:
        radius_m, wavelength = body.width_m / 2, view.radar.wavelength_m
        offset = view.receiver_m - body.center_m
        across = np.linalg.norm(offset[:, :2], axis=1)
        height = np.clip(offset[:, 2], -body.height_m / 2, body.height_m / 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = np.where(across[:, None] > radius_m, offset[:, :2] / across[:, None] * radius_m, 0.0)
        points = body.center_m + np.column_stack([ahead, height])
        range_m = _mean_range(points, view.transmitter_m, view.receiver_m)
        edges = np.array([-1, 1]) * body.height_m / 2 - offset[:, 2, None]
        upward = _side(edges, range_m, wavelength, bound=bound)
        mirror = wavelength / (8 * np.pi * range_m) * np.sqrt(2 * radius_m / (radius_m + range_m)) * upward
        mirror = np.where(across > radius_m, mirror, 0.0)  # the robot drives through it: nothing sensible to return
        return points[:, None], mirror[:, None]


class PointParams(Params):
    """How points reflect."""

    rcs_m2: float = Field(0.1, gt=0, description="Radar cross section of a point of metal.")


class PointEcho(_Echo[PointParams]):
    """Echoes of points by the radar equation, ``lambda sqrt(sigma) / ((4 pi)^1.5 r_1 r_2)``."""

    shapes: ClassVar = ("point",)

    def _echo(self, body: SceneObject, view: View, *, bound: bool) -> tuple[FloatArray, FloatArray]:
        out = np.linalg.norm(body.center_m - view.transmitter_m, axis=1)
        back = np.linalg.norm(body.center_m - view.receiver_m, axis=1)
        scale = view.radar.wavelength_m * np.sqrt(self.params.rcs_m2) / (4 * np.pi) ** 1.5
        amplitude = scale / np.maximum(out * back, 1e-6)
        points = np.broadcast_to(body.center_m[..., None, :], (len(view), 1, 3))
        return points, amplitude[:, None]


def face_echo(
    face: Face,
    transmitter_m: FloatArray,
    receiver_m: FloatArray,
    wavelength_m: float,
    *,
    ripple: float = 0.0,
    diffuse: float = 0.0,
    bound: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Echo of one perfectly conducting face.

    Parameters
    ----------
    face : Face
    transmitter_m, receiver_m : (frames, 3) array
    wavelength_m : float
    ripple : float
        Power is averaged over this part of the range to either side.
    diffuse : float
        Amplitude of Lambert's scattering against that of the mirror; the larger of the two counts.
    bound : bool
        Give an upper bound of the amplitude instead, which costs less.

    Returns
    -------
    (frames, 3) array
        Point of the face nearest to that of mirror reflection.
    (frames,) array
        Amplitude; 0 where an antenna stands behind the face.
    """
    away_out = (transmitter_m - face.center_m) @ face.normal
    away_back = (receiver_m - face.center_m) @ face.normal
    front = (away_out > 0) & (away_back > 0)
    share = np.where(front, away_back, 1.0) / np.where(front, away_back + away_out, 2.0)
    meeting = receiver_m + share[:, None] * (transmitter_m - receiver_m) - face.center_m
    sides = (meeting @ face.across, meeting[:, 2])
    halves = (face.width_m / 2, face.height_m / 2)
    nearest = [np.clip(side, -half, half) for side, half in zip(sides, halves, strict=True)]
    points = face.center_m + nearest[0][:, None] * face.across + nearest[1][:, None] * np.array([0.0, 0.0, 1.0])
    amplitude = np.zeros(len(receiver_m))
    if not np.any(front):
        return points, amplitude
    range_m = _mean_range(points, transmitter_m, receiver_m)[front]
    edges = [np.array([-half, half]) - side[front, None] for side, half in zip(sides, halves, strict=True)]
    straight = [np.array([-half, half]) for half in halves]
    mirror = _fresnel_face(edges, range_m, wavelength_m, ripple, bound=bound)
    if diffuse:
        facing = np.sqrt(away_out[front] * away_back[front]) / range_m
        smooth = _fresnel_face(straight, range_m, wavelength_m, 0.0, bound=True)  # the bound has no ripples
        mirror = np.maximum(mirror, diffuse * facing * smooth)
    amplitude[front] = mirror
    return points, amplitude


def _mean_range(points: FloatArray, transmitter_m: FloatArray, receiver_m: FloatArray) -> FloatArray:
    """Harmonic mean (frames,) of the two legs, which takes the place of r where the antennas stand apart."""
    out = np.linalg.norm(points - transmitter_m, axis=1)
    back = np.linalg.norm(points - receiver_m, axis=1)
    return np.asarray(2 * out * back / np.maximum(out + back, 1e-9))


def _fresnel_face(
    edges: Sequence[FloatArray], range_m: FloatArray, wavelength_m: float, ripple: float, *, bound: bool
) -> FloatArray:
    if ripple and not bound:
        nodes = range_m[:, None] * (1 + ripple * _NODES)
        spread = [np.asarray(edge)[..., None, :] for edge in edges]
        power = _fresnel_face(spread, nodes, wavelength_m, 0.0, bound=False) ** 2
        return np.asarray(np.sqrt(power @ _WEIGHTS / 2))
    shortest = range_m * (1 - ripple)
    mirror = wavelength_m / (8 * np.pi * shortest)
    for edge in edges:
        mirror = mirror * np.sqrt(2) * _side(edge, shortest, wavelength_m, bound=bound)
    return np.asarray(mirror)


def _side(edges: FloatArray, range_m: FloatArray, wavelength_m: float, *, bound: bool) -> FloatArray:
    """``|E(u_2) - E(u_1)| / 2`` between two edges (..., 2), or an upper bound of it."""
    scale = 2 / np.sqrt(wavelength_m * range_m)
    low, high = edges[..., 0] * scale, edges[..., 1] * scale
    if bound:
        return np.asarray(np.minimum(_LARGEST_INTEGRAL, (high - low) / 2))
    (low_sine, low_cosine), (high_sine, high_cosine) = fresnel(low), fresnel(high)
    return np.asarray(np.hypot(high_sine - low_sine, high_cosine - low_cosine) / 2)
