"""The benchmark of rooms: its counts are those of the scoring, however they are divided."""

import json

import numpy as np
import pytest
import rooms

from uwbbench import load_detector, open_capture, open_dataset, score, write_capture
from uwbbench.api import Trajectory, UwbbenchError


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with two captures of a plate."""
    made = tmp_path_factory.mktemp("rooms")
    dataset = open_dataset("approach", {"runs": 2, "start_m": 1.6, "stop_m": 0.8, "sts": False})
    for number, name in enumerate(dataset.names()):
        write_capture(made / f"{number}.h5", dataset.open(name))
    return made


@pytest.fixture
def unit(folder):
    return rooms.units([f"plates={folder}"])[0]


def test_counts_by_motion_and_material_add_up_to_the_scoring(unit) -> None:
    detector = load_detector("oracle")
    row = rooms.counted(detector, unit, 0.2)
    capture = open_capture(unit.file)
    block = score(detector.run(capture), capture, "object", 0.2).filtering
    assert (sum(row["tp"]), sum(row["fp"]), sum(row["fn"])) == (block.tp, block.fp, block.fn)
    assert row["materials"] == {"metal": [block.tp, block.tp + block.fn]}
    assert row["chance"] == pytest.approx(block.chance_recall * (block.tp + block.fn))
    assert block.tp > 50


def test_frames_move_turn_or_stand() -> None:
    time_s = np.arange(6) / 10
    position = np.array([0, 0.1, 0.2, 0.2, 0.2, 0.2])[:, None] * [1, 0, 0]
    yaw = np.array([0, 0, 0, 0.3, 0.6, 0.6])
    states = rooms.motions(Trajectory(time_s, position, yaw))
    assert [rooms.MOTIONS[one] for one in states] == ["moving"] * 3 + ["turning"] * 2 + ["standing"]


def row(tp: int, fp: int, fn: int) -> dict[str, object]:
    return {
        "tp": [tp, 0, 0],
        "fp": [0, fp, 0],
        "fn": [0, 0, fn],
        "materials": {"metal": [tp, tp + fn]},
        "kinds": {"noise": fp},
        "chance": 0.1 * (tp + fn),
        "errors": [0.02 * tp, 0.02 * tp, 0.0004 * tp, tp],
    }


def test_counts_are_added_up_before_a_ratio_is_taken() -> None:
    found = rooms.summary("mine.yaml", "all", [("one", row(90, 10, 0)), ("other", row(0, 10, 10))])
    assert found["precision"] == pytest.approx(90 / 110)
    assert found["recall"] == pytest.approx(0.9)
    assert found["f1_worst"] == 0
    assert found["recall_of"] == {"metal": pytest.approx(0.9)}
    assert found["kinds"] == {"noise": 20}
    assert found["chance_recall"] == pytest.approx(0.1)
    assert (found["bias_m"], found["mae_m"]) == (pytest.approx(0.02), pytest.approx(0.02))
    assert found["sd_m"] == pytest.approx(0.0, abs=1e-6)
    assert found["detector"] == "mine"


def test_the_interval_draws_captures_of_each_generator_and_holds_the_value() -> None:
    alone = [("one", row(90, 10, 10)), ("other", row(10, 40, 40))]
    assert rooms.interval(alone) == pytest.approx((0.667, 0.667), abs=1e-3)  # one capture each: nothing to draw
    low, high = rooms.interval([("one", row(90, 10, 10)), ("one", row(10, 40, 40))] * 6)
    assert low < 2 * 100 / (2 * 100 + 50 + 50) < high


def test_what_is_known_is_not_found_again(folder, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("sys.argv", ["rooms.py", "--captures", f"plates={folder}", "null", "--json"])
    monkeypatch.setattr("sys.argv", [*rooms.sys.argv, "--cache", str(tmp_path), "--processes", "1"])
    assert rooms.main() == 0
    first, kept = json.loads(capsys.readouterr().out), {file: file.stat().st_mtime_ns for file in tmp_path.iterdir()}
    assert rooms.main() == 0
    assert json.loads(capsys.readouterr().out) == first
    assert {file: file.stat().st_mtime_ns for file in tmp_path.iterdir()} == kept
    assert len(kept) == 2
    assert first[0]["recall"] == 0


@pytest.mark.parametrize("text", ["plates", "plates=/nowhere", "all=."])
def test_a_folder_without_name_or_captures_is_refused(text) -> None:
    with pytest.raises(UwbbenchError, match="expected NAME=FOLDER"):
        rooms.units([text])
