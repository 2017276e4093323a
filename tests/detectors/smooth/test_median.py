"""Running median of ranges."""

import numpy as np
import pytest
from scipy.signal import medfilt

from uwbbench.api import Detections


def block_of(make_block, frames, rows):
    table = np.array(rows, float).reshape(-1, 2)
    return make_block(np.ones((frames, 4)), detections=Detections(table[:, 0].astype(int), range_m=table[:, 1]))


def test_one_detection_a_frame_gets_the_plain_running_median(make_radar, make_block, make_stage, run_stage):
    range_m = np.random.default_rng(0).normal(size=50)
    block = block_of(make_block, 50, list(enumerate(range_m)))
    found = run_stage(make_stage("smooth.median", frames=5), make_radar(4), block).detections
    np.testing.assert_array_equal(found.frame, np.arange(50))
    np.testing.assert_allclose(found.range_m[2:-2], medfilt(range_m, 5)[2:-2], rtol=0)
    assert found.range_m[0] == np.median(range_m[:3])


def test_frames_come_out_as_soon_as_those_behind_them_are_there(make_radar, make_block, make_stage):
    stage = make_stage("smooth.median", frames=5)
    stage.open(make_radar(4))
    block = block_of(make_block, 6, [(k, 1.0) for k in range(6)])
    out = [stage.step(block.cut(k, k + 1)).frames.index.tolist() for k in range(6)]
    assert out == [[], [], [0], [1], [2], [3]]
    assert stage.flush().frames.index.tolist() == [4, 5]


def test_a_frame_far_off_is_put_right_and_a_steady_walk_does_not_lag(make_radar, make_block, make_stage, run_stage):
    true_m = 2 + 0.05 * np.arange(30)
    spoiled_m = true_m.copy()
    spoiled_m[14] = 9.0
    block = block_of(make_block, 30, list(enumerate(spoiled_m)))
    found = run_stage(make_stage("smooth.median"), make_radar(4), block).detections
    np.testing.assert_allclose(found.range_m[2:-2], true_m[2:-2], atol=0.051)
    np.testing.assert_allclose(np.delete(found.range_m[2:-2], range(9, 16)), np.delete(true_m[2:-2], range(9, 16)))


def test_frames_without_a_detection_do_not_count(make_radar, make_block, make_stage, run_stage):
    block = block_of(make_block, 9, [(0, 1.0), (3, 5.0), (4, 1.2), (5, np.nan), (6, 1.4)])
    found = run_stage(make_stage("smooth.median", frames=5), make_radar(4), block).detections
    np.testing.assert_allclose(found.range_m, [1.0, 3.1, 1.4, np.nan, 1.3])


def test_two_objects_keep_apart(make_radar, make_block, make_stage, run_stage):
    rows = [row for k in range(12) for row in ((k, 1 + 0.01 * k), (k, 4 - 0.01 * k))]
    found = run_stage(make_stage("smooth.median"), make_radar(4), block_of(make_block, 12, rows)).detections
    np.testing.assert_allclose(found.range_m[8:16], [value for _, value in rows][8:16])


def test_an_even_number_of_frames_has_no_middle(make_stage):
    with pytest.raises(ValueError, match="must be odd"):
        make_stage("smooth.median", frames=4)


@pytest.mark.parametrize("frames", [1, 5, 31])
def test_any_cut_into_blocks_gives_the_same_bits(frames, make_radar, make_block, run_cut, one_by_one):
    rows = sorted([(k, np.cos(3 * k)) for k in range(40) if k % 3] + [(k, np.sin(k)) for k in range(0, 40, 4)])
    block = block_of(make_block, 40, rows)
    for cuts in (one_by_one(40), [3, 3, 20]):
        run_cut("smooth.median", {"frames": frames}, make_radar(4), block, cuts)
