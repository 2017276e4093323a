import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import Obstacle, Trajectory, Truth

FRAMES = 4


@pytest.fixture(scope="module")
def oracle_of(make_stage, make_block, make_radar):
    """What the oracle yields for a robot that stands at the origin and looks along x."""

    def found(*objects, valid=None, **radar):
        block = make_block(np.ones((FRAMES, 50)))
        if valid is not None:
            block = block.replace(frames=dataclasses.replace(block.frames, valid=np.array(valid)))
        frames = block.frames
        stage = make_stage("reference.oracle")
        stage.open(make_radar(**radar))
        stage.show_truth(Truth(objects), Trajectory(frames.timestamp_s, frames.position_m, frames.yaw_rad))
        return stage.step(block).detections

    return found


def point(x, y, **facts):
    return Obstacle("point", "metal", np.array([[x, y]], float), **facts)


def test_nothing_finds_nothing(make_stage, make_block, run_stage, make_radar):
    block = run_stage(make_stage("reference.nothing"), make_radar(), make_block(np.ones((FRAMES, 50))))
    assert len(block.detections) == 0
    assert {"range_m", "azimuth_rad", "x_m", "y_m"} <= set(block.detections.columns)


def test_constant_finds_one_point_ahead_in_every_valid_frame(make_stage, make_block, run_stage, make_radar):
    samples = np.ones((3, 50))
    samples[1] = np.nan
    poses = {"position_m": np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), "yaw_rad": np.array([0.0, 0, np.pi / 2])}
    stage = make_stage("reference.constant", range_m=1.5)
    found = run_stage(stage, make_radar(), make_block(samples, **poses)).detections
    assert found.frame.tolist() == [0, 2]
    assert found.range_m.tolist() == [1.5, 1.5]
    assert found.azimuth_rad.tolist() == [0.0, 0.0]
    np.testing.assert_allclose(found["x_m"], [1.5, 2.0], atol=1e-12)
    np.testing.assert_allclose(found["y_m"], [0.0, 1.5], atol=1e-12)


def test_oracle_finds_every_object_where_it_is(oracle_of):
    found = oracle_of(point(3.0, 0.0), point(0.0, 2.0))
    assert found.frame.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    np.testing.assert_allclose(found.range_m, [3.0, 2.0] * FRAMES)
    np.testing.assert_allclose(found.azimuth_rad, [0.0, np.pi / 2] * FRAMES)
    np.testing.assert_allclose(found["x_m"], [3.0, 0.0] * FRAMES, atol=1e-12)
    np.testing.assert_allclose(found["y_m"], [0.0, 2.0] * FRAMES, atol=1e-12)


def test_oracle_passes_over_what_a_receiver_cannot_or_need_not_see(oracle_of):
    screen = Obstacle("screen", "metal", np.array([[1.0, -1.0], [1.0, 1.0]]))
    wall = Obstacle("wall", "concrete", np.array([[0.0, 5.0], [9.0, 5.0]]), structure=True)
    found = oracle_of(screen, point(3.0, 0.0), point(-2.0, 0.1), wall)
    np.testing.assert_allclose(found.range_m, [1.0] * FRAMES)


def test_oracle_passes_over_unlabelled_and_invalid_frames(oracle_of):
    path = np.full((FRAMES, 1, 2), 2.0)
    path[1] = np.nan
    found = oracle_of(Obstacle("walker", "person", path), valid=[True, True, False, True])
    assert found.frame.tolist() == [0, 3]


def test_oracle_of_an_empty_scene_finds_nothing(oracle_of):
    assert len(oracle_of()) == 0


@given(cuts=st.lists(st.integers(0, 20), max_size=5))
@settings(max_examples=10)
def test_blocks_do_not_matter(run_cut, make_block, make_radar, cuts):
    samples = np.ones((20, 50))
    samples[4] = np.nan
    for name in ("reference.nothing", "reference.constant"):
        run_cut(name, {}, make_radar(), make_block(samples), cuts)
