"""Detections that are held."""

import numpy as np
import pytest

from uwbbench.api import Detections

RATE_HZ = 48.0


@pytest.fixture
def hold(make_block, run_cut, make_radar):
    def run(frames, rows, silent=(), **params):
        samples = np.ones((frames, 4), complex)
        samples[list(silent)] = 0
        table = np.array(rows, float).reshape(-1, 2)
        found = Detections(table[:, 0].astype(int), processed=np.arange(frames), range_m=table[:, 1])
        block = make_block(samples, detections=found)
        return run_cut("track.hold", params, make_radar(4), block, list(range(1, frames))).detections

    return run


def test_the_last_row_is_repeated_until_it_is_too_old(hold):
    found = hold(20, [(2, 1.0), (3, 1.1)], hold_s=5 / RATE_HZ)
    assert found.frame.tolist() == [2, 3, 4, 5, 6, 7, 8]
    assert found.range_m.tolist() == [1.0] + 6 * [1.1]
    assert found["held"].tolist() == 2 * [0.0] + 5 * [1.0]


def test_frames_of_zeros_hold_nothing(hold):
    assert hold(6, [(1, 1.0)], silent=[3]).frame.tolist() == [1, 2, 4, 5]


def test_one_target_has_one_row_wherever_the_next_one_is(hold):
    found = hold(4, [(0, 1.0), (1, 4.0)])
    assert found.range_m.tolist() == [1.0, 4.0, 4.0, 4.0]


def test_of_two_targets_each_is_held_until_it_is_seen_again(hold):
    found = hold(4, [(0, 1.0), (0, 4.0), (2, 4.1)], targets=2)
    assert found.frame.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert sorted(found.range_m[4:6].tolist()) == [1.0, 4.1]


def test_frames_without_any_detection_have_no_rows(hold):
    assert len(hold(5, [])) == 0
