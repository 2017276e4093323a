"""Rooms of facets, drawn and synthesised in the frequency domain.

The transfer function of all ways, times a transmitter's spectrum that no textbook names, goes back to the taps by a
Fourier sum. Objects, ways, robot and radio are drawn from a seed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tests.generators.driving import encoders, steered
from tests.generators.facets import (
    BASEBAND_HZ,
    Antennas,
    Facets,
    Ways,
    bounced,
    cut,
    hidden,
    image,
    polygon,
    scattered,
    transfer,
)
from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    Capture,
    ComplexArray,
    FloatArray,
    IntArray,
    Obstacle,
    Radar,
    Trajectory,
    Truth,
)

TAPS, CREST, RATE_HZ = 50, 7.0, 50.0
TAP_S = 1 / (2 * 499.2e6)
CARRIER_HZ = {5: 6489.6e6, 9: 7987.2e6}
REFLECTION = {"metal": 1.0, "concrete": 0.38, "plywood": 0.24, "cardboard": 0.1}
STRUCTURE = "plaster"
CHUNK = 250


@dataclass(frozen=True)
class Room:
    """What was drawn of one room.

    Attributes
    ----------
    half_m : (2,) array
        Half of its sides.
    outlines : list of (corners, 2) array
    materials : list of str
    facets : Facets
    poses : (frames, 3) array
    """

    half_m: FloatArray
    outlines: list[FloatArray]
    materials: list[str]
    facets: Facets
    poses: FloatArray


def drawn(rng: np.random.Generator) -> Room:
    """A room with its objects and a way through it, drawn until the robot keeps clear of everything."""
    while True:
        half = np.array([rng.uniform(2.4, 4.0), rng.uniform(2.2, 3.2)])
        materials = ["metal", *rng.choice(list(REFLECTION), int(rng.integers(3, 6)))]
        kinds = rng.choice(["box", "round", "angle", "many"], len(materials))
        outlines: list[FloatArray] = []
        for kind in kinds:
            shape = polygon(str(kind), rng)
            for _ in range(200):
                moved = shape + rng.uniform(-1, 1, 2) * (half - 0.45)
                if all(np.min(np.linalg.norm(moved[:, None] - o, axis=2)) > 0.45 for o in outlines):
                    outlines.append(moved)
                    break
        points = rng.uniform(-1, 1, (6, 2)) * (half - 0.6)
        legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if len(outlines) < len(materials) or legs.min() < 0.8 or legs.max() > 4:
            continue
        halts = {int(leg): float(rng.uniform(1.5, 4)) for leg in rng.choice(np.arange(1, 6), 2, replace=False)}
        speed, turn = rng.uniform(0.2, 0.45), np.radians(rng.uniform(40, 100))
        rough = [rng.uniform(2e-3, 8e-3) for _ in outlines]
        cuts = [
            cut(outline, REFLECTION[m], i, r, rng)
            for i, (outline, m, r) in enumerate(zip(outlines, materials, rough, strict=True))
        ]
        facets = Facets(*(np.concatenate([getattr(c, name) for c in cuts]) for name in cuts[0].__dataclass_fields__))
        straight = np.concatenate([np.linspace(*leg, 40) for leg in pairwise(points)])
        if np.min(np.linalg.norm(straight[:, None] - facets.center_m, axis=2)) < 0.15:
            continue  # steering takes a while, and would not save it
        poses = steered(points, speed, turn, halts, RATE_HZ)
        near = min(np.min(np.linalg.norm(p[:2] - facets.center_m, axis=1)) for p in poses[::5])
        if near > 0.4 and np.all(np.abs(poses[:, :2]) < half - 0.3):
            return Room(half, outlines, [str(one) for one in materials], facets, poses)


def spectrum(rng: np.random.Generator) -> ComplexArray:
    """Transmitter and receiver filters (frequencies,): a flat top with soft edges, tilted and bent, and a copy."""
    half, soft = rng.uniform(160e6, 230e6), rng.uniform(40e6, 60e6)
    level = 1 / (1 + np.exp((np.abs(BASEBAND_HZ) - half) / soft))
    tilt = 10 ** (rng.uniform(-4, 4) * BASEBAND_HZ / 500e6 / 20)
    bend = rng.uniform(-0.5, 0.5, 2) @ np.stack([(BASEBAND_HZ / 250e6) ** 2, (BASEBAND_HZ / 250e6) ** 3])
    ripple = 1 + rng.uniform(0, 0.12) * np.exp(-2j * np.pi * (BASEBAND_HZ * rng.uniform(3e-9, 7e-9) + rng.uniform()))
    shape = level * tilt * ripple * np.exp(1j * bend)
    return shape / np.abs(shape.sum())


def ringing(rng: np.random.Generator) -> ComplexArray:
    """Transfer function (frequencies,) of what the robot's chassis adds to the direct path: damped resonances."""
    total = np.zeros(len(BASEBAND_HZ), complex)
    for _ in range(5):
        center, damping = rng.uniform(-250e6, 250e6), 1 / rng.uniform(1.2e-9, 5e-9)
        size = 10 ** (-rng.uniform(8, 18) / 20) * np.exp(2j * np.pi * rng.uniform())
        total += size * damping / (2j * np.pi * (BASEBAND_HZ - center) + damping)
    late = np.exp(-2j * np.pi * BASEBAND_HZ * rng.uniform(0.3e-9, 1.5e-9))
    return total * late


def ways_of(room: Room, seen: FloatArray, a: Antennas, wall: float, clutter: FloatArray, spots: IntArray) -> list[Ways]:
    """All ways of some frames but the direct one.

    Parameters
    ----------
    room : Room
    seen : (frames, facets) array
        What passes to each facet, in amplitude.
    a : Antennas
    wall : float
        Reflection of a wall's first sheet; a second one stands behind it.
    clutter : (n, 3) array
        Places on the walls, with the root of the cross section of each.
    spots : (n,) int array
        Facets that bounce.
    """
    every = [_weaker(scattered(room.facets, a.out_m, a.back_m, a.wavelength_m), seen)]
    coarse = np.arange(0, len(room.facets.body), 2)
    half_as_many = room.facets.some(coarse)
    half_as_many = replace(half_as_many, length_m=2 * half_as_many.length_m)
    for side in range(4):
        for sheet, share in ((0.0, 1.0), (0.09, 0.7)):
            behind = image(a.out_m, side, room.half_m + sheet)
            length = np.linalg.norm(behind - a.back_m, axis=1)[:, None]
            every.append(Ways(length, share * wall * a.wavelength_m / (4 * np.pi * length) + 0j, behind[:, None]))
        corner = image(image(a.out_m, side, room.half_m), (side + 1) % 4, room.half_m)
        length = np.linalg.norm(corner - a.back_m, axis=1)[:, None]
        every.append(Ways(length, wall**2 * a.wavelength_m / (4 * np.pi * length) + 0j, corner[:, None]))
        out, back = image(a.out_m, side, room.half_m), image(a.back_m, side, room.half_m)
        mirrored = image(half_as_many.center_m, side, room.half_m)[None]
        for start, end, strength, last in (
            (out, a.back_m, wall, None),
            (a.out_m, back, wall, mirrored),
            (out, back, wall**2, mirrored),
        ):
            ghost = scattered(half_as_many, start, end, a.wavelength_m)
            shown = Ways(ghost.length_m, ghost.strength * strength, ghost.last_m if last is None else last)
            every.append(_weaker(shown, seen[:, coarse]))
    legs = [np.linalg.norm(clutter[:, :2] - one[:, None], axis=2) for one in (a.out_m, a.back_m)]
    strength = clutter[:, 2] * a.wavelength_m / ((4 * np.pi) ** 1.5 * legs[0] * legs[1])
    every.append(Ways(legs[0] + legs[1], strength + 0j, clutter[None, :, :2]))
    bodies = room.facets.body[spots]
    for near in range(len(room.outlines)):
        for far in set(range(len(room.outlines))) - {near}:
            pair = spots[bodies == near], spots[bodies == far]
            one, two = (replace(room.facets.some(index), length_m=np.full(len(index), 0.08)) for index in pair)
            bounce = bounced(one, two, a.out_m, a.back_m, a.wavelength_m)
            passed = np.sqrt(
                np.tile(seen[:, pair[0]], len(pair[1])) * np.repeat(seen[:, pair[1]], len(pair[0]), axis=1)
            )
            every.append(_weaker(bounce, passed))
    return every


def _weaker(ways: Ways, factor: FloatArray) -> Ways:
    return Ways(ways.length_m, ways.strength * factor, ways.last_m)


def turned(vector: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """A vector of the robot (2,) in the world (frames, 2)."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.stack([vector[0] * cos - vector[1] * sin, vector[0] * sin + vector[1] * cos], axis=1)


def made(seed: int) -> Capture:
    """One room, drawn and synthesised; everything follows from the seed."""
    rng = np.random.default_rng([90210, seed])
    room, channel = drawn(rng), int(rng.choice([5, 9]))
    wavelength = SPEED_OF_LIGHT_M_S / CARRIER_HZ[channel]
    poses, frames = room.poses, len(room.poses)
    apart, angle = rng.uniform(0.13, 0.26), float(rng.choice([np.pi / 2, -np.pi / 2, np.pi, rng.uniform(-1, 1)]))
    mount = -apart / 2 * np.array([np.cos(angle), np.sin(angle)])
    looks, spacing = float(rng.choice([0.0, 0.0, 0.0, np.pi / 2])), 0.0178
    yaw = poses[:, 2]
    back = poses[:, :2] + turned(mount, yaw)
    antennas = Antennas(
        out_m=poses[:, :2] + turned(-mount, yaw),
        back_m=back,
        second_m=back + turned(spacing * np.array([-np.sin(looks), np.cos(looks)]), yaw),
        boresight_rad=yaw + looks,
        back=10 ** (-rng.uniform(8, 14) / 20),
        gain=10 ** (rng.uniform(4, 7) / 20),
        wavelength_m=wavelength,
    )
    direct = wavelength / (4 * np.pi * apart) * 10 ** (-rng.uniform(6, 12) / 20)
    shape = spectrum(rng)
    chassis = ringing(rng)
    own = [chassis, chassis + 0.2 * ringing(rng), chassis + 0.35 * ringing(rng)]
    side, along = rng.integers(4, size=9), rng.uniform(-1, 1, 9)
    places = np.where((side % 2 == 0)[:, None], np.array([[1, 0]]) * np.where(side < 2, 1, -1)[:, None], 0)
    places = places + np.where((side % 2 == 1)[:, None], np.array([[0, 1]]) * np.where(side < 2, 1, -1)[:, None], 0)
    places = np.where(places == 0, along[:, None], places) * room.half_m
    clutter = np.column_stack([places, np.sqrt(rng.exponential(0.01, 9))])
    spots = np.concatenate([rng.choice(np.flatnonzero(room.facets.body == i), 4) for i in range(len(room.outlines))])
    wall = 10 ** (-rng.uniform(9, 15) / 20)
    bearing = np.exp(-2j * np.pi * (np.linalg.norm(antennas.out_m - antennas.second_m, axis=1) - apart) / wavelength)
    crest = CREST + rng.uniform(-0.5, 0.5, frames)
    noise, faults = 10 ** (-rng.uniform(43, 52) / 20), np.radians(rng.normal(0, 5))
    taps = np.empty((3, frames, TAPS), complex)
    for start in range(0, frames, CHUNK):
        rows = slice(start, min(start + CHUNK, frames))
        here = antennas.part(rows)
        covered = hidden(here.back_m, room.facets.center_m, room.facets.body, room.outlines)
        seen = np.where(covered, 0.12, 1.0)
        total = np.zeros((2, rows.stop - rows.start, len(BASEBAND_HZ)), complex)
        for ways in ways_of(room, seen, here, wall, clutter, spots):
            carrier = np.exp(-2j * np.pi * (ways.length_m - apart) / wavelength)
            for number, gain in enumerate(here.both(ways)):
                total[number] += transfer(ways, gain * carrier / direct, apart)
        when_s = (np.arange(TAPS) - crest[rows, None]) * TAP_S
        basis = np.exp(2j * np.pi * when_s[:, None] * BASEBAND_HZ[:, None])
        for number, antenna in enumerate((0, 0, 1)):
            phase = bearing[rows, None] if antenna else 1.0
            whole = shape * (phase * (1 + own[number]) + total[antenna] * (np.exp(1j * faults) if antenna else 1.0))
            taps[number, rows] = np.einsum("fk,fkt->ft", whole, basis)
    gain = 10 ** (rng.normal(0, 0.4, (frames, 1)) / 20) * np.exp(2j * np.pi * rng.uniform(size=(frames, 1)))
    for number, level in enumerate((1.0, 1.5, 1.5)):
        white = rng.standard_normal((2, frames, TAPS))
        taps[number] = gain * (taps[number] + level * noise * (white[0] + 1j * white[1]) / np.sqrt(2))
    return _capture(seed, channel, room, taps, (mount, looks, spacing), rng)


def _capture(
    seed: int,
    channel: int,
    room: Room,
    taps: ComplexArray,
    mounted: tuple[FloatArray, float, float],
    rng: np.random.Generator,
) -> Capture:
    """The recording with its truth and odometry."""
    mount, looks, spacing = mounted
    frames = len(room.poses)
    radar = Radar(
        model="simulated by facets",
        center_frequency_hz=CARRIER_HZ[channel],
        bandwidth_hz=499.2e6,
        sample_interval_s=TAP_S,
        frame_rate_hz=RATE_HZ,
        taps=TAPS,
        channel=channel,
        receiver="front",
        mount_position_m=(float(mount[0]), float(mount[1]), 0.0),
        mount_yaw_rad=looks,
        tx_position_m=(-float(mount[0]), -float(mount[1]), 0.0),
        noise_taps=3,
        array_spacing_m=spacing,
        has_sts=True,
    )
    objects = [Obstacle(f"{m}-{i}", m, o) for i, (m, o) in enumerate(zip(room.materials, room.outlines, strict=True))]
    corners = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]]) * room.half_m
    walls = [Obstacle(n, STRUCTURE, np.roll(corners, -i, axis=0)[:2], structure=True) for i, n in enumerate("ENWS")]
    believed = encoders(room.poses, int(rng.poisson(2)), rng)
    flat = np.zeros((frames, 1))
    return Capture(
        name=f"facets-{seed}",
        radar=radar,
        trajectory=Trajectory(np.arange(frames) / RATE_HZ, np.hstack([room.poses[:, :2], flat]), room.poses[:, 2]),
        truth=Truth((*objects, *walls)),
        source="simulated",
        license="BSD-3-Clause",
        citation="Simulated by physical optics on facets, apart from the simulator.",
        recording=f"facets/{seed}",
        preamble=taps[0].astype(np.complex64),
        sts1=taps[1].astype(np.complex64),
        sts2=taps[2].astype(np.complex64),
        odometry_position_m=np.hstack([believed[:, :2], flat]),
        odometry_yaw_rad=believed[:, 2],
        receivers=("front",),
    )
