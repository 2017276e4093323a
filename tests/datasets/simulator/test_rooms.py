"""Hard rooms: what was drawn keeps its promises, and the same room is the same wherever it is drawn."""

from itertools import pairwise

import numpy as np
import pytest

from uwbbench.api import CaptureError
from uwbbench.api.registry import load_plugin
from uwbbench_datasets.simulator.rooms import CLEAR_OF_OBJECTS_M, LEGS, drawn_room
from uwbbench_datasets.simulator.scene import scene_of

ROOMS = [drawn_room(7001, number) for number in range(1, 41)]


def opened(**params: object):
    kind = load_plugin("datasets", "hard-rooms")
    return kind(kind.params_type().model_validate(params), ())


def test_all_rooms_are_scenes_that_can_be_read() -> None:
    for values in ROOMS:
        assert scene_of("room", values).model.trajectory.kind == "waypoints"


def test_a_room_depends_on_its_seed_and_number_alone() -> None:
    assert drawn_room(7001, 3) == ROOMS[2]
    assert drawn_room(7002, 3) != ROOMS[2]
    assert len({str(values) for values in ROOMS}) == 40


def test_the_robot_keeps_clear_of_objects_and_walls() -> None:
    for values in ROOMS:
        points = np.array(values["trajectory"]["points_m"])
        assert len(points) == LEGS + 1
        share = np.linspace(0, 1, 50)[:, None]
        way = np.concatenate([start + share * (end - start) for start, end in pairwise(points)])
        bodies = [item.body() for item in scene_of("room", values).model.objects]
        for body in bodies:
            corners = body.obstacle.outline_m
            if body.structure:
                assert np.all(np.abs(way) < np.abs(corners).max(axis=0))
            else:
                assert np.linalg.norm(way[:, None] - corners, axis=2).min() > CLEAR_OF_OBJECTS_M - 1e-3


def test_every_room_has_a_weak_object_beside_a_strong_one_and_rooms_differ() -> None:
    channels, pulses, tails, materials = set(), set(), set(), set()
    for values in ROOMS:
        strong, weak = values["objects"][:2]
        assert strong["material"] == "metal"
        assert weak["loss_db"] >= 10
        apart = np.linalg.norm(np.subtract(strong["center_m"], weak["center_m"]))
        assert apart < 1.2
        channels.add(values["radar"]["channel"])
        pulses.add(values["radar"]["pulse"]["shape"])
        tails.add(any(term["use"] == "pulse.tail" for term in values["terms"]))
        materials |= {item["material"] for item in values["objects"]}
    assert (len(channels), len(pulses), len(tails)) == (2, 2, 2)
    assert {"metal", "plywood", "concrete", "glass"} <= materials


def test_every_robot_turns_on_the_spot_and_stands_still_for_seconds() -> None:
    for values in ROOMS[:10]:
        scene = scene_of("room", values)
        track = scene.model.trajectory.sampled(48.0)
        still = np.linalg.norm(np.diff(track.position_m, axis=0), axis=1) < 1e-9
        turning = still & (np.abs(np.diff(track.yaw_rad)) > 1e-6)
        assert turning.sum() > 24
        assert (still & ~turning).sum() > 2 * 1.4 * 48


def test_the_number_of_rooms_changes_names_alone() -> None:
    assert (
        opened(seed=7001, count=2).names()
        == ["hard-rooms-7001/1", "hard-rooms-7001/2"]
        == opened(seed=7001).names()[:2]
    )


@pytest.mark.slow
def test_a_room_is_simulated_with_truth_and_odometry() -> None:
    made = opened(seed=7001, count=40).open("hard-rooms-7001/11")
    assert made.name == "hard-rooms-7001/11"
    assert made.odometry_position_m is not None
    assert np.all(np.isfinite(made.frames().preamble))
    assert {item.structure for item in made.truth.objects} == {True, False}
    assert made.source == "simulated"


def test_a_room_that_is_not_there_is_named_with_the_nearest() -> None:
    with pytest.raises(CaptureError, match="no hard room 'hard-rooms-7001/41'"):
        opened(seed=7001).open("hard-rooms-7001/41")
