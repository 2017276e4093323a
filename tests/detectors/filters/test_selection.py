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


@given(rows=ROWS, fraction=st.sampled_from([0.05, 0.3, 1.0]))
def test_first_above_retains_the_nearest_with_enough_of_the_largest_energy(
    make_radar, make_block, make_stage, run_stage, rows, fraction
):
    expected = []
    for row in rows:
        own = [other for other in rows if other[0] == row[0]]
        strong = [other for other in own if other[2] ** 2 >= fraction * max(one[2] for one in own) ** 2 * (1 - 1e-12)]
        expected += [row] if row == min(strong, key=lambda one: one[1]) else []
    assert (
        select(make_radar, make_block, make_stage, run_stage, "select.first_above", rows, fraction=fraction) == expected
    )


def test_first_above_passes_over_what_has_no_amplitude(make_radar, make_block, make_stage, run_stage):
    rows = [(0, 2, np.nan), (0, 5, 1.0), (1, 3, np.nan)]
    assert select(make_radar, make_block, make_stage, run_stage, "select.first_above", rows) == [(0, 5, 1.0)]


def test_first_above_says_where_next_to_nothing_was_found(make_radar, make_block, make_stage, run_stage):
    stage = make_stage("select.first_above")
    run_stage(stage, make_radar(10), make_block(np.ones((30, 10)), detections=Detections([4], tap=[3], amplitude=[1])))
    assert stage.notes[0].startswith("select.first_above: detections in only 1 of 30 frames")
