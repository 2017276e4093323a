"""Echoes by way of two bodies: between objects, and in the corners of walls."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations, product

import numpy as np
from pydantic import Field

from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    BoolArray,
    ComplexArray,
    FloatArray,
    Params,
    Paths,
    SceneObject,
    Term,
    View,
    segments_cross,
)
from uwbbench_datasets.simulator.shapes import Face, faces
from uwbbench_datasets.simulator.terms.echo import reflected
from uwbbench_datasets.simulator.terms.scatterers import (
    Scatterers,
    extended,
    in_phase,
    joined,
    outline_points,
    own_stream,
)
from uwbbench_datasets.simulator.terms.walls import mirrored, reflection_point, walls

_SAME_M = 1e-9
"""Points nearer than this are one."""


class ObjectBounceParams(Params):
    """How strongly objects scatter towards each other."""

    rcs_m2: float = Field(0.5, gt=0, description="Radar cross section of an object of metal, from side to side.")
    points: int = Field(3, ge=1, le=100, description="Points of an object that it is spread over.")
    seed: int | None = Field(
        None, ge=0, description="Of objects whose points are the same in all runs; drawn once a run if left out."
    )


class ObjectBounce(Term[ObjectBounceParams]):
    r"""Echoes by way of two objects: from the transmitter to one, on to the other, and back to the receiver.

    The radar equation, applied twice, gives ``lambda sqrt(s_1 s_2) / ((4 pi)^2 r_1 r_12 r_2)`` for cross sections
    ``s_1`` and ``s_2`` of two points ``r_12`` apart: each scattering multiplies the field by ``sqrt(s / (4 pi))`` over
    the next leg. Cross sections go with the cosines of arrival and departure (Lambert), so that a point scatters what
    it faces, and with the material. The echo has the length of all three legs and the direction of the second object,
    behind which it shows a third that is not there. Both orders are there, each the other's reverse; exchanging
    transmitter and receiver exchanges them. A leg between objects is blocked by whatever else stands in it.
    """

    shared = True
    _drawn: dict[str, Scatterers]

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Draw the points of each object, with a phase each."""
        p = self.params
        seed = int(rng.integers(2**63)) if p.seed is None else p.seed
        self._drawn = {}
        for _, body in extended(view):
            own = own_stream(body, seed)
            offset, normal = outline_points(body, p.points, 0.0, own)
            root = np.sqrt(p.rcs_m2 / p.points) * np.exp(2j * np.pi * own.uniform(size=p.points))
            self._drawn[body.name] = Scatterers(offset, normal, root)
        return view

    def bound(self, view: View) -> float:
        """All bounces of a frame in phase."""
        return in_phase(self._each(view))

    def paths(self, view: View, rng: np.random.Generator) -> Paths | None:
        """One path for each ordered pair of points of two objects."""
        return joined(self._each(view))

    def _each(self, view: View) -> Iterator[Paths]:
        """Paths of each ordered pair of objects."""
        scale = view.radar.wavelength_m / (4 * np.pi) ** 2
        frequency = view.radar.center_frequency_hz
        transmitter, receiver = view.transmitter_m[:, None], view.receiver_m[:, None]
        for (first, one), (second, other) in permutations(extended(view), 2):
            near, far = self._drawn[one.name], self._drawn[other.name]
            start, end = _pairs(near.places_m(one), far.places_m(other))
            near, far = _repeated(near, len(far.root), each=True), _repeated(far, len(near.root), each=False)
            legs = [np.linalg.norm(way, axis=-1) for way in (start - transmitter, end - start, receiver - end)]
            cosines = near.facing(start, transmitter) * near.facing(start, end)
            cosines = cosines * far.facing(end, start) * far.facing(end, receiver)
            strength = reflected(one, frequency) * reflected(other, frequency) * near.root * far.root
            strength = scale * strength * np.sqrt(cosines) * ~_blocked(view, (one, other), start, end)
            seen = np.sqrt(view.visibility[:, first, None] * view.visibility[:, second, None])
            length = legs[0] + legs[1] + legs[2]
            spread = np.maximum(legs[0] * legs[1] * legs[2], 1e-6)
            yield _paths(view, length, seen * strength / spread, view.azimuth_rad(end))


class WallBounce(Term[Params]):
    """Echoes of corners: from the transmitter to one wall, on to another, and back to the receiver.

    The mirror image in both walls gives the length ``L`` of the way, its strength is ``G_1 G_2 lambda / (4 pi L)`` with
    the walls' reflection coefficients, and it shows in the direction of the second wall's point of reflection. An order
    is there while both points of reflection lie on their walls. A right-angled corner has one image, whatever the
    order, and so one order at a time; with both antennas above one another the orders are equal and share it. It flies
    as far as to the corner's edge and back, wherever the robot is: a reflector that stands still in the world.
    """

    def bound(self, view: View) -> float:
        """All corners of a frame in phase."""
        paths = self._all(view)
        return 0.0 if paths is None else float(np.max(np.sum(np.abs(paths.amplitude), axis=1)))

    def paths(self, view: View, rng: np.random.Generator) -> Paths | None:
        """One path for each ordered pair of sides of two walls."""
        return self._all(view)

    def _all(self, view: View) -> Paths | None:
        lengths, strengths, azimuths = [], [], []
        wavelength, frequency = view.radar.wavelength_m, view.radar.center_frequency_hz
        for (first, one), (second, other) in combinations(walls(view), 2):
            material = reflected(one, frequency) * reflected(other, frequency)
            seen = np.sqrt(view.visibility[:, first] * view.visibility[:, second])
            for near, far in product(faces(one), faces(other)):
                orders = _over_both(near, far, view), _over_both(far, near, view)
                twice = orders[0][1] & orders[1][1] & (np.abs(orders[0][0] - orders[1][0]) < _SAME_M)
                for length, shown, end in orders:
                    lengths.append(length)
                    share = np.where(twice, 0.5, shown)
                    strengths.append(share * seen * material * wavelength / (4 * np.pi * np.maximum(length, 1e-9)))
                    azimuths.append(view.azimuth_rad(end[:, None])[:, 0])
        if not lengths:
            return None
        return _paths(view, np.stack(lengths, axis=1), np.stack(strengths, axis=1), np.stack(azimuths, axis=1))


def _over_both(near: Face, far: Face, view: View) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Length (frames,) of the way over one face and then another, whether it is there, and its last point."""
    image = mirrored(view.transmitter_m, near)
    end, on_far = reflection_point(far, image, view.receiver_m, _SAME_M)
    _, on_near = reflection_point(near, view.transmitter_m, end, _SAME_M)
    length = np.linalg.norm(mirrored(image, far) - view.receiver_m, axis=1)
    return np.asarray(length), on_far & on_near, end


def _pairs(start_m: FloatArray, end_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Every point (frames or 1, n, 3) with every other (frames or 1, m, 3), as two arrays (frames or 1, n m, 3)."""
    start = np.repeat(start_m, end_m.shape[1], axis=1)
    end = np.tile(end_m, (1, start_m.shape[1], 1))
    return start, end


def _repeated(points: Scatterers, times: int, *, each: bool) -> Scatterers:
    """Points as :func:`_pairs` orders them."""
    index = np.arange(len(points.root))
    index = np.repeat(index, times) if each else np.tile(index, times)
    return Scatterers(points.offset_m[index], points.normal[index], points.root[index])


def _blocked(view: View, ends: tuple[SceneObject, SceneObject], start_m: FloatArray, end_m: FloatArray) -> BoolArray:
    """Whether each leg (frames or 1, n) between points of two objects crosses the outline of another one."""
    others = [body for body in view.objects if body not in ends and body.obstacle.outline_m.shape[-2] > 1]
    moving = len(start_m) > 1 or len(end_m) > 1 or any(body.obstacle.moves for body in others)
    shape = (len(view) if moving else 1, start_m.shape[1])
    start, end = (np.broadcast_to(one[..., :2], (*shape, 2)).reshape(-1, 2) for one in (start_m, end_m))
    blocked = np.zeros(len(start), bool)
    for body in others:
        outline = body.obstacle.outline_m[..., :2]
        blocked |= segments_cross(start, end, np.repeat(outline, shape[1], axis=0) if body.obstacle.moves else outline)
    return blocked.reshape(shape)


def _paths(view: View, length_m: FloatArray, strength: ComplexArray, azimuth_rad: FloatArray) -> Paths:
    """Paths (frames, n) of given lengths, with the receiving antenna's gain and the carrier's phase."""
    delay_s = (length_m - view.radar.baseline_length_m) / SPEED_OF_LIGHT_M_S
    carrier = np.exp(-2j * np.pi * view.radar.center_frequency_hz * delay_s)
    return Paths(delay_s, strength * view.receive_gain(azimuth_rad) * carrier, azimuth_rad)
