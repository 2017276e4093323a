"""Ways of the robot, against what their geometry says."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from uwbbench.api import CaptureError, Trajectory
from uwbbench_datasets.simulator.trajectory import TrajectoryModel, sampled

RATE_HZ = 48.0


def made(folder: Path = Path(), **keys: object) -> Trajectory:
    return sampled(TypeAdapter(TrajectoryModel).validate_python(keys), RATE_HZ, folder)


def speed(track: Trajectory) -> np.ndarray:
    return np.linalg.norm(np.diff(track.position_m, axis=0), axis=1) * RATE_HZ


def test_a_straight_way_keeps_its_speed_and_heads_along_it() -> None:
    track = made(kind="straight", start_m=[1, 1], end_m=[1, 4], speed_m_s=0.5)
    assert len(track) == 6 * 48 + 1
    assert np.allclose(speed(track), 0.5)
    assert np.allclose(track.yaw_rad, np.pi / 2)
    assert np.allclose(track.position_m[-1], [1, 4, 0])


def test_a_given_heading_holds_all_the_way() -> None:
    track = made(kind="straight", start_m=[0, 0], end_m=[1, 0], yaw_deg=90)
    assert np.allclose(track.yaw_rad, np.pi / 2)


def test_waypoints_are_passed_at_constant_speed() -> None:
    points = [[0, 0], [1, 0], [1, 1], [0, 1]]
    track = made(kind="waypoints", points_m=points, speed_m_s=0.25)
    for point, second in zip(points, (0, 4, 8, 12), strict=True):
        assert np.allclose(track.position_m[int(second * RATE_HZ)][:2], point)
    assert set(np.round(np.degrees(track.yaw_rad))) == {0.0, 90.0, 180.0}


def test_a_robot_that_takes_its_time_turns_on_the_spot_by_the_shorter_way() -> None:
    points = [[0, 0], [1, 0], [1, 1], [2, 1], [1, 1]]
    track = made(kind="waypoints", points_m=points, speed_m_s=0.5, turn_deg_s=45)
    for second, point, heading in ((2, [1, 0], 0), (3, [1, 0], 45), (4, [1, 0], 90), (6, [1, 1], 90), (8, [1, 1], 0)):
        frame = int(second * RATE_HZ)
        assert np.allclose(track.position_m[frame, :2], point)
        assert np.degrees(track.yaw_rad[frame]) == pytest.approx(heading)
    assert track.timestamp_s[-1] == pytest.approx(4 * 2 + 2 * 2 + 4)
    moves, turns = speed(track) > 1e-9, np.abs(np.diff(track.yaw_rad)) > 1e-9
    assert not np.any(moves & turns)
    assert np.degrees(np.abs(np.diff(track.yaw_rad)[turns])) * RATE_HZ == pytest.approx(45)


def test_a_robot_that_keeps_its_heading_has_no_time_to_turn() -> None:
    with pytest.raises(ValidationError, match="leave turn_deg_s out"):
        made(kind="waypoints", points_m=[[0, 0], [1, 0]], yaw_deg=0, turn_deg_s=45)


@pytest.mark.parametrize("sweep", [90.0, -270.0])
def test_an_arc_stays_on_its_circle_and_heads_along_it(sweep: float) -> None:
    track = made(kind="arc", center_m=[1, 2], radius_m=1.5, start_deg=30, sweep_deg=sweep, speed_m_s=0.4)
    radius = np.linalg.norm(track.position_m[:, :2] - [1, 2], axis=1)
    assert np.allclose(radius, 1.5)
    moved = np.diff(track.position_m[:, :2], axis=0)
    ahead = np.stack([np.cos(track.yaw_rad), np.sin(track.yaw_rad)], axis=1)[:-1]
    assert np.all(np.sum(moved * ahead, axis=1) > 0.999 * np.linalg.norm(moved, axis=1))
    assert track.timestamp_s[-1] == pytest.approx(np.radians(abs(sweep)) * 1.5 / 0.4, abs=1 / RATE_HZ)


def test_stop_and_go_halts_after_each_step() -> None:
    track = made(kind="stop_and_go", start_m=[0, 0], end_m=[1.0, 0], step_m=0.3, halt_s=2.0, speed_m_s=0.5)
    still = track.position_m[:-1][speed(track) < 1e-9][:, 0]
    assert set(np.round(still, 9)) == {0.3, 0.6, 0.9, 1.0}
    assert track.timestamp_s[-1] == pytest.approx(1.0 / 0.5 + 4 * 2.0, abs=1 / RATE_HZ)


def test_standing_still_is_standing_still() -> None:
    track = made(kind="static", position_m=[1, 2, 0.3], yaw_deg=-90, duration_s=1.0)
    assert len(track) == 49
    assert np.all(track.position_m == [1, 2, 0.3])
    assert np.allclose(track.yaw_rad, -np.pi / 2)


def test_a_file_is_interpolated_through_the_turn_at_pi(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("timestamp_s,x_m,y_m,yaw_rad\n10,0,0,3.0\n11,1,0,-3.0\n")
    track = made(tmp_path, kind="file", file="way.csv")
    assert track.timestamp_s[0] == 10
    assert np.allclose(track.position_m[24], [0.5, 0, 0])
    assert np.cos(track.yaw_rad[24]) == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("timestamp_s,x_m,y_m\n0,0,0\n1,1,1\n", "has no column 'yaw_rad'"),
        ("timestamp_s,x_m,y_m,yaw_rad\n0,0,0,0\n", "at least two poses"),
        ("timestamp_s,x_m,y_m,yaw_rad\n0,0,0,0\n0,1,0,0\n", "'timestamp_s' must increase"),
        ("timestamp_s,x_m,y_m,yaw_rad\n0,0,0,0\n1,far,0,0\n", "column 'x_m'"),
        ("timestamp_s,x_m,y_m,yaw_rad\n0,0,0,0\n1,nan,0,0\n", "not finite"),
    ],
)
def test_a_wrong_file_is_told_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "way.csv").write_text(text)
    with pytest.raises(CaptureError, match=message):
        made(tmp_path, kind="file", file="way.csv")


@pytest.mark.parametrize("name", ["../way.csv", "/etc/passwd"])
def test_a_file_outside_the_scenes_folder_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(CaptureError, match="must lie in the scene's folder"):
        made(tmp_path, kind="file", file=name)


def test_a_link_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    (tmp_path / "way.csv").write_text("timestamp_s,x_m,y_m,yaw_rad\n0,0,0,0\n1,1,0,0\n")
    (tmp_path / "scenes" / "way.csv").symlink_to(tmp_path / "way.csv")
    with pytest.raises(CaptureError, match="must lie in the scene's folder"):
        made(tmp_path / "scenes", kind="file", file="way.csv")


def test_an_endless_run_is_refused() -> None:
    with pytest.raises(CaptureError, match="more than 2000000 frames"):
        made(kind="straight", start_m=[0, 0], end_m=[1, 0], speed_m_s=1e-9)


def test_an_arc_of_no_angle_is_refused() -> None:
    with pytest.raises(ValidationError, match="kind: static"):
        made(kind="arc", center_m=[0, 0], radius_m=1, sweep_deg=0)


def test_a_straight_way_halts_where_the_scene_says() -> None:
    halts = [{"at_m": 0.0, "seconds": 1.0}, {"at_m": 0.6, "seconds": 2.0}, {"at_m": 1.0, "seconds": 0.5}]
    track = made(kind="straight", start_m=[1, 0], end_m=[1, 1], speed_m_s=0.5, halts=halts)
    assert track.timestamp_s[-1] == pytest.approx(1.0 / 0.5 + 3.5, abs=1 / RATE_HZ)
    for second, at_m in ((0.0, 0.0), (1.0, 0.0), (1.6, 0.3), (2.2, 0.6), (4.2, 0.6), (5.0, 1.0), (5.5, 1.0)):
        assert np.interp(second, track.timestamp_s, track.position_m[:, 1]) == pytest.approx(at_m, abs=0.02)
    assert np.max(speed(track)) < 0.5 + 1e-9
    assert np.allclose(track.yaw_rad, np.pi / 2)


@pytest.mark.parametrize(
    ("at_m", "message"),
    [([1.2], "1.2 m lies behind the end of the way, 1 m"), ([0.5, 0.5], "0.5 m must lie behind the halt before")],
)
def test_halts_lie_on_the_way_one_behind_the_other(at_m: list[float], message: str) -> None:
    halts = [{"at_m": one, "seconds": 1.0} for one in at_m]
    with pytest.raises(ValidationError, match=message):
        made(kind="straight", start_m=[0, 0], end_m=[1, 0], halts=halts)


@pytest.mark.parametrize("turn_deg_s", [45.0, None])
def test_a_way_through_points_halts_and_goes_on_as_without(turn_deg_s: float | None) -> None:
    way = {"kind": "waypoints", "points_m": [[0, 0], [1, 0], [1, 1]], "speed_m_s": 0.5, "turn_deg_s": turn_deg_s}
    halts = [{"at_m": 0.5, "seconds": 1.5}, {"at_m": 1.5, "seconds": 2.0}]
    going, halting = made(**way), made(**way, halts=halts)
    turned_s = 0.0 if turn_deg_s is None else 2.0
    for start, end, place in ((1.0, 2.5, [0.5, 0.0]), (4.5 + turned_s, 6.5 + turned_s, [1.0, 0.5])):
        still = (halting.timestamp_s > start + 0.03) & (halting.timestamp_s < end - 0.03)
        assert np.allclose(halting.position_m[still, :2], place, atol=1e-9)
    later_s = np.select([halting.timestamp_s < 1, halting.timestamp_s < 2.5], [0.0, np.nan], 1.5)
    later_s[halting.timestamp_s > 4.5 + turned_s] = np.nan
    later_s[halting.timestamp_s >= 6.5 + turned_s] = 3.5
    known = np.isfinite(later_s)
    at_s = (halting.timestamp_s - later_s)[known]
    same = [(halting.position_m[:, axis], going.position_m[:, axis]) for axis in range(2)]
    for one, other in [*same, (halting.yaw_rad, going.yaw_rad)][: 3 if turn_deg_s else 2]:
        assert np.allclose(one[known], np.interp(at_s, going.timestamp_s, other), atol=0.02)


def test_halts_lie_on_a_way_through_points() -> None:
    with pytest.raises(ValidationError, match=r"2.5 m lies behind the end of the way, 2 m"):
        made(kind="waypoints", points_m=[[0, 0], [1, 0], [1, 1]], halts=[{"at_m": 2.5, "seconds": 1.0}])
