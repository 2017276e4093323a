"""Backgrounds of simulated runs: the same robot at the same place without its objects, and noise of its own."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from uwbbench.api import Capture
from uwbbench.config.source import open_dataset
from uwbbench_datasets.simulator.engine import simulate
from uwbbench_datasets.simulator.scene import read_scenes

SCENE = """
schema: 1
receivers: {front: {mount_position_m: [0.0, 0.125], tx_position_m: [0.0, -0.125]}}
trajectory: {kind: static, duration_s: 2.0}
objects:
  - {id: box, shape: box, center_m: [2.0, 0.0], yaw_deg: 180, width_m: 0.4, depth_m: 0.3, height_m: 0.5}
  - {id: wall, shape: wall, center_m: [3.0, 0.0], yaw_deg: 180, width_m: 5.0, material: concrete}
"""
ALL = ["direct", "ringing", "array", "echo.plate", "echo.wall", "clutter.wall", "grid", "frame_gain", "noise"]
STILL = ["direct", "ringing", "echo.plate", "echo.wall", "clutter.wall"]


@pytest.fixture
def run(tmp_path: Path):
    """Capture with its background of a scene with some terms."""

    def make(terms, number=1, **changes) -> Capture:
        data = {**yaml.safe_load(SCENE), "terms": [{"use": term} for term in terms], **changes}
        (tmp_path / "scene.yaml").write_text(yaml.safe_dump(data))
        return simulate(read_scenes(tmp_path / "scene.yaml")[0], number, background=True).captures[0]

    return make


def test_a_background_has_the_structure_and_no_objects(run) -> None:
    capture = run(STILL)
    assert [item.name for item in capture.truth.objects] == ["box", "wall"]
    assert [item.name for item in capture.background.truth.objects] == ["wall"]
    assert capture.background.recording == capture.recording


@pytest.mark.parametrize("changes", [{}, {"robot_seed": 4}])
def test_robot_and_place_are_those_of_the_run(run, changes) -> None:
    capture = run(STILL, objects=yaml.safe_load(SCENE)["objects"][1:], **changes)
    np.testing.assert_array_equal(capture.preamble, capture.background.preamble)


def test_noise_grid_and_gain_are_drawn_anew(run) -> None:
    capture = run([*STILL, "grid", "frame_gain", "noise"], objects=yaml.safe_load(SCENE)["objects"][1:])
    fractions = [one.first_path_index for one in (capture, capture.background)]
    assert abs(np.corrcoef(*fractions)[0, 1]) < 0.5  # 97 pairs: 4.9 standard deviations
    assert not np.any(fractions[0] == fractions[1])
    silent = [one.preamble[:, :2].ravel() for one in (capture, capture.background)]  # before any arrival: noise alone
    share = abs(np.vdot(*silent)) / np.linalg.norm(silent[0]) / np.linalg.norm(silent[1])
    assert share < 0.35  # of two independent draws of 194: 1e-10


def test_asking_for_a_background_changes_nothing_of_the_capture(run, tmp_path) -> None:
    capture = run(ALL)
    alone = simulate(read_scenes(tmp_path / "scene.yaml")[0]).captures[0]
    np.testing.assert_array_equal(capture.preamble, alone.preamble)
    np.testing.assert_array_equal(capture.first_path_index, alone.first_path_index)
    assert alone.background is None
    assert capture.sha256 != alone.sha256


def test_each_run_has_a_background_of_its_own(run) -> None:
    first, second = (run(ALL, number).background for number in (1, 2))
    assert first.sha256 != second.sha256


def test_a_dataset_gives_backgrounds_where_its_use_asks_for_them() -> None:
    params = {"scenes": ["suite-standing"], "set": {"trajectory.duration_s": 0.1, "objects.box.material": "metal"}}
    asked = open_dataset("simulated", {**params, "background": True}, [])
    plain = open_dataset("simulated", params, [])
    (name, *_) = plain.names()
    assert plain.open(name).background is None
    background = asked.open(name).background
    assert background.name == f"{name} background"
    assert background.robot == "twin, seed 58"
    assert not background.truth.objects
