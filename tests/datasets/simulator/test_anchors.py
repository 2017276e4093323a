"""Anchors of scenes: where they stand, and what receivers hear of them."""

import numpy as np
import pytest
import yaml

from tests.fixtures.chance import SIGMAS
from uwbbench.api import CaptureError, ConfigError, Trajectory, wrap_angle
from uwbbench_datasets.simulator.anchors import AnchorModel
from uwbbench_datasets.simulator.engine import simulate
from uwbbench_datasets.simulator.scene import read_scenes

NOISE = [{"use": "noise"}]
EXACT = {"azimuth_sd_deg": 0, "range_sd_m": 0, "range_bias_m": 0}
OUT = {"kind": "straight", "start_m": [0, 0], "end_m": [6, 0], "speed_m_s": 1.0}
FORE = {"id": 7, "position_m": [8.0, 1.0]}
RADAR = {"frame_rate_hz": 20.0}


@pytest.fixture
def heard(run_scene):
    def run(params=None, terms=(), **scene):
        hears = [*NOISE, {"use": "anchor.messages", "params": {**EXACT, **(params or {})}}, *terms]
        usual = {"radar": RADAR, "trajectory": OUT, "anchors": [FORE]}
        return run_scene(hears, **{**usual, **scene})

    return run


def test_messages_without_error_say_where_the_anchor_is(heard):
    capture = heard()
    anchors = capture.anchors
    away = np.array([8.0, 1.0]) - capture.trajectory.position_m[anchors.frame, :2]
    assert anchors.messages.range_m == pytest.approx(np.hypot(*away.T))
    assert anchors.messages.azimuth_rad == pytest.approx(np.arctan2(away[:, 1], away[:, 0]))
    assert set(anchors.messages.anchor) == {7}
    assert anchors.position_m.tolist() == [[8.0, 1.0]]
    assert not anchors.messages.placed.any()


def test_errors_bias_and_rate_are_those_of_the_parameters(run_scene):
    still = {"kind": "static", "duration_s": 200.0}
    front = {"front": {"mount_yaw_deg": 30}}
    terms = [*NOISE, {"use": "anchor.messages"}]
    capture = run_scene(
        terms, radar=RADAR, trajectory=still, receivers=front, anchors=[{"id": 7, "position_m": [4, 0]}]
    )
    said, count = capture.anchors.messages, len(capture.anchors.messages)
    assert abs(count - 2000) <= 1
    assert np.mean(said.range_m) == pytest.approx(4.18, abs=SIGMAS * 0.1 / np.sqrt(count))
    assert np.std(said.range_m) == pytest.approx(0.1, rel=SIGMAS / np.sqrt(2 * count))
    error = np.degrees(wrap_angle(said.azimuth_rad)) + 30
    assert np.mean(error) == pytest.approx(0, abs=SIGMAS * 5 / np.sqrt(count))
    assert np.std(error) == pytest.approx(5, rel=SIGMAS / np.sqrt(2 * count))


def test_an_anchor_is_heard_within_reach_and_the_field_of_view_alone(heard):
    far, behind = {"id": 1, "position_m": [12.0, 0.0]}, {"id": 2, "position_m": [-2.0, 0.0]}
    capture = heard(anchors=[far, behind, {"id": 3, "position_m": [3.0, 0.0]}])
    said, frame = capture.anchors.messages, capture.anchors.frame
    x = capture.trajectory.position_m[frame, 0]
    assert set(said.anchor) == {1, 3}
    assert x[said.anchor == 1].min() == pytest.approx(2.0, abs=0.15)
    assert x[said.anchor == 3].max() == pytest.approx(2.0, abs=0.15)
    assert np.all(np.diff(frame) >= 0)


def test_an_anchor_behind_the_receiver_is_heard_where_the_field_of_view_goes_round(heard):
    capture = heard({"field_of_view_deg": 180}, anchors=[{"id": 2, "position_m": [-2.0, 0.0]}])
    assert np.abs(capture.anchors.messages.azimuth_rad) == pytest.approx(np.pi)


def test_an_anchor_behind_an_object_is_not_heard(heard):
    screen = {"id": "screen", "shape": "plate", "center_m": [7, 0], "yaw_deg": 180, "width_m": 1.0, "height_m": 1.0}
    capture = heard(
        anchors=[{"id": 1, "position_m": [8.0, 0.0]}, {"id": 2, "position_m": [8.0, 3.0]}], objects=[screen]
    )
    assert set(capture.anchors.messages.anchor) == {2}


def test_directions_may_come_without_distances(heard):
    said = heard({"range_sd_m": None}).anchors.messages
    assert np.isnan(said.range_m).all()
    assert np.isfinite(said.azimuth_rad).all()


DROPPED = {"id": 9, "drop_at_m": 2.0, "offset_m": [-0.4, 0.3]}
BOTH_SIDES = {"front": {}, "rear": {"mount_position_m": [-0.1, 0.0], "mount_yaw_deg": 180}}


def captures(folder, background=False, **scene):
    """Captures of all receivers of a scene that hears its anchors without error."""
    hears = [*NOISE, {"use": "anchor.messages", "params": EXACT}]
    usual = {"schema": 1, "radar": RADAR, "trajectory": OUT, "terms": hears}
    (folder / "scene.yaml").write_text(yaml.safe_dump({**usual, **scene}))
    return simulate(read_scenes(folder / "scene.yaml")[0], background=background).captures


def test_an_anchor_set_down_is_reported_once_and_heard_only_afterwards(tmp_path):
    front, rear = (one.anchors for one in captures(tmp_path, anchors=[DROPPED], receivers=BOTH_SIDES))
    assert front.frame.tolist() == [40]
    assert front.messages.placed.tolist() == [True]
    assert front.messages.range_m == pytest.approx(0.5)
    assert front.messages.azimuth_rad == pytest.approx(np.arctan2(0.3, -0.4))
    assert not rear.messages.placed.any()
    assert rear.frame[0] > 40
    assert len(rear.frame) > 10
    assert np.array_equal(front.position_m, rear.position_m)


def test_an_anchor_stands_by_its_placing_error_beside_where_the_robot_believes_it(rng):
    way = Trajectory(np.arange(3.0), np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.full(3, np.pi / 2))
    model = AnchorModel.model_validate(DROPPED)
    off = np.array([model.anchor(way, rng).position_m for _ in range(400)]) - [1.7, -0.4]
    assert np.mean(off, axis=0) == pytest.approx([0, 0], abs=SIGMAS * 0.05 / np.sqrt(400))
    assert np.std(off) == pytest.approx(0.05, rel=SIGMAS / np.sqrt(2 * 800))


def test_some_messages_carry_the_identity_of_another_anchor(heard):
    anchors = [{"id": 1, "position_m": [8, 1]}, {"id": 2, "position_m": [8, 0]}, {"id": 5, "position_m": [8, -1]}]
    right, wrong = heard(anchors=anchors).anchors, heard({"wrong_identity": 0.25}, anchors=anchors).anchors
    assert np.array_equal(right.messages.range_m, wrong.messages.range_m)
    share = np.mean(right.messages.anchor != wrong.messages.anchor)
    assert share == pytest.approx(0.25, abs=SIGMAS * np.sqrt(0.25 * 0.75 / len(right.frame)))
    assert set(wrong.messages.anchor) == {1, 2, 5}


def test_the_wrong_identity_of_the_only_anchor_is_that_of_none(heard):
    assert set(heard({"wrong_identity": 1}).anchors.messages.anchor) == {8}


def test_lost_frames_lose_their_messages_and_repeated_ones_bring_them_once(heard):
    whole = heard()
    lost = heard(terms=[{"use": "frames.lost", "params": {"share": 0.3}}])
    twice = heard(terms=[{"use": "frames.duplicated", "params": {"share": 1.0}}])
    arrived = np.isin(whole.trajectory.timestamp_s[whole.anchors.frame], lost.trajectory.timestamp_s)
    assert 0 < arrived.sum() < len(arrived)
    assert np.array_equal(lost.anchors.messages.range_m, whole.anchors.messages.range_m[arrived])
    assert np.array_equal(twice.anchors.frame, 2 * whole.anchors.frame)


def test_a_term_that_loses_frames_before_messages_are_heard_is_refused(run_scene):
    terms = [*NOISE, {"use": "frames.lost", "params": {"share": 0.5}}, {"use": "anchor.messages"}]
    with pytest.raises(CaptureError, match=r"'anchor.messages' must stand before"):
        run_scene(terms, radar=RADAR, trajectory=OUT, anchors=[FORE])


def test_a_scene_without_anchors_hears_none(heard):
    assert len(heard(anchors=[]).anchors.identity) == 0


def test_anchors_that_no_term_hears_are_refused(run_scene):
    with pytest.raises(CaptureError, match=r"no term that hears them: add anchor.messages"):
        run_scene(NOISE, anchors=[FORE])


def test_a_way_too_short_for_an_anchor_is_refused(heard):
    with pytest.raises(CaptureError, match="anchor 9 is set down after 7 m, but the robot's way is 6 m long"):
        heard(anchors=[{"id": 9, "drop_at_m": 7.0}])


@pytest.mark.parametrize(
    ("anchors", "what"),
    [
        ([{"id": 1}], "either position_m or drop_at_m"),
        ([{"id": 1, "position_m": [0, 0], "drop_at_m": 1}], "either position_m or drop_at_m"),
        ([{"id": 1, "position_m": [0, 0], "offset_m": [0, 1]}], "offset_m is for anchors that the robot sets down"),
        ([FORE, FORE], "anchor '7' appears twice"),
    ],
)
def test_anchors_that_cannot_be_are_refused(heard, anchors, what):
    with pytest.raises(ConfigError, match=what):
        heard(anchors=anchors)


def test_a_background_has_no_anchors(tmp_path):
    (capture,) = captures(tmp_path, background=True, anchors=[FORE])
    assert len(capture.anchors.identity) == 1
    assert capture.background.anchors is None
