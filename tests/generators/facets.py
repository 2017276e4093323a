"""Physical optics of facets: what comes back from rough bodies, by way of others, and how it adds up over frequencies.

Nothing here is taken from the simulator that is shipped. Bodies are polygons, cut into facets a few centimetres long
that are displaced at random (roughness), so that mirror echoes, edges and speckle all come from one coherent sum:
a facet of area ``A`` gives ``G A cos / (4 pi r_1 r_2) sinc(l (sin_1 + sin_2) / lambda)``, the far field of physical
optics; its height counts as far as the first Fresnel zone does. Facets are hidden one by one. Every way from antenna to
antenna has a delay and a strength, and adds to a transfer function. The second antenna stands where it stands: its
phase follows from the distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uwbbench.api import SPEED_OF_LIGHT_M_S, BoolArray, ComplexArray, FloatArray, IntArray

PERIOD_S, LATEST_S = 100e-9, 62e-9
"""Time after which a Fourier sum repeats, and the latest way that is added, which must not come round again."""
BASEBAND_HZ = (np.arange(80) - 40) / PERIOD_S
FACET_M = 0.03


@dataclass(frozen=True)
class Facets:
    """Pieces of surface.

    Attributes
    ----------
    center_m, normal : (n, 2) array
    length_m, height_m : (n,) array
    strength : (n,) array
        Reflection of the material.
    body : (n,) int array
        Number of the object that each belongs to.
    """

    center_m: FloatArray
    normal: FloatArray
    length_m: FloatArray
    height_m: FloatArray
    strength: FloatArray
    body: IntArray

    def some(self, index: IntArray) -> Facets:
        """Those of some numbers."""
        return Facets(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Ways:
    """Ways of the signal: length (frames, n), strength without phase (frames, n), last point (frames or 1, n, 2)."""

    length_m: FloatArray
    strength: ComplexArray
    last_m: FloatArray


def polygon(kind: str, rng: np.random.Generator) -> FloatArray:
    """Outline (corners, 2) about the origin, counter-clockwise."""
    if kind == "round":
        angle, radius = np.arange(20) * np.pi / 10, rng.uniform(0.07, 0.2)
        return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if kind == "angle":  # a corner of shelves, which is not convex
        long, deep = rng.uniform(0.35, 0.6), rng.uniform(0.15, 0.22)
        shape = np.array([[0, 0], [long, 0], [long, deep], [deep, deep], [deep, long], [0, long]]) - long / 3
    elif kind == "many":
        angle = np.sort(rng.uniform(0, 2 * np.pi, 7))
        shape = rng.uniform(0.18, 0.35) * np.stack([np.cos(angle), 0.7 * np.sin(angle)], axis=1)
        if np.max(np.diff(np.append(angle, angle[0] + 2 * np.pi))) > 0.9 * np.pi:
            return polygon(kind, rng)
    else:
        half = np.array([rng.uniform(0.12, 0.4), rng.uniform(0.1, 0.25)])
        shape = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    turn = rng.uniform(0, 2 * np.pi)
    return shape @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])


def cut(outline: FloatArray, strength: float, body: int, rough_m: float, rng: np.random.Generator) -> Facets:
    """Facets of a body with a rough surface, whose heights are alike over about two facets."""
    parts = []
    for start, edge in zip(outline, np.roll(outline, -1, axis=0) - outline, strict=True):
        length = float(np.linalg.norm(edge))
        count = max(1, int(np.ceil(length / FACET_M)))
        out = np.array([edge[1], -edge[0]]) / length
        share = (np.arange(count)[:, None] + 0.5) / count
        parts.append(np.column_stack([start + share * edge, np.tile([*out, length / count], (count, 1))]))
    every = np.concatenate(parts)
    white = rng.standard_normal(len(every) + 1)
    depth = rough_m * (white[1:] + white[:-1]) / np.sqrt(2)
    center = every[:, :2] + depth[:, None] * every[:, 2:4]
    height = np.full(len(every), rng.uniform(0.4, 1.6))
    loss = strength * 10 ** (-rng.uniform(0, 2) / 20)
    return Facets(center, every[:, 2:4], every[:, 4], height, np.full(len(every), loss), np.full(len(every), body))


def hidden(eye_m: FloatArray, points_m: FloatArray, own: IntArray, outlines: list[FloatArray]) -> BoolArray:
    """Whether each point (n, 2) is hidden from each place (frames, 2) by the outline of another body."""
    blocked = np.zeros((len(eye_m), len(points_m)), bool)
    ray = points_m - eye_m[:, None]
    for number, outline in enumerate(outlines):
        others = np.flatnonzero(own != number)
        way = ray[:, others]
        cut_here = np.zeros(way.shape[:2], bool)
        for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            side = [way[..., 0] * (p - eye_m)[:, None, 1] - way[..., 1] * (p - eye_m)[:, None, 0] for p in (start, end)]
            edge = end - start
            beyond = [edge[0] * (q[..., 1] - start[1]) - edge[1] * (q[..., 0] - start[0]) for q in (eye_m, points_m)]
            cut_here |= (side[0] * side[1] < 0) & (beyond[0][:, None] * beyond[1][others] < 0)
        blocked[:, others] |= cut_here
    return blocked


def scattered(facets: Facets, out_m: FloatArray, back_m: FloatArray, wavelength_m: float) -> Ways:
    """Physical optics of facets between a transmitter and a receiver (frames, 2)."""
    legs, cosines, sines = [], [], []
    tangent = np.stack([-facets.normal[:, 1], facets.normal[:, 0]], axis=1)
    for antenna in (out_m, back_m):
        way = antenna[:, None] - facets.center_m
        distance = np.maximum(np.linalg.norm(way, axis=2), 0.05)
        legs.append(distance)
        cosines.append(np.maximum(np.sum(way * facets.normal, axis=2) / distance, 0))
        sines.append(np.sum(way * tangent, axis=2) / distance)
    zone = np.sqrt(wavelength_m * legs[0] * legs[1] / (legs[0] + legs[1]))
    area = facets.length_m * np.minimum(facets.height_m, zone)
    pattern = np.sinc(facets.length_m * (sines[0] + sines[1]) / wavelength_m)
    facing = np.where(cosines[0] * cosines[1] > 0, (cosines[0] + cosines[1]) / 2, 0.0)
    strength = facets.strength * area * facing * pattern / (4 * np.pi * legs[0] * legs[1])
    return Ways(legs[0] + legs[1], strength + 0j, facets.center_m[None])


def bounced(near: Facets, far: Facets, out_m: FloatArray, back_m: FloatArray, wavelength_m: float) -> Ways:
    """Ways by two bodies, facet by facet: each radiates as an aperture of its area, ``A cos / (lambda r)``."""
    first, second = (one.ravel() for one in np.meshgrid(np.arange(len(near.body)), np.arange(len(far.body))))
    one, two = near.some(first), far.some(second)
    between = two.center_m - one.center_m
    gap = np.maximum(np.linalg.norm(between, axis=1), 0.1)
    lengths, cosine = [gap[None]], np.ones((1, len(gap)))
    for antenna, facet, way in ((out_m, one, between), (back_m, two, -between)):
        leg = antenna[:, None] - facet.center_m
        distance = np.maximum(np.linalg.norm(leg, axis=2), 0.1)
        lengths.append(distance)
        here = np.maximum(np.sum(leg * facet.normal, axis=2) / distance, 0)
        there = np.maximum(np.sum(way * facet.normal, axis=1) / gap, 0)
        cosine = cosine * np.sqrt(here * there)
    area = [facet.length_m * np.minimum(facet.height_m, 0.15) for facet in (one, two)]
    spread = lengths[0] * lengths[1] * lengths[2]
    strength = one.strength * two.strength * area[0] * area[1] * cosine / (4 * np.pi * wavelength_m * spread)
    return Ways(lengths[0] + lengths[1] + lengths[2], strength + 0j, two.center_m[None])


def image(points_m: FloatArray, wall: int, half_m: FloatArray) -> FloatArray:
    """Points (..., 2) behind one of the walls, which lie at +x, +y, -x and -y."""
    axis, place = wall % 2, half_m[wall % 2] * (1 if wall < 2 else -1)
    mirrored = np.array(points_m, float)
    mirrored[..., axis] = 2 * place - mirrored[..., axis]
    return mirrored


def transfer(ways: Ways, antenna: ComplexArray, origin_m: float) -> ComplexArray:
    """Transfer function (frames, frequencies) of ways, times antenna gains and phases (frames, ways)."""
    late_s = (ways.length_m - origin_m) / SPEED_OF_LIGHT_M_S
    strength = np.where(late_s < LATEST_S, ways.strength * antenna, 0)
    step = np.exp(-2j * np.pi * (BASEBAND_HZ[1] - BASEBAND_HZ[0]) * late_s)
    turned = strength * np.exp(-2j * np.pi * BASEBAND_HZ[0] * late_s)
    total = np.empty((len(late_s), len(BASEBAND_HZ)), complex)
    for index in range(len(BASEBAND_HZ)):
        total[:, index] = turned.sum(axis=1)
        turned *= step
    return total


@dataclass(frozen=True)
class Antennas:
    """Where they are in each frame, and what they do to a way.

    Attributes
    ----------
    out_m, back_m, second_m : (frames, 2) array
        Transmitter, receiver, and the receiver's second antenna.
    boresight_rad : (frames,) array
    back : float
        Amplitude of the pattern's back against its front.
    gain : float
        Amplitude of an echo from ahead against the direct path's share.
    wavelength_m : float
    """

    out_m: FloatArray
    back_m: FloatArray
    second_m: FloatArray
    boresight_rad: FloatArray
    back: float
    gain: float
    wavelength_m: float

    def part(self, rows: slice) -> Antennas:
        """Some frames."""
        names = ("out_m", "back_m", "second_m", "boresight_rad")
        return Antennas(*(getattr(self, n)[rows] for n in names), self.back, self.gain, self.wavelength_m)

    def first(self, ways: Ways) -> ComplexArray:
        """Gain (frames, n) of the receiver towards the last point of ways: a cardioid's power, with a ripple."""
        way = ways.last_m - self.back_m[:, None]
        off = np.arctan2(way[..., 1], way[..., 0]) - self.boresight_rad[:, None]
        lobe = self.back + (1 - self.back) * ((1 + np.cos(off)) / 2) ** 1.2
        return self.gain * lobe * (1 + 0.06 * np.cos(3 * off + 1)) + 0j

    def both(self, ways: Ways) -> tuple[ComplexArray, ComplexArray]:
        """Gains (frames, n) of both antennas; the second's has the phase of its own distance."""
        first = self.first(ways)
        further = np.linalg.norm(ways.last_m - self.second_m[:, None], axis=2)
        further = further - np.linalg.norm(ways.last_m - self.back_m[:, None], axis=2)
        return first, first * np.exp(-2j * np.pi * further / self.wavelength_m)
