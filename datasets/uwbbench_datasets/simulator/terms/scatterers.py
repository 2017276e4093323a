"""Extended bodies: many scatterers along the outline, each with a phase of its own, that speckle."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from uwbbench.api import ComplexArray, FloatArray, Params, Paths, SceneObject, Term, View
from uwbbench_datasets.simulator.terms.echo import reflected


@dataclass(frozen=True)
class Scatterers:
    """Points of one body that scatter.

    Attributes
    ----------
    offset_m : (n, 3) array
        From the body's centre, in the axes of the world: a body that moves keeps its heading.
    normal : (n, 3) array
        Unit vectors outwards from the outline.
    root : (n,) complex array
        Root of the radar cross section of a point of metal that faces both antennas, with its phase.
    """

    offset_m: FloatArray
    normal: FloatArray
    root: ComplexArray

    def places_m(self, body: SceneObject) -> FloatArray:
        """Points (frames or 1, n, 3) in the world."""
        return np.asarray(np.atleast_2d(body.center_m)[:, None] + self.offset_m)

    def facing(self, places_m: FloatArray, others_m: FloatArray) -> FloatArray:
        """Cosine (frames, n) between a point's normal and the way to another one (frames or 1, 1 or n, 3); 0 behind it.

        Parameters
        ----------
        places_m : (frames or 1, n, 3) array
            As :meth:`places_m` gives them.
        others_m : (frames or 1, 1 or n, 3) array
        """
        way = others_m - places_m
        cosine = np.sum(way * self.normal, axis=-1) / np.maximum(np.linalg.norm(way, axis=-1), 1e-9)
        return np.asarray(np.maximum(cosine, 0.0))


def extended(view: View) -> Iterator[tuple[int, SceneObject]]:
    """Objects that have an outline and are no walls, with their column among the objects."""
    return ((column, body) for column, body in enumerate(view.objects) if body.shape not in ("wall", "point"))


def in_phase(parts: Iterable[Paths]) -> float:
    """Largest amplitude of a frame if all of its paths were in phase."""
    return float(np.sum([np.max(np.sum(np.abs(one.amplitude), axis=1)) for one in parts]))


def joined(parts: Iterable[Paths]) -> Paths | None:
    """All paths side by side; None where there are none."""
    each = list(parts)
    if not each:
        return None
    names = ("delay_s", "amplitude", "azimuth_rad")
    return Paths(*(np.concatenate([getattr(one, name) for one in each], axis=1) for name in names))


def outline_points(
    body: SceneObject, count: int, depth_m: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Points scattered evenly along the outline of a body and over its height.

    Parameters
    ----------
    body : SceneObject
    count : int
    depth_m : float
        They lie behind the outline by up to this.
    rng : Generator

    Returns
    -------
    (count, 3) array
        Offsets from the body's centre at its first place.
    (count, 3) array
        Unit normals outwards.
    """
    corners = np.asarray(body.obstacle.outline_m).reshape(-1, *np.shape(body.obstacle.outline_m)[-2:])[0][:, :2]
    corners = corners - np.atleast_2d(body.center_m)[0, :2]
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(edges, axis=1)
    side = rng.choice(len(edges), count, p=lengths / lengths.sum())
    area = np.sum(corners[:, 0] * np.roll(corners[:, 1], -1) - corners[:, 1] * np.roll(corners[:, 0], -1))
    outwards = np.sign(area) * np.stack([edges[:, 1], -edges[:, 0]], axis=1) / lengths[:, None]
    deep = rng.uniform(0, depth_m, (count, 1))
    flat = corners[side] + rng.uniform(size=(count, 1)) * edges[side] - deep * outwards[side]
    upward = rng.uniform(-0.5, 0.5, count) * body.height_m
    return np.column_stack([flat, upward]), np.column_stack([outwards[side], np.zeros(count)])


def own_stream(body: SceneObject, seed: int) -> np.random.Generator:
    """Random stream of one object of a run, whatever else is in the scene."""
    key = zlib.crc32(body.name.encode())
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=(key,))))


class ScattererParams(Params):
    """How rough bodies are."""

    per_m: float = Field(25.0, gt=0, le=1000, description="Mean number of scatterers on a metre of outline.")
    rcs_m2: float = Field(
        1.0, gt=0, description="Mean radar cross section of a metre of metal outline that faces the radar."
    )
    depth_m: float = Field(0.03, ge=0, description="Scatterers lie behind the outline by up to this.")
    seed: int | None = Field(
        None, ge=0, description="Of objects whose scatterers are the same in all runs; drawn once a run if left out."
    )


class ScattererEcho(Term[ScattererParams]):
    r"""Echoes of rough bodies: scatterers along the outlines of all objects but points and walls.

    Their number is Poisson's, their places even, their amplitudes circular Gaussian, so that the sum over those in one
    resolution cell is fully developed speckle (Goodman, Speckle Phenomena in Optics, chapter 2): its power is
    exponential and becomes another when the robot has moved so far that the phases of the outermost ones have turned
    against each other, about ``lambda r / (2 width)``. Each follows the radar equation,
    ``lambda sqrt(sigma) / ((4 pi)^1.5 r_1 r_2)``, with ``sigma`` less by Lambert's law,
    ``cos(incidence) cos(departure)``, and by the material's reflection and loss. The mean power of the sum is thus the
    integral of ``rcs_m2`` along what is seen of the outline. It comes beside the mirror echo of ``echo.plate`` and
    ``echo.cylinder``, which a scene may weaken by ``loss_db`` or leave out. All receivers see the same scatterers.
    """

    shared = True
    _drawn: dict[str, Scatterers]

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Draw the scatterers of each object."""
        p = self.params
        seed = int(rng.integers(2**63)) if p.seed is None else p.seed
        self._drawn = {}
        for _, body in extended(view):
            own = own_stream(body, seed)
            corners = body.obstacle.outline_m.reshape(-1, *body.obstacle.outline_m.shape[-2:])[0]
            perimeter = float(np.sum(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)))
            count = int(own.poisson(p.per_m * perimeter))
            offset, normal = outline_points(body, count, p.depth_m, own)
            parts = own.normal(size=(2, count)) * np.sqrt(p.rcs_m2 / p.per_m / 2)
            self._drawn[body.name] = Scatterers(offset, normal, parts[0] + 1j * parts[1])
        return view

    def bound(self, view: View) -> float:
        """All scatterers of a frame in phase."""
        return in_phase(self._each(view))

    def paths(self, view: View, rng: np.random.Generator) -> Paths | None:
        """One path for each scatterer."""
        return joined(self._each(view))

    def _each(self, view: View) -> Iterator[Paths]:
        scale = view.radar.wavelength_m / (4 * np.pi) ** 1.5
        for column, body in extended(view):
            drawn = self._drawn[body.name]
            place = drawn.places_m(body)
            transmitter, receiver = view.transmitter_m[:, None], view.receiver_m[:, None]
            out, back = np.linalg.norm(place - transmitter, axis=-1), np.linalg.norm(place - receiver, axis=-1)
            shown = np.sqrt(drawn.facing(place, transmitter) * drawn.facing(place, receiver))
            material = reflected(body, view.radar.center_frequency_hz) * view.visibility[:, column, None]
            yield view.echoes(place, scale * material * drawn.root * shown / np.maximum(out * back, 1e-6))
