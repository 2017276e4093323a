"""Selections against sorting each frame's detections in plain Python."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.api import Detections

AMPLITUDES = st.sampled_from([0.0, 1.0, 1.0, 2.0, 3.5])
ROWS = st.lists(
    st.tuples(st.integers(0, 3), st.integers(0, 9), AMPLITUDES), max_size=20, unique_by=lambda row: (row[0], row[1])
)
KEYS = {
    "select.strongest": lambda row: (-row[2], row[1]),
    "select.nearest": lambda row: (row[1],),
}


def select(make_radar, make_block, make_stage, run_stage, name, rows, **params):
    frame, tap, amplitude = (np.array([row[i] for row in rows], dtype=float) for i in range(3))
    found = Detections(frame.astype(int) + 5, tap=tap, amplitude=amplitude)
    block = make_block(np.ones((4, 10)), first=5, detections=found)
    found = run_stage(make_stage(name, **params), make_radar(10), block).detections
    return list(zip((found.frame - 5).tolist(), found["tap"].tolist(), found["amplitude"].tolist(), strict=True))


@pytest.mark.parametrize("name", KEYS)
@given(rows=ROWS, count=st.integers(1, 4))
def test_the_first_of_each_frame_are_retained_in_their_original_order(
    make_radar, make_block, make_stage, run_stage, name, rows, count
):
    expected = []
    for row in rows:
        own = sorted((other for other in rows if other[0] == row[0]), key=KEYS[name])
        if row in own[:count]:
            expected.append(row)
    assert select(make_radar, make_block, make_stage, run_stage, name, rows, count=count) == expected


def test_of_equal_amplitudes_the_earlier_tap_is_the_strongest(make_radar, make_block, make_stage, run_stage):
    rows = [(0, 8, 2.0), (0, 3, 2.0), (0, 5, 1.0)]
    assert select(make_radar, make_block, make_stage, run_stage, "select.strongest", rows) == [(0, 3, 2.0)]


def test_a_detection_without_an_amplitude_is_not_the_strongest(make_radar, make_block, make_stage, run_stage):
    rows = [(0, 8, np.nan), (1, 8, np.nan), (1, 3, 2.0)]
    assert select(make_radar, make_block, make_stage, run_stage, "select.strongest", rows) == [(1, 3, 2.0)]


@given(rows=ROWS)
def test_all_retains_every_detection(make_radar, make_block, make_stage, run_stage, rows):
    assert select(make_radar, make_block, make_stage, run_stage, "select.all", rows) == rows
