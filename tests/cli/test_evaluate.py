"""``score``, ``detect`` and ``calibrate``."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

import uwbbench as package
from uwbbench.api import COLUMNS

BLOCK = {"precision", "recall", "f1", "mae_m", "p90_m", "p95_m", "sd_m", "tp", "fp", "fn", "retained"}

# score


@pytest.mark.slow
def test_score_json_prints_one_object_and_nothing_else(uwbbench, capture: Path, detector: Path) -> None:
    result = uwbbench("score", capture, "--detector", detector, "--json")
    found = json.loads(result.stdout, parse_constant=pytest.fail)
    assert list(found)[:6] == ["detector", "capture", "frames", "filtering", "mapping", "latency_us"]
    assert (found["detector"], found["capture"], found["frames"]) == ("simple", "approach-ch9-metal-1", 39)
    assert set(found["filtering"]) >= BLOCK
    assert found["mapping"] is None
    assert found["latency_us"]["n"] == 39
    assert 0 < found["latency_us"]["p50"] <= found["latency_us"]["max"]
    assert found["latency_us"]["p99"] is None  # too few frames for it


def test_score_equals_the_python_interface(uwbbench, capture: Path) -> None:
    printed = json.loads(uwbbench("score", capture, "-d", "paper", "--no-latency", "--json").stdout)
    opened = package.open_capture(capture)
    scores = package.score(package.load_detector("paper").run(opened), opened)
    assert printed["filtering"] == scores.filtering.to_dict()
    assert set(printed["mapping"]) == set(printed["filtering"])
    assert printed["latency_us"] is None


@pytest.mark.parametrize("scoring", ["frame", "peak", "object"])
def test_every_scoring_and_gate_reaches_the_scores(uwbbench, capture: Path, detector: Path, scoring: str) -> None:
    words = ("score", capture, "-d", detector, "--no-latency", "--json", "--scoring", scoring, "--gate-m")
    wide, narrow = (json.loads(uwbbench(*words, gate).stdout) for gate in (0.5, 0.001))
    assert (wide["scoring"], wide["gate_m"]) == (scoring, 0.5)
    assert wide["filtering"]["tp"] > narrow["filtering"]["tp"]


def test_tracks_of_another_program_are_scored_as_tracks(uwbbench, capture: Path, tmp_path: Path) -> None:
    opened = package.open_capture(capture)
    range_m = opened.truth.seen_from(opened.radar, opened.trajectory).range_m[:, 0]
    rows = "".join(f"{frame},{value + 0.02},7\n" for frame, value in enumerate(range_m))
    (tmp_path / "mine.csv").write_text(f"frame,range_m,track\n{rows}")
    words = ("score", capture, "--results", tmp_path / "mine.csv", "--scoring", "track", "--gate-m", 0.5)
    found = json.loads(uwbbench(*words, "--json").stdout)["filtering"]
    assert found["track_rmse_m"] == pytest.approx(0.02)
    assert found["gospa_localisation_m"] <= found["gospa_m"]
    assert (found["identity_switches"], found["false_tracks_per_minute"]) == (0, 0)
    shown = uwbbench(*words).stdout
    assert "GOSPA" in shown
    assert "after mapping: n/a (the tracks have no positions)" in shown


def test_a_detector_without_tracks_is_refused_as_such(uwbbench, capture: Path) -> None:
    refused = uwbbench("score", capture, "-d", "paper", "--no-latency", "--scoring", "track", code=2)
    assert "the detections have no column 'track'" in refused.stderr
    assert "score it by 'frame', 'peak', 'object' or 'latest'" in refused.stderr


def test_undefined_numbers_are_null_and_explained(uwbbench, capture: Path) -> None:
    found = json.loads(uwbbench("score", capture, "-d", "null", "--no-latency", "--json").stdout)
    assert found["filtering"]["precision"] is None
    assert found["filtering"]["recall"] == 0
    assert "n/a (nothing retained)" in uwbbench("score", capture, "-d", "null", "--no-latency").stdout


def test_score_labels_simulated_captures(uwbbench, capture: Path, detector: Path) -> None:
    assert "SIMULATED" in uwbbench("score", capture, "-d", detector, "--no-latency").stdout


def test_set_changes_the_detector(uwbbench, capture: Path, detector: Path) -> None:
    words = ("score", capture, "-d", detector, "--no-latency", "--json")
    changed = json.loads(uwbbench(*words, "--set", "pipeline.filter.first_path.params.guard_taps=45").stdout)
    assert changed["filtering"]["retained"] == 0
    assert "key=value" in uwbbench(*words, "--set", "nonsense", code=2).stderr
    assert "gard_taps" in uwbbench(*words, "--set", "pipeline.filter.first_path.params.gard_taps=4", code=2).stderr


def test_a_capture_without_truth_cannot_be_scored(uwbbench, capture_without_truth: Path, detector: Path) -> None:
    result = uwbbench("score", capture_without_truth, "-d", detector, "--json", code=2)
    assert result.stdout == ""
    assert "blind.h5: the capture has no ground truth" in result.stderr


@pytest.mark.slow
def test_captures_with_invalid_frames_or_none_are_scored(uwbbench, capture_with_nan, empty_capture, detector) -> None:
    for path, frames in ((capture_with_nan, 37), (empty_capture, 0)):
        result = uwbbench("score", path, "-d", detector, "--json")
        assert json.loads(result.stdout)["filtering"]["frames"] == frames


def test_paper_notes_what_it_left_out_without_sts(uwbbench, capture_with_nan: Path) -> None:
    found = json.loads(uwbbench("score", capture_with_nan, "-d", "paper", "--no-latency", "--json").stdout)
    left_out = "left out, as the capture has no STS responses of two antennas: pdoa, filter.pdoa"
    assert any(note.startswith(left_out) for note in found["notes"])
    text = uwbbench("score", capture_with_nan, "-d", "paper", "--no-latency").stderr
    assert f"note: {left_out}" in text
    assert "frames are invalid" in text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["score", "run.h5"], "--detector"),
        (["score", "run.h5", "-d", "papper"], "Did you mean 'paper'?"),
        (["score", "run.h5", "-d", "gone.yaml"], "gone.yaml: no such file"),
        (["score", "gone.h5", "-d", "paper"], "gone.h5: no such capture file"),
        (["score", "run.h5", "-d", "paper", "--scoring", "frames"], "object"),
        (["score", "run.h5", "-d", "paper", "--gate-m", "-1"], "gate_m must be positive"),
        (["score", "run.h5", "-d", "paper", "--gate-m", "nan"], "gate_m must be positive"),
        (["score", "run.h5", "-d", "paper", "--receiver", "frond"], "Did you mean 'front'?"),
    ],
)
def test_wrong_words_for_score_are_usage_errors(uwbbench, capture: Path, words: list[str], says: str) -> None:
    result = uwbbench(*words, code=2)
    assert says in result.stderr
    assert result.stdout == ""


@pytest.mark.slow
def test_of_several_receivers_one_is_chosen(uwbbench, two_receivers: Path, detector: Path) -> None:
    assert "front, rear" in uwbbench("score", two_receivers, "-d", detector, code=2).stderr
    found = json.loads(uwbbench("score", two_receivers, "-d", detector, "--receiver", "rear", "--json").stdout)
    assert found["receiver"] == "rear"
    assert found["latency_us"]["n"] == 39


@pytest.mark.slow
def test_score_json_is_pure_in_a_real_process(
    shell: Callable[..., subprocess.CompletedProcess[str]], capture: Path, detector: Path
) -> None:
    done = shell("score", capture, "--detector", detector, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["filtering"]["retained"] > 0


def test_a_results_file_is_scored_as_what_the_detector_found(uwbbench, capture: Path, tmp_path: Path) -> None:
    uwbbench("detect", capture, "-d", "paper", "-o", tmp_path / "found.csv")
    (tmp_path / "found.frames.csv").write_text("frame,time_us\n" + "".join(f"{frame},25\n" for frame in range(39)))
    read = json.loads(uwbbench("score", capture, "--results", tmp_path / "found.csv", "--json").stdout)
    run = json.loads(uwbbench("score", capture, "-d", "paper", "--no-latency", "--json").stdout)
    assert (read["filtering"], read["mapping"]) == (run["filtering"], run["mapping"])
    assert (read["detector"], read["results_file"]) == ("found", str(tmp_path / "found.csv"))
    assert (read["latency_us"]["n"], read["latency_us"]["p50"], read["latency_us"]["as_reported"]) == (39, 25, True)
    shown = uwbbench("score", capture, "--results", tmp_path / "found.csv").stdout
    assert "found (results file) on SIMULATED capture" in shown
    assert "time a frame, as the file reports it (39 frames): p50 25.0 us" in shown


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "give either --detector"),
        (["--results", "found.csv", "-d", "paper"], "give either --detector"),
        (["--results", "found.csv", "--set", "x=1"], "--set changes a detector"),
        (["--results", "found.csv"], "found.csv: line 2: range_m 250: metres?"),
        (["--results", "gone.csv"], "gone.csv: cannot be read"),
    ],
)
def test_a_results_file_that_makes_no_sense_is_a_usage_error(
    uwbbench, capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "found.csv").write_text("frame,range_m\n0,250\n")
    result = uwbbench("score", capture, *words, code=2)
    assert says in result.stderr
    assert "Traceback" not in result.stderr


# detect


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_detect_writes_the_table_of_the_python_interface(uwbbench, capture: Path, tmp_path: Path, suffix: str) -> None:
    result = uwbbench("detect", capture, "-d", "paper", "-o", f"new/folder/found{suffix}")
    assert result.stdout == ""
    path = tmp_path / f"new/folder/found{suffix}"
    table = pd.read_csv(path) if suffix == ".csv" else pd.read_parquet(path)
    expected = package.load_detector("paper").run(package.open_capture(capture)).to_pandas()
    assert list(table)[: len(COLUMNS)] == list(COLUMNS)
    assert len(table) == len(expected) > 0
    assert table["range_m"].to_numpy() == pytest.approx(expected["range_m"].to_numpy(), abs=1e-12)


def test_detect_needs_no_truth(uwbbench, capture_without_truth: Path, detector: Path, tmp_path: Path) -> None:
    uwbbench("detect", capture_without_truth, "-d", detector, "-o", "found.csv")
    assert len(pd.read_csv(tmp_path / "found.csv")) > 0


def test_detect_finds_nothing_in_invalid_frames(uwbbench, capture_with_nan: Path, detector: Path, tmp_path) -> None:
    result = uwbbench("detect", capture_with_nan, "-d", detector, "-o", "found.csv")
    assert not {3, 7} & set(pd.read_csv(tmp_path / "found.csv")["frame"])
    assert "in 37 of 39 frames" in result.stderr


def test_detect_on_an_empty_capture_writes_an_empty_table(uwbbench, empty_capture, detector, tmp_path) -> None:
    uwbbench("detect", empty_capture, "-d", detector, "-o", "found.csv")
    table = pd.read_csv(tmp_path / "found.csv")
    assert (len(table), next(iter(table))) == (0, "frame")


@pytest.mark.parametrize("name", ["found.txt", "found", "found.csv.gz"])
def test_detect_refuses_an_unknown_suffix(uwbbench, capture, detector, tmp_path, name) -> None:
    assert ".csv or .parquet" in uwbbench("detect", capture, "-d", detector, "-o", name, code=2).stderr
    assert not (tmp_path / name).exists()


def test_an_output_that_cannot_be_written_is_one_message(uwbbench, capture, detector, tmp_path) -> None:
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "folder.csv").mkdir()
    for name in ("file/found.csv", "folder.csv"):
        assert f"{name}: cannot be written" in uwbbench("detect", capture, "-d", detector, "-o", name, code=2).stderr


def test_a_truncated_capture_is_one_message(uwbbench, capture: Path, detector: Path) -> None:
    capture.write_bytes(capture.read_bytes()[:20_000])
    assert "run.h5" in uwbbench("detect", capture, "-d", detector, "-o", "found.csv", code=2).stderr


# calibrate


def test_calibrate_writes_a_detector_without_the_offset(
    uwbbench, capture: Path, detector: Path, tmp_path: Path
) -> None:
    uwbbench("calibrate", capture, "-d", "simple.yaml", "-o", "new/better.yaml", "--set", "name=inner")
    assert "SIMULATED" in (tmp_path / "new/better.yaml").read_text()
    opened = package.open_capture(capture)
    before, after = package.load_detector("simple.yaml"), package.load_detector(tmp_path / "new/better.yaml")
    offset_m = package.calibrate(before, opened).range_bias_m
    assert after.name == "inner-calibrated"
    assert after.run(opened).range_m == pytest.approx(before.run(opened).range_m - offset_m)


def test_calibrating_a_shipped_detector_extends_it_by_name(uwbbench, capture: Path, tmp_path: Path) -> None:
    uwbbench("calibrate", capture, "-d", "paper", "-o", "better.yaml")
    assert "extends: paper\n" in (tmp_path / "better.yaml").read_text()
    uwbbench("validate", "better.yaml")


def test_nothing_is_calibrated_without_truth_or_detections(uwbbench, capture, capture_without_truth, tmp_path) -> None:
    assert (
        "no ground truth" in uwbbench("calibrate", capture_without_truth, "-d", "paper", "-o", "x.yaml", code=2).stderr
    )
    assert "0 detections" in uwbbench("calibrate", capture, "-d", "null", "-o", "x.yaml", code=2).stderr
    assert ".yaml or .yml" in uwbbench("calibrate", capture, "-d", "paper", "-o", "x.json", code=2).stderr
    assert not (tmp_path / "x.yaml").exists()


def test_detections_are_written_in_the_order_of_frames(uwbbench, capture: Path, tmp_path: Path) -> None:
    uwbbench("detect", capture, "-d", "paper", "-o", "found.csv")
    frames = [int(line.split(",")[0]) for line in (tmp_path / "found.csv").read_text().splitlines()[1:]]
    assert frames == sorted(frames)
    assert frames
