"""``simulate``: a scene becomes a capture file that the other commands read."""

import json
from pathlib import Path

import pytest

from uwbbench.api import open_capture
from uwbbench.api.locate import config_folder

SCENE = """\
schema: 1
runs: 2
trajectory: {kind: straight, start_m: [0, 0], end_m: [0.5, 0], speed_m_s: 0.3}
objects:
  - {id: plate, shape: plate, center_m: [2.0, 0.1], width_m: 0.25, height_m: 0.28}
  - {id: crumb, shape: point, center_m: [60, 0]}
terms: [{use: direct}, {use: echo.plate}, {use: echo.point}, {use: noise}]
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "room.yaml"
    path.write_text(SCENE)
    return path


def test_a_scene_becomes_a_capture_labelled_simulated(uwbbench, scene, tmp_path: Path) -> None:
    said = uwbbench("simulate", scene.name, "-o", "room.h5").stdout
    assert "simulated capture 'room/1', 81 frames of 50 taps, written to room.h5" in said
    capture = open_capture(tmp_path / "room.h5")
    assert (capture.source, len(capture)) == ("simulated", 81)
    assert "left out: echo.point" in capture.description
    assert "SIMULATED" in uwbbench("info", "room.h5").stdout


def test_the_json_tells_what_each_term_cost(uwbbench, scene) -> None:
    record = json.loads(uwbbench("simulate", scene.name, "-o", "room.h5", "--json").stdout)
    assert record["source"] == "simulated"
    terms = {term["name"]: term for term in record["receivers"]["front"]}
    assert [name for name, term in terms.items() if not term["kept"]] == ["echo.point"]
    assert terms["echo.point"]["level_db"] < -10
    assert terms["echo.plate"]["pulses"] == 81
    assert all(term["seconds"] >= 0 for term in terms.values())


def test_the_same_command_writes_the_same_file(uwbbench, scene, tmp_path: Path) -> None:
    uwbbench("simulate", scene.name, "-o", "one.h5")
    uwbbench("simulate", scene.name, "-o", "two.h5", "--jobs", 2)
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "two.h5").read_bytes()


def test_runs_and_settings_change_the_capture(uwbbench, scene, tmp_path: Path) -> None:
    uwbbench("simulate", scene.name, "-o", "one.h5")
    uwbbench("simulate", scene.name, "-o", "two.h5", "--run", 2)
    uwbbench("simulate", scene.name, "-o", "five.h5", "--set", "radar.channel=5")
    one, two, five = (open_capture(tmp_path / name) for name in ("one.h5", "two.h5", "five.h5"))
    assert two.name == "room/2"
    assert one.sha256 != two.sha256
    assert five.radar.channel == 5


def test_all_receivers_are_in_one_file(uwbbench, scene, tmp_path: Path) -> None:
    receivers = "receivers={front: {}, left: {mount_yaw_deg: 90}}"
    uwbbench("simulate", scene.name, "-o", "room.h5", "--set", receivers)
    assert open_capture(tmp_path / "room.h5", "left").receivers == ("front", "left")


def test_a_scene_that_varies_asks_which_variant(uwbbench, scene) -> None:
    scene.write_text(SCENE + "vary: {radar.channel: [5, 9]}\n")
    said = uwbbench("simulate", scene.name, "-o", "room.h5", code=2).stderr
    assert "varies into 2 captures (channel-5, channel-9" in said
    uwbbench("simulate", scene.name, "-o", "room.h5", "--set", "radar.channel=9")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere.yaml", "-o", "a.h5"], "nowhere.yaml: no such file"),
        (["platte", "-o", "a.h5"], "no scene named 'platte'"),
        (["room.yaml", "-o", "a.csv"], "expected .h5"),
        (["room.yaml", "-o", "a.h5", "--set", "radar.chanel=5"], "unknown key 'chanel'. Did you mean 'channel'"),
    ],
)
def test_mistakes_are_one_message(uwbbench, scene, words, message) -> None:
    assert scene.is_file()
    assert message in uwbbench("simulate", *words, code=2).stderr


def test_a_scene_is_validated_like_the_other_files(uwbbench, scene) -> None:
    assert "scene of 2 captures, fine" in uwbbench("validate", scene.name).stdout
    scene.write_text(SCENE.replace("use: noise", "use: noisy"))
    assert "Did you mean 'noise'" in uwbbench("validate", scene.name, code=2).stderr


def test_a_grid_behind_lost_frames_is_refused_in_one_message(uwbbench, tmp_path: Path) -> None:
    text = (config_folder() / "scenes" / "plate.yaml").read_text()
    lossy = text.replace("  - use: grid\n", "  - {use: frames.lost, params: {share: 0.2}}\n  - use: grid\n")
    assert lossy != text
    (tmp_path / "lossy.yaml").write_text(lossy)
    said = uwbbench("simulate", "lossy.yaml", "-o", "lossy.h5", code=2).stderr
    assert "term 'grid' must come before the terms that lose or repeat frames" in said


def test_a_robot_is_validated_like_the_other_files(uwbbench, tmp_path: Path) -> None:
    text = (
        "schema: 1\nname: rover\nradar: {sample_interval_ns: 1.0016}\nseed: 1\nchannels: {9: {terms: {ringing: {}}}}\n"
    )
    (tmp_path / "rover.yaml").write_text(text)
    assert "robot 'rover' on channels 9, fine" in uwbbench("validate", "rover.yaml").stdout
    (tmp_path / "rover.yaml").write_text(text.replace("ringing", "grid"))
    assert "'grid' is no part of a robot" in uwbbench("validate", "rover.yaml", code=2).stderr


def test_a_background_is_written_beside_each_receiver_and_shown(uwbbench, scene, tmp_path: Path) -> None:
    said = uwbbench("simulate", scene.name, "-o", "room.h5", "--background").stdout
    assert "81 frames of 50 taps, with background, written" in said
    assert not open_capture(tmp_path / "room.h5").background.truth.objects
    receiver = json.loads(uwbbench("info", "room.h5", "--json").stdout)["receivers"][0]
    assert receiver["background"] == {"name": "room/1 background", "frames": 81, "invalid_frames": 0}
    assert "81 frames" in uwbbench("info", "room.h5").stdout
    assert "background" not in uwbbench("simulate", scene.name, "-o", "alone.h5").stdout


def test_anchors_are_written_and_counted(uwbbench, scene, tmp_path: Path) -> None:
    heard = SCENE.replace("{use: noise}]", "{use: noise}, {use: anchor.messages}]")
    (tmp_path / "heard.yaml").write_text(heard + "anchors: [{id: 4, position_m: [3, 1]}, {id: 5, drop_at_m: 0.2}]\n")
    uwbbench("simulate", "heard.yaml", "-o", "heard.h5")
    messages = len(open_capture(tmp_path / "heard.h5").anchors.messages)
    receiver = json.loads(uwbbench("info", "heard.h5", "--json").stdout)["receivers"][0]
    assert receiver["anchors"] == {"count": 2, "messages": messages}
    assert messages > 10
    assert f"2, {messages} messages" in uwbbench("info", "heard.h5").stdout
    uwbbench("simulate", scene.name, "-o", "room.h5")
    assert "messages" not in uwbbench("info", "room.h5").stdout
