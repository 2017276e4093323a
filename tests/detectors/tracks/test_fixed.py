"""Objects that stand still in the world."""

import numpy as np
import pytest

from uwbbench.api import Detections

POINT_M = (3.0, 0.4)


def _block(make_block, x_m, seen, yaw_rad=None, point_m=POINT_M, held=None):
    """A drive along x, and detections of a point in the frames in which it is seen."""
    frames = len(x_m)
    yaw_rad = np.zeros(frames) if yaw_rad is None else yaw_rad
    frame = np.flatnonzero(seen)
    rows = Detections(
        frame,
        range_m=np.hypot(point_m[0] - x_m, point_m[1])[frame],
        azimuth_rad=(np.arctan2(point_m[1], point_m[0] - x_m) - yaw_rad)[frame],
        amplitude=np.full(len(frame), 0.1),
        score_db=np.full(len(frame), 30.0),
        held=np.zeros(len(frame)) if held is None else held[frame],
    )
    position_m = np.stack([x_m, 0 * x_m, 0 * x_m], axis=1)
    return make_block(np.ones((frames, 50)), position_m=position_m, yaw_rad=yaw_rad, detections=rows)


def _rows(make_radar, make_stage, run_stage, block, **params):
    return run_stage(make_stage("track.fixed", **params), make_radar(), block).detections


def test_an_object_is_believed_after_several_looks(make_radar, make_block, make_stage, run_stage):
    x_m = 0.006 * np.arange(60)
    rows = _rows(make_radar, make_stage, run_stage, _block(make_block, x_m, np.ones(60, bool)))
    assert 2 <= rows.frame[0] <= 10
    assert len(rows) == 60 - rows.frame[0]
    np.testing.assert_array_equal(rows["held"], 0)
    np.testing.assert_allclose(rows.range_m, np.hypot(3.0 - x_m, 0.4)[rows.frame])
    assert len(np.unique(rows["track"])) == 1


def test_it_is_held_where_it_should_be_while_the_robot_stands_and_turns(make_radar, make_block, make_stage, run_stage):
    frame = np.arange(300)
    x_m = 0.006 * np.minimum(frame, 100)
    yaw_rad = np.deg2rad(0.5) * np.clip(frame - 200, 0, 60)
    rows = _rows(make_radar, make_stage, run_stage, _block(make_block, x_m, frame <= 100, yaw_rad))
    late = rows.take(rows.frame > 100)
    assert len(late) == 199
    np.testing.assert_array_equal(late["held"], 1)
    np.testing.assert_allclose(late.range_m, np.hypot(2.4, 0.4), atol=0.01)
    np.testing.assert_allclose(late.azimuth_rad, np.arctan2(0.4, 2.4) - yaw_rad[101:], atol=0.02)


def test_what_is_turned_out_of_view_is_no_row_until_it_is_back(make_radar, make_block, make_stage, run_stage):
    frame = np.arange(400)
    x_m = 0.006 * np.minimum(frame, 100)
    yaw_rad = np.deg2rad(1.0) * (np.clip(frame - 100, 0, 90) - np.clip(frame - 250, 0, 90))
    rows = _rows(make_radar, make_stage, run_stage, _block(make_block, x_m, frame <= 100, yaw_rad))
    assert not np.any((rows.frame > 200) & (rows.frame < 250))
    assert 399 in rows.frame


def test_it_is_forgotten_where_the_robot_drives_on_and_sees_nothing(make_radar, make_block, make_stage, run_stage):
    x_m = 0.006 * np.arange(300)
    rows = _rows(make_radar, make_stage, run_stage, _block(make_block, x_m, np.arange(300) < 100))
    assert 110 < rows.frame[-1] < 200
    assert np.all(rows["held"][rows.frame >= 100] == 1)


def test_rows_that_are_held_themselves_are_no_looks(make_radar, make_block, make_stage, run_stage):
    block = _block(make_block, 0.006 * np.arange(60), np.ones(60, bool), held=np.ones(60))
    assert len(_rows(make_radar, make_stage, run_stage, block)) == 0


def test_a_single_flash_is_no_object(make_radar, make_block, make_stage, run_stage):
    block = _block(make_block, 0.006 * np.arange(60), np.arange(60) == 20)
    assert len(_rows(make_radar, make_stage, run_stage, block)) == 0


def test_nan_rows_and_places_that_are_not_known_leave_no_trace(make_radar, make_block, make_stage, run_stage):
    x_m = 0.006 * np.arange(60)
    block = _block(make_block, x_m, np.ones(60, bool))
    block.detections.columns["range_m"][10:20] = np.nan
    rows = _rows(make_radar, make_stage, run_stage, block)
    assert np.isfinite(rows.range_m).all()
    assert rows.frame[-1] == 59


def test_any_cut_into_blocks_gives_the_same_bits(make_radar, make_block, run_cut, one_by_one):
    seen = np.arange(120) % 7 != 3
    run_cut("track.fixed", {}, make_radar(), _block(make_block, 0.006 * np.arange(120), seen), one_by_one(120))


@pytest.mark.parametrize("points", [80])
def test_more_objects_than_there_is_room_for_do_no_harm(points, make_radar, make_block, make_stage, run_stage):
    frames = 30
    angle = np.linspace(-0.8, 0.8, points)
    frame = np.repeat(np.arange(frames), points)
    x_m = 0.006 * np.arange(frames)
    rows = Detections(
        frame,
        range_m=np.tile(np.linspace(1, 6, points), frames),
        azimuth_rad=np.tile(angle, frames),
        amplitude=np.full(len(frame), 0.1),
        score_db=np.full(len(frame), 20.0),
        held=np.zeros(len(frame)),
    )
    position_m = np.stack([x_m, 0 * x_m, 0 * x_m], axis=1)
    block = make_block(np.ones((frames, 50)), position_m=position_m, detections=rows)
    assert len(_rows(make_radar, make_stage, run_stage, block)) > 0
