"""Reports come from the run folder alone."""

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.fixtures.chance import reseeded
from uwbbench.api import Capture, StoreError, write_capture
from uwbbench.measure.accuracy.scoring import ScoringRules, score
from uwbbench.results import Report
from uwbbench.run import rescore, run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.identity import plain
from uwbbench.show.text.report import markdown, sheets, write_report

Run = Callable[..., RunFolder]
APPROACH = "{use: approach, params: {speed_m_s: 3.0}}"


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run a small experiment."""

    def make(detectors: str, datasets: str = f"[{APPROACH}]", **keys: object) -> RunFolder:
        lines = {
            "schema": 1,
            "detectors": detectors,
            "datasets": datasets,
            "latency": "false",
            "stability": "false",
            **keys,
        }
        (tmp_path / "tiny.yaml").write_text(reseeded("".join(f"{key}: {value}\n" for key, value in lines.items())))
        return run_experiment(read_experiment(tmp_path / "tiny.yaml"), tmp_path / "run", jobs=1)

    return make


def test_one_capture_on_the_leaderboard_has_the_numbers_of_its_scores(run: Run) -> None:
    folder = run("['null', paper, oracle]", scoring="[frame, peak]")
    (entry,) = [entry for entry in folder.entries() if entry.detector == "paper"]
    found, header = folder.detections(entry.unit), folder.header(entry.capture_id)
    board = Report(folder).leaderboard.set_index(["detector", "scoring", "table"])
    for scoring in ("frame", "peak"):
        expected = score(found, header, scoring)
        for table, block in (("filtering", expected.filtering), ("mapping", expected.mapping)):
            assert block is not None
            row = board.loc["paper", scoring, table]
            assert (row["precision"], row["recall"], row["f1"]) == (block.precision, block.recall, block.f1)
            assert (row["mae"], row["sd"], row["matched_mae"]) == (block.mae_m, block.sd_m, block.matched_mae_m)
            assert row["mae_n"] == block.retained
    assert board["source"].unique().tolist() == ["simulated"]


def test_the_best_detector_comes_first_and_the_undefined_last(run: Run) -> None:
    board = Report(run("['null', oracle]", scoring="frame")).leaderboard
    assert board["detector"].tolist() == ["oracle", "null"]
    assert math.isnan(board["precision"].iloc[1])


def test_captures_of_one_dataset_are_pooled_frame_by_frame(run: Run) -> None:
    folder = run("[paper-filtering]", "[{use: approach, params: {speed_m_s: 3.0, runs: 3}}]", scoring="frame")
    (row,) = Report(folder).leaderboard.to_dict("records")
    scores = folder.scores()
    assert row["captures"] == 3
    assert row["recall"] == scores["tp"].sum() / (scores["tp"].sum() + scores["fn"].sum())
    weights = scores["retained"] / scores["retained"].sum()
    assert row["mae"] == pytest.approx((scores["mae_m"] * weights).sum())


def test_intervals_hold_the_value_where_there_are_enough_captures(run: Run) -> None:
    folder = run(
        "[paper-filtering]", "[{use: approach, params: {speed_m_s: 4.0, runs: 12}, repeats: []}]", scoring="frame"
    )
    (row,) = Report(folder).leaderboard.to_dict("records")
    assert row["groups"] == row["scenes"] == 12
    assert row["mae_low"] < row["mae"] < row["mae_high"]
    assert row["f1_outer_low"] <= row["f1_low"] <= row["f1"]
    text = markdown(Report(folder))
    assert "Intervals: inner ones, for scenes like these. Outer ones of F1, at worst: paper-filtering " in text
    assert "12 scenes: if none of them fails, at most 26% of such scenes do" in text


def test_few_scenes_are_said_and_shown_one_by_one(run: Run) -> None:
    datasets = "[{use: approach, params: {speed_m_s: 4.0, runs: 4}, repeats: []}]"
    text = markdown(Report(run("[oracle]", datasets, scoring="frame")))
    assert "Intervals: outer ones, as if each scene ended all or nothing" in text
    assert "F1 of each scene, oracle: 1.000, 1.000, 1.000, 1.000" in text


def test_runs_of_one_scene_are_one_piece_of_evidence_and_rank_nobody(run: Run) -> None:
    folder = run("[oracle, paper-filtering]", "[{use: approach, params: {speed_m_s: 4.0, runs: 8}}]", scoring="frame")
    report = Report(folder)
    assert set(report.leaderboard["scenes"]) == {1}
    assert report.leaderboard["rank_low"].isna().all()
    assert [row[0]["detector"] for row in report.estimates] == ["paper-filtering", "oracle"]


def test_a_run_folder_without_scenes_has_one_for_each_capture(run: Run) -> None:
    folder = run("[oracle]", "[{use: approach, params: {speed_m_s: 4.0, runs: 8}}]", scoring="frame")
    del folder.manifest["scenes"]
    assert set(Report(folder).leaderboard["scenes"]) == {8}


def test_the_two_tables_of_the_paper_have_a_row_for_each_channel_and_material(run: Run) -> None:
    other = "{use: approach, params: {speed_m_s: 3.0, channel: 5, material: concrete}}"
    table = Report(run("[paper, oracle]", f"[{APPROACH}, {other}]", scoring="frame")).paper_tables
    after_filtering = table[table["table"] == "filtering"]
    keys = after_filtering[["detector", "channel", "material"]].to_records(index=False).tolist()
    assert keys == [(name, *what) for name in ("paper", "oracle") for what in ((9, "metal"), (5, "concrete"))]
    assert {"mae", "p90", "p95", "sd", "precision", "recall", "f1"} <= set(table.columns)
    assert set(table[table["table"] == "mapping"]["detector"]) == {"paper"}


def test_truth_that_is_not_exhaustive_shows_recall_beside_chance_and_no_precision(
    run: Run, tmp_path: Path, approach: Capture
) -> None:
    assert approach.truth is not None
    truth = dataclasses.replace(approach.truth, exhaustive=False)
    write_capture(tmp_path / "open.h5", dataclasses.replace(approach, truth=truth))
    report = Report(run("[paper-filtering]", "[{use: capture, params: {files: [open.h5]}}]", scoring="frame"))
    sheet, *_, paper, _ = sheets(report)
    assert "precision" not in sheet.columns
    assert "F1" not in sheet.columns
    assert {"recall", "chance recall"} <= set(sheet.columns)
    chance = float(sheet.rows[0][sheet.columns.index("chance recall")])
    assert 0 < chance < 0.5
    assert paper.rows[0][paper.columns.index("precision")] == "n/a"


def test_measured_and_simulated_captures_are_never_pooled(run: Run, tmp_path: Path, approach: Capture) -> None:
    write_capture(tmp_path / "a.h5", approach)
    write_capture(tmp_path / "b.h5", dataclasses.replace(approach, source="measured"))
    report = Report(run("[oracle]", "[{use: capture, params: {files: ['?.h5']}}]", scoring="frame"))
    assert report.leaderboard[["source", "captures"]].to_numpy().tolist() == [["measured", 1], ["simulated", 1]]
    text = markdown(report)
    assert "MEASURED" in text
    assert "SIMULATED" in text


def test_invalid_frames_are_counted(run: Run, tmp_path: Path, approach: Capture) -> None:
    preamble = np.array(approach.preamble[:])
    preamble[5:8] = np.nan
    write_capture(tmp_path / "holes.h5", dataclasses.replace(approach, preamble=preamble))
    report = Report(run("[oracle]", "[{use: capture, params: {files: [holes.h5]}}]", scoring="frame"))
    (row,) = report.leaderboard.to_dict("records")
    assert (row["frames"], row["invalid"], row["unprocessed"]) == (len(approach), 3, 3)
    assert "oracle: 3 frames invalid or not processed" in markdown(report)


def test_failures_and_captures_without_truth_are_listed_with_their_reasons(
    run: Run, tmp_path: Path, approach: Capture
) -> None:
    (tmp_path / "broken.h5").write_bytes(b"no hdf5 | at all")
    write_capture(tmp_path / "blind.h5", dataclasses.replace(approach, truth=None))
    report = Report(run("[oracle, 'null']", f"[{APPROACH}, {{use: capture, params: {{files: ['b*.h5']}}}}]"))
    by_title = {sheet.title: sheet for sheet in sheets(report)}
    assert len(by_title["Failed"].rows) == 3  # oracle needs the truth that blind.h5 lacks
    assert {row[0] for row in by_title["Not scored"].rows} == {"null (bound)"}
    assert "no ground truth" in by_title["Not scored"].rows[0][-1]


def test_a_run_in_which_everything_failed_still_has_a_report(run: Run, tmp_path: Path) -> None:
    (tmp_path / "broken.h5").write_bytes(b"")
    report = Report(run("[oracle]", "[{use: capture, params: {files: ['*.h5']}}]"))
    assert report.leaderboard.empty
    assert report.paper_tables.empty
    assert "## Failed" in markdown(report)
    assert json.dumps(plain(report.to_dict()), allow_nan=False)


def test_notes_of_detectors_reach_the_reader(run: Run) -> None:
    datasets = "[{use: approach, params: {speed_m_s: 3.0, sts: false, runs: 2}}]"
    report = Report(run("[paper]", datasets, scoring="frame"))
    assert any(": pdoa, filter.pdoa" in note and "(2 captures)" in note for note in report.notes)
    assert "left out, as the capture has no STS" in markdown(report)


def test_extra_metrics_are_columns(run: Run) -> None:
    report = Report(run("[paper-filtering]", scoring="frame", metrics="[bias]"))
    assert np.isfinite(report.leaderboard["bias"].iloc[0])
    assert "bias (cm)" in sheets(report)[0].columns


@pytest.mark.slow
def test_latency_is_shown_as_of_this_machine_only(run: Run) -> None:
    report = Report(run("['null']", scoring="frame", latency="{reference: 'null', frames: 40}"))
    row = report.latency.iloc[0]
    assert report.leaderboard["p50_us"].iloc[0] == row["p50_us"]
    assert (row["n"], row["p95_us"], row["reference"]) == (40, None, "null")
    text = markdown(report)
    assert "THIS MACHINE ONLY" in text
    assert "ratio to reference" in text


def test_a_report_after_scoring_again_follows_the_new_rules(run: Run) -> None:
    folder = run("[paper-filtering]", scoring="frame")
    before = Report(folder).leaderboard["recall"].iloc[0]
    rescore(folder, [ScoringRules("frame", 0.03)])
    assert Report(folder).leaderboard["recall"].iloc[0] < before


def test_the_report_is_written_into_the_run_and_hostile_names_stay_text(run: Run, tmp_path: Path) -> None:
    text = 'schema: 1\nname: "x|<script>\\n# y"\npipeline:\n  - {use: reference.nothing}\n'
    (tmp_path / "hostile.yaml").write_text(text)
    path = write_report(Report(run("[hostile.yaml]")))
    assert path.name == "report.md"
    assert "<script>" not in path.read_text()
    assert "\n# y" not in path.read_text()
    assert json.dumps(plain(Report(RunFolder(path.parent)).to_dict()), allow_nan=False)


def test_a_run_killed_before_its_scores_were_written_says_how_to_go_on(run: Run) -> None:
    folder = run("[oracle, 'null']", scoring="frame")
    folder.write_scores(
        [{"status": "scored", **dict.fromkeys(("detector", "dataset", "capture", "scoring", "table"), "x")}],
        folder.rules,
    )
    with pytest.raises(StoreError, match="continue it with --resume"):
        Report(folder).scored  # noqa: B018 - reading is what fails


def test_the_hard_cases_are_part_of_the_report_by_default(run: Run) -> None:
    report = Report(run("['null', cfar-os]", stability="true"))
    null, cfar = report.stability
    assert (null["detector"], cfar["detector"]) == ("null", "cfar-os")
    assert null["usual_hits"] == 0
    assert cfar["passed"] > 30
    assert cfar["failed"] == 0
    assert "## Hard cases" in markdown(report)


def test_captures_are_listed_with_licence_and_description(run: Run) -> None:
    report = Report(run("['null']"))
    (capture,) = report.captures
    assert capture["source"] == "simulated"
    assert capture["license"] == "BSD-3-Clause"
    assert capture["description"] in markdown(report)
