"""Hard rooms drawn at random: what each holds, how it is driven through, and with which robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Capture, CaptureError, Card, Dataset, FloatArray, Params, nearest
from uwbbench_datasets.simulator.engine import simulate
from uwbbench_datasets.simulator.scene import scene_of

CLEAR_OF_WALLS_M, CLEAR_OF_OBJECTS_M, BETWEEN_OBJECTS_M = 0.6, 0.35, 0.3
"""What the robot's middle and the objects keep clear of."""
LEGS = 5
_TRIES = 400
_MATERIALS = ("metal", "concrete", "plywood", "chipboard", "glass")
_WALLS = {"plasterboard": 0.0125, "brick": 0.1, "concrete": 0.15}
"""Materials of walls with their thickness in metres."""

Values = dict[str, Any]


class HardRoomsParams(Params):
    """Which rooms."""

    seed: int = Field(1, ge=0, description="Of all draws; each room has draws of its own.")
    count: int = Field(40, ge=1, le=10_000, description="Number of rooms; a room does not depend on it.")


class HardRooms(Dataset[HardRoomsParams]):
    """Simulated hard rooms, drawn at random (made when opened, no download).

    Every room has walls, four to six objects of several materials, among them a weak one beside a strong one, whose
    faces reflect 20 to 30 dB apart; and a robot that drives five legs, turns on the spot between them, stands still
    twice for seconds, and slips. Objects speckle (``echo.scatterers``), bounce echoes to each other and hide each
    other; corners shine. Channel, pulse with or without a tail, antennas, ringing, noise and array errors are the
    room's own. Captures are named ``hard-rooms-SEED/NUMBER``.
    """

    card: ClassVar[Card] = Card(
        title="Simulated hard rooms, drawn at random",
        license="BSD-3-Clause",
        citation="Model terms after arXiv 2512.01018 (setting) and ITU-R P.2040-3 (materials).",
        source="built in",
        origin="simulated",
    )

    def names(self) -> list[str]:
        """One capture a room."""
        return [f"hard-rooms-{self.params.seed}/{number}" for number in range(1, self.params.count + 1)]

    def open(self, name: str) -> Capture:
        """Draw and simulate one room.

        Raises
        ------
        CaptureError
            If there is no such room.
        """
        names = self.names()
        if name not in names:
            raise CaptureError(f"no hard room '{name}'.{nearest(name, names)}")
        number = names.index(name) + 1
        scene = scene_of(name.rpartition("/")[0], drawn_room(self.params.seed, number))
        return simulate(scene, number).captures[0]


def drawn_room(seed: int, number: int) -> Values:
    """Values of one room, as a scene file would have them.

    Parameters
    ----------
    seed, number : int
        All draws follow from these.
    """
    rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed, spawn_key=(number,))))
    while True:  # a room through which no way is found is drawn anew
        half_m = np.array([rng.uniform(5.0, 8.0), rng.uniform(4.5, 6.5)]) / 2
        objects = _objects(half_m, rng)
        way = _way(half_m, objects, rng)
        if way is not None:
            break
    return {
        "schema": 1,
        "description": f"Hard room {number} of seed {seed}.",
        "seed": int(rng.integers(2**63)),
        "radar": _radar(rng),
        "receivers": {"front": _antennas(rng)},
        "trajectory": _trajectory(way, rng),
        "objects": [*objects, *_walls(half_m, rng)],
        "terms": _terms(rng),
    }


def _objects(half_m: FloatArray, rng: np.random.Generator) -> list[Values]:
    """A strong object, a weak one beside it, and two to four others, none too near to another."""
    strong = _object(rng, "box", "metal", loss_db=0.0)
    weak = _object(rng, "rod", str(rng.choice(["plywood", "chipboard"])), loss_db=float(rng.uniform(10, 16)))
    others = []
    for _ in range(int(rng.integers(2, 5))):
        material = str(rng.choice(_MATERIALS))
        loss_db = float(rng.uniform(0, 6) if material == "metal" else rng.uniform(0, 3))
        others.append(_object(rng, str(rng.choice(["box", "box", "rod", "plate"])), material, loss_db))
    placed: list[Values] = []
    for item in (strong, weak, *others):
        for _ in range(_TRIES):
            if item is weak:
                apart_m = _radius(strong) + _radius(weak) + rng.uniform(0.15, 0.45)
                center = placed[0]["center_m"] + apart_m * _unit(rng)
            else:
                center = rng.uniform(-1, 1, 2) * (half_m - 0.2 - _radius(item))
            gaps = [
                np.linalg.norm(center - one["center_m"]) - _radius(one) - _radius(item) - BETWEEN_OBJECTS_M
                for one in placed
                if not (item is weak and one is strong)
            ]
            if np.all(np.abs(center) < half_m - _radius(item)) and all(gap > 0 for gap in gaps):
                placed.append({**item, "center_m": center})
                break
    return [
        {**one, "id": f"{one['material']}-{index}", "center_m": np.round(one["center_m"], 4).tolist()}
        for index, one in enumerate(placed, 1)
    ]


def _unit(rng: np.random.Generator) -> FloatArray:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def _object(rng: np.random.Generator, shape: str, material: str, loss_db: float) -> Values:
    """An object without place and name."""
    values: Values = {"shape": shape, "material": material, "loss_db": round(loss_db, 2)}
    values |= {"height_m": round(float(rng.uniform(0.5, 1.8)), 3)}
    if shape == "rod":
        return {**values, "radius_m": round(float(rng.uniform(0.05, 0.2)), 3)}
    values |= {"width_m": round(float(rng.uniform(0.3, 0.8)), 3), "yaw_deg": round(float(rng.uniform(-180, 180)), 1)}
    return {**values, "depth_m": round(float(rng.uniform(0.2, 0.5)) if shape == "box" else 0.02, 3)}


def _radius(item: Mapping[str, Any]) -> float:
    """Radius of the circle around an object."""
    return float(item.get("radius_m") or np.hypot(item["width_m"], item["depth_m"]) / 2)


def _walls(half_m: FloatArray, rng: np.random.Generator) -> list[Values]:
    material = str(rng.choice(list(_WALLS)))
    walls = []
    for index, name in enumerate(("east", "north", "west", "south")):
        angle = index * np.pi / 2
        outwards = np.array([np.cos(angle), np.sin(angle)])
        center = outwards * (half_m[index % 2] + 0.05)  # its inner face, half its depth of 0.1 m further in
        width = 2 * half_m[(index + 1) % 2]
        values = {"id": name, "shape": "wall", "center_m": np.round(center, 4).tolist(), "width_m": float(width)}
        walls.append({**values, "yaw_deg": 180.0 + 90 * index, "material": material, "thickness_m": _WALLS[material]})
    return walls


def _way(half_m: FloatArray, objects: Sequence[Mapping[str, Any]], rng: np.random.Generator) -> FloatArray | None:
    """Points (legs + 1, 2) whose legs are clear of all objects; None where they are not found."""
    free_m = half_m - CLEAR_OF_WALLS_M
    points = [rng.uniform(-1, 1, 2) * free_m]
    for _ in range(_TRIES):
        further = rng.uniform(-1, 1, 2) * free_m
        leg = further - points[-1]
        if 1.0 < np.linalg.norm(leg) < 3.5 and all(
            _distance(np.asarray(one["center_m"]), points[-1], leg) > _radius(one) + CLEAR_OF_OBJECTS_M
            for one in objects
        ):
            points.append(further)
        if len(points) == LEGS + 1:
            return np.round(points, 4)
    return None


def _distance(point: FloatArray, start: FloatArray, leg: FloatArray) -> float:
    """Distance of a point to a leg."""
    share = np.clip((point - start) @ leg / (leg @ leg), 0, 1)
    return float(np.linalg.norm(point - start - share * leg))


def _trajectory(points: FloatArray, rng: np.random.Generator) -> Values:
    """Five legs with turns, and two halts amid them."""
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    legs = np.sort(rng.choice(LEGS, 2, replace=False))
    at_m = reached[legs] + rng.uniform(0.2, 0.8, 2) * np.diff(reached)[legs]
    return {
        "kind": "waypoints",
        "points_m": points.tolist(),
        "speed_m_s": float(rng.uniform(0.2, 0.5)),
        "turn_deg_s": float(rng.uniform(40, 90)),
        "halts": [{"at_m": float(one), "seconds": float(rng.uniform(1.5, 4.0))} for one in at_m],
    }


def _radar(rng: np.random.Generator) -> Values:
    pulse: Values = {"shape": "raised_cosine"}
    if rng.random() < 0.6:
        pulse = {"shape": "gauss", "fwhm_ns": float(rng.uniform(2.4, 3.6))}
    return {"channel": int(rng.choice([5, 9])), "pulse": pulse, "gain_dbi": float(rng.uniform(4, 7))}


def _antennas(rng: np.random.Generator) -> Values:
    """Receiver and transmitter across the way, along it or askew; looking ahead, seldom to a side."""
    side = float(rng.choice([0.0, 90.0, -90.0], p=[0.8, 0.1, 0.1]))
    angle = float(rng.choice([np.pi / 2, -np.pi / 2, 0.0, rng.uniform(-np.pi / 2, np.pi / 2)]))
    arm = rng.uniform(0.07, 0.125) * np.array([np.cos(angle), np.sin(angle)])
    return {"mount_position_m": arm.tolist(), "tx_position_m": (-arm).tolist(), "mount_yaw_deg": side}


def _terms(rng: np.random.Generator) -> list[Values]:
    """What frames are made of, with sizes of the room's own."""

    def use(name: str, **ranges: tuple[float, float]) -> Values:
        params = {key: float(rng.uniform(*ends)) for key, ends in ranges.items()}
        return {"use": name, "params": params}

    tails = [
        {"delay_ns": float(rng.uniform(2.5, 4.0)), "level_db": float(rng.uniform(-24, -16))},
        {"delay_ns": float(rng.uniform(5.0, 8.0)), "level_db": float(rng.uniform(-32, -24))},
    ]
    tails = [{**tap, "phase_deg": float(rng.uniform(-180, 180))} for tap in tails]
    tail = {"use": "pulse.tail", "params": {"taps": tails}} if rng.random() < 0.5 else None
    ringing = use("ringing", level_db=(-14, -6), decay_ns=(1.2, 2.2), spread_deg=(30, 90), start_ns=(0.3, 1.0))
    floor = use("ringing", level_db=(-42, -34), decay_ns=(6, 9), spread_deg=(30, 90), start_ns=(2.0, 4.0))
    floor = {**floor, "as": "ringing.floor", "params": {**floor["params"], "spacing_ns": 0.9, "returns": 16}}
    ghosts = use("ghost.wall", loss_db=(0, 4))
    noise = use("noise", snr_db=(38, 50))
    terms = [
        use("direct", isolation_db=(6, 12)),
        tail,
        use("antenna", exponent=(1.3, 2.5), front_back_db=(8, 15)),
        use("array", asymmetry_deg=(-10, 10), ripple_deg=(0, 6), coupling=(0.9, 1.0), offset_deg=(-5, 5)),
        use("occlusion", transmission_db=(-20, -10)),
        ringing,
        floor,
        use("echo.plate"),
        use("echo.cylinder"),
        use("echo.scatterers", rcs_m2=(0.2, 1.0)),
        use("echo.wall"),
        use("clutter.wall", per_m2=(0.3, 1.0), rcs_m2=(0.003, 0.02)),
        {**ghosts, "params": {**ghosts["params"], "twice": True}},
        use("ghost.robot", rcs_m2=(0.03, 0.2)),
        use("bounce.objects", rcs_m2=(0.1, 0.6)),
        use("bounce.walls"),
        use("grid"),
        use("frame_gain"),
        {**noise, "params": {**noise["params"], "kind": str(rng.choice(["white", "rc"]))}},
        use("odometry", distance_error=(0.0, 0.03), rotation_error=(0.0, 0.03), slips_per_min=(1, 5)),
    ]
    return [term for term in terms if term is not None]
