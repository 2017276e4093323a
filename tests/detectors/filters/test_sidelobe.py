"""The mask by what a side lobe can be."""

import numpy as np
import pytest

from uwbbench.api import Detections


def _kept(make_radar, make_block, make_stage, rows, **params):
    """Which of rows (tap, score, cosine) of one frame are left."""
    tap, score_db, cosine = np.array(rows, float).T
    found = Detections(
        np.zeros(len(tap), int),
        tap=tap,
        score_db=score_db,
        motion_cosine=cosine,
        motion_cosine_sd=np.full(len(tap), 0.06),
    )
    stage = make_stage("filter.sidelobe", **params)
    stage.open(make_radar())
    left = stage.step(make_block(np.ones((1, 50)), detections=found)).detections
    return [row for row in range(len(tap)) if tap[row] in left["tap"]]


@pytest.mark.parametrize(
    ("weaker", "left"),
    [
        ((20.5, 40, 1.0), [0]),  # on the flank of the pulse
        ((24.0, 20, 1.0), [0]),  # in its tail
        ((24.0, 45, 1.0), [0, 1]),  # above what a tail can be
        ((45.0, 20, 1.0), [0, 1]),  # far away, 30 dB below: no fixed floor
        ((20.1, 40, 0.0), [0, 1]),  # at the same range, in another direction, above the skirt of the sum
        ((20.1, 24, 0.0), [0]),  # below it
    ],
)
def test_what_could_be_a_side_lobe_is_dropped_and_nothing_else(weaker, left, make_radar, make_block, make_stage):
    assert _kept(make_radar, make_block, make_stage, [(20.0, 50, 1.0), weaker]) == left


def test_rows_of_other_frames_mask_nothing(make_radar, make_block, make_stage):
    rows = Detections([0, 1], tap=[20.0, 20.5], score_db=[60.0, 20.0])
    stage = make_stage("filter.sidelobe")
    stage.open(make_radar())
    assert len(stage.step(make_block(np.ones((2, 50)), detections=rows)).detections) == 2


def test_equal_rows_stay(make_radar, make_block, make_stage):
    assert _kept(make_radar, make_block, make_stage, [(20.0, 50, 1.0), (20.5, 50, 1.0)]) == [0, 1]
