"""Experiments run from Python, and what an opened run folder gives."""

import json

import numpy as np
import pytest

import uwbbench
from tests.library.conftest import SMALL
from uwbbench.api import ConfigError, PluginError, ScoringError, StoreError

PLATE = "approach-ch9-metal-1"


def test_a_run_leaves_the_reports_that_the_command_leaves(made):
    assert {"manifest.json", "report.md", "report.html", "scores.parquet"} <= {p.name for p in made.path.iterdir()}


def test_the_leaderboard_has_a_row_a_detector_and_table_with_intervals(made):
    table = made.leaderboard
    assert set(table["detector"][table["table"] == "filtering"]) == {"paper-filtering", "paper"}
    assert {"f1", "f1_low", "f1_high", "f1_n"} <= set(table)
    assert set(table["source"]) == {"simulated"}


def test_scores_have_a_row_a_detector_capture_and_table(made):
    rows = made.scores[made.scores["table"] == "filtering"]
    assert len(rows) == 2 * 3
    assert rows.set_index(["detector", "capture"]).loc[("paper", PLATE), "f1"] > 0.9


def test_times_have_a_row_a_timed_unit_with_its_ratio(made):
    assert set(made.times["detector"]) == {"paper", "paper-filtering"}
    assert (made.times["p50_us"] > 0).all()
    assert made.times["ratio"].notna().all()


def test_the_time_of_every_call_is_at_hand(made):
    row = made.times.iloc[0]
    times_us = made.frame_times_us(row["detector"], row["capture"])
    assert len(times_us) == row["n"]
    assert np.median(times_us) == pytest.approx(row["p50_us"])


def test_units_say_what_became_of_each(made):
    assert set(made.units["kind"]) == {"accuracy", "latency"}
    assert set(made.units["status"]) == {"done"}


def test_a_unit_that_fails_is_a_row_with_its_reason(tmp_path):
    experiment = SMALL | {"datasets": [{"use": "capture", "params": {"files": ["none.h5"]}}], "latency": False}
    run = uwbbench.run(experiment, tmp_path / "run", jobs=1)
    assert set(run.units["status"]) == {"failed"}
    assert "none.h5" in run.units["reason"].iloc[0]
    assert "failed" in repr(run)


def test_stored_detections_are_those_of_the_detector(made):
    plates = uwbbench.open_dataset("approach", {"speed_m_s": 3.0, "runs": 3})
    found = uwbbench.load_detector("paper").run(plates.open(PLATE))
    stored = made.detections("paper", PLATE)
    assert np.array_equal(stored["range_m"], found["range_m"])
    assert len(stored.to_pandas()) == len(found)


def test_a_capture_is_at_hand_without_its_samples(made):
    header = made.header(PLATE, "plates")
    assert header.source == "simulated"
    assert header.truth.objects[0].name == "plate"
    assert list(made.captures["capture"]) == [f"approach-ch9-metal-{run}" for run in (1, 2, 3)]


def test_the_manifest_is_plain(made):
    assert json.loads(json.dumps(made.manifest))["experiment"]["name"] == "small"


@pytest.mark.parametrize(
    ("names", "expected"),
    [(("papr", PLATE), "Did you mean 'paper'"), (("paper", "approach-ch9-metal-4"), "has no capture")],
)
def test_a_wrong_name_is_answered_with_the_nearest(made, names, expected):
    with pytest.raises(ConfigError, match=expected):
        made.detections(*names)


def test_a_capture_name_of_two_datasets_must_be_told_apart(tmp_path):
    twice = [{"use": "approach", "name": name, "params": {"speed_m_s": 3.0}} for name in ("one", "two")]
    run = uwbbench.run(SMALL | {"datasets": twice, "latency": False}, tmp_path / "run", jobs=1)
    with pytest.raises(ConfigError, match="one, two"):
        run.detections("paper", PLATE)
    assert len(run.detections("paper", PLATE, "two")) > 0


def test_a_folder_that_is_no_run_is_refused(tmp_path):
    with pytest.raises(StoreError, match="is not a run folder"):
        uwbbench.open_run(tmp_path)


@pytest.mark.parametrize("name", ["a.md", "a.html", "a.tex", "a.json"])
def test_a_report_is_written_in_the_format_of_its_suffix(made, name, tmp_path):
    written = made.report(tmp_path / name)
    assert "paper" in written.read_text()


def test_a_report_as_csv_is_a_folder(made, tmp_path):
    assert (made.report(tmp_path / "tables", "csv") / "leaderboard.csv").is_file()


@pytest.mark.parametrize(("name", "form"), [("a.docx", None), ("a.html", "docx")])
def test_an_unknown_format_is_refused(made, name, form, tmp_path):
    with pytest.raises(ConfigError, match="html"):
        made.report(tmp_path / name, form)


def test_a_file_that_is_no_report_is_kept(made, tmp_path):
    (tmp_path / "thesis.md").write_text("years of work")
    with pytest.raises(StoreError, match="is no report"):
        made.report(tmp_path / "thesis.md")


@pytest.mark.slow
def test_charts_are_written_as_pictures(tmp_path):
    run = uwbbench.run(SMALL | {"detectors": ["oracle"], "latency": False}, tmp_path / "run", jobs=1)  # few charts
    pictures = list(run.figures(tmp_path / "figures"))
    assert {path.name.split("-")[0] for path in pictures} == {"range", "errors", "curves", "radargram", "map"}
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in pictures)


def test_a_run_is_scored_again_by_other_rules(copied):
    before = copied.leaderboard
    copied.rescore("object", gate_m=0.05)
    assert set(copied.leaderboard["scoring"]) == {"object"}
    assert copied.leaderboard["recall"].max() < before["recall"].max()
    assert "object" in (copied.path / "report.md").read_text()
    assert copied.verify().passed


def test_a_scoring_that_does_not_exist_is_refused_and_nothing_changes(copied):
    with pytest.raises(ScoringError, match="frames"):
        copied.rescore("frames")
    assert set(copied.scores["scoring"]) == {"frame"}


def test_a_run_that_was_edited_does_not_verify(copied):
    with (copied.path / "scores.parquet").open("ab") as file:
        file.write(b"0")
    assert not copied.verify().passed


def test_a_notebook_shows_the_leaderboard_and_that_it_is_simulated(made):
    html = made._repr_html_()
    assert "paper-filtering" in html
    assert "SIMULATED" in html
    assert repr(made) == f"Run('{made.path}': small, 2 detectors, 3 captures)"


def test_a_mapping_gives_what_the_same_file_gives(made, tmp_path):
    (tmp_path / "small.yaml").write_text(json.dumps({"schema": 1, **SMALL}))
    again = uwbbench.run(tmp_path / "small.yaml", tmp_path / "run", jobs=1, changes={"latency": False})
    assert again.leaderboard["f1"].tolist() == made.leaderboard["f1"].tolist()


def test_the_mapping_of_the_caller_stays_as_it_is(tmp_path):
    given = {"detectors": ["papr"], "datasets": [{"use": "approach"}]}
    with pytest.raises(ConfigError):
        uwbbench.run(given, tmp_path / "run")
    assert given == {"detectors": ["papr"], "datasets": [{"use": "approach"}]}
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"gate": 0.1}, "experiment: gate: unknown key 'gate'"),
        ({"detectors": ["papr"]}, r"experiment: detectors\[0\]: no detector named 'papr'. Did you mean 'paper'"),
        ({"detectors": []}, "experiment: detectors"),
        ({"schema": 2}, "experiment: schema"),
    ],
)
def test_a_wrong_mapping_is_answered_with_its_key(change, expected, tmp_path):
    with pytest.raises(ConfigError, match=expected):
        uwbbench.run(SMALL | change, tmp_path / "run")


def test_an_interrupted_run_is_continued(copied):
    again = uwbbench.run(SMALL, copied.path, jobs=1, resume=True)
    assert again.path == copied.path
    assert len(again.units) == len(copied.units)


def test_a_dataset_that_does_not_exist_is_refused():
    with pytest.raises(PluginError, match="Did you mean 'approach'"):
        uwbbench.open_dataset("aproach")
