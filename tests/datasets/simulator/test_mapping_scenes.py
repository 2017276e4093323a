"""Shipped scenes for mapping while driving, on short ways: runs of all their receivers, with odometry."""

import numpy as np
import pytest

from uwbbench.config.source import open_dataset

SHORT = {"trajectory.points_m": [[0.0, 0.0], [0.3, 0.0], [0.3, 0.2]]}
SCENES = {
    "rods-loop": (30, ["front", "side"], 0),
    "rods-loop-walls": (30, ["front", "side"], 4),
    "bat-room": (10, ["left", "right"], 4),
    "corridor-featureless": (10, ["front", "side"], 2),
    "demonstration-lab-loop": (10, ["front", "side"], 0),
}


def opened(name, **changes):
    return open_dataset("simulated", {"scenes": [name], "set": {**SHORT, **changes}}, [])


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_has_ten_runs_of_all_its_receivers_with_drifting_odometry(name):
    runs, receivers, walls = SCENES[name]
    dataset = opened(name, **({"anchors": []} if name == "corridor-featureless" else {}))
    assert len(dataset.runs()) == runs
    run, captures = next(iter(dataset.runs().items()))
    drive = dataset.open_run(run, captures)
    assert list(drive.radars) == receivers
    assert not np.allclose(drive.odometry[-1, :2], drive.trajectory.position_m[-1, :2], atol=1e-5)
    assert sum(obstacle.structure for obstacle in drive.header.truth.objects) == walls


def test_a_level_of_drift_scales_what_the_runs_have_drawn():
    dataset = opened("rods-loop")
    off = []
    for level in ("0.005", "0.02"):
        captures = dataset.runs()[f"rods-loop/drift-{level}/1"]
        drive = dataset.open_run(f"rods-loop/drift-{level}/1", captures)
        first_leg = drive.odometry[10, :2] - drive.trajectory.position_m[10, :2]
        off.append(np.linalg.norm(first_leg))
    assert off[1] == pytest.approx(4 * off[0], rel=0.02)


def test_anchors_of_the_corridor_are_set_down_where_its_robot_goes():
    way = {"trajectory.points_m": [[0.0, 0.0], [1.0, 0.0], [-4.0, 0.0]], "trajectory.speed_m_s": 2.0}
    dropped = {"anchors.101.drop_at_m": 0.5, "anchors.102.drop_at_m": 1.5, "anchors.103.drop_at_m": 4.5}
    dataset = opened("corridor-featureless", **way, **dropped)
    drive = dataset.open_run(*next(iter(dataset.runs().items())))
    front, side = (capture.anchors for capture in drive.captures)
    assert front.messages.anchor[front.messages.placed].tolist() == [101, 102, 103]
    assert not side.messages.placed.any()
    assert front.position_m == pytest.approx(np.array([[0.5, 0.3], [0.5, -0.3], [-2.5, -0.3]]), abs=0.4)


def test_a_run_is_the_same_whenever_it_is_simulated():
    hashes = {opened("rods-loop").open("rods-loop/drift-0.02/2/side").sha256 for _ in range(2)}
    hashes |= {opened("rods-loop").open_run("rods-loop/drift-0.02/2", ["rods-loop/drift-0.02/2/side"]).sha256}
    assert len(hashes) == 1
