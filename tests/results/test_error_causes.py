"""Causes of errors of a run, added up, and what each costs."""

import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from uwbbench.results import Report
from uwbbench.results.error_causes import ErrorCauses
from uwbbench.results.report import EARLIER
from uwbbench.run.folder import RunFolder
from uwbbench.show.text.error_sheets import cause_sheets, main_causes
from uwbbench.show.text.report import Tables

pytestmark = pytest.mark.slow

BOARD = ("plates", "simulated", "object", "filtering")


def errors(tp=6, misses=None, false=None, exhaustive=True):
    misses, false = misses or {}, false or {}
    counts = tp, sum(false.values()), sum(misses.values())
    return ErrorCauses(BOARD, "mine", 2, 0, *counts, misses, false, {}, exhaustive)


def test_without_a_cause_its_misses_are_found_and_its_false_detections_are_gone():
    one = errors(6, {"no candidate": 2, "dropped by filter.snr": 1}, {"noise": 3})
    assert one.f1 == pytest.approx(12 / 18)
    without = {(cost.error, cost.cause): cost.f1 for cost in one.costs}
    assert without["missed", "no candidate"] == pytest.approx(16 / 20)
    assert without["missed", "dropped by filter.snr"] == pytest.approx(14 / 19)
    assert without["false", "noise"] == pytest.approx(12 / 15)
    gains = [cost.gain for cost in one.costs]
    assert gains == sorted(gains, reverse=True)


def test_f1_is_undefined_where_the_truth_is_not_exhaustive():
    one = errors(6, {"no candidate": 2}, exhaustive=False)
    assert np.isnan(one.f1)
    assert np.isnan(one.costs[0].f1)


def test_causes_of_a_run_add_up_to_its_scores(small_run: RunFolder):
    report = Report(small_run)
    table = report.folder.scores()
    for one in report.causes:
        dataset, _, scoring, after = one.board
        rows = table[(table.dataset == dataset) & (table.scoring == scoring) & (table.table == after)]
        rows = rows[rows.detector == one.detector]
        assert (sum(one.misses.values()), sum(one.false.values())) == (rows["fn"].sum(), rows["fp"].sum())
        assert (one.captures, one.unknown) == (9, 0)
    assert report.to_dict()["causes"][0]["causes"]


def test_a_sheet_shows_the_dearest_causes_and_puts_the_others_together():
    many = errors(6, {f"dropped by step{place}": place + 1 for place in range(7)})
    (sheet,) = cause_sheets([many])
    assert [row[3] for row in sheet.rows] == [*(f"dropped by step{place}" for place in (6, 5, 4, 3)), "3 others"]
    assert sum(int(row[4]) for row in sheet.rows) == many.fn
    assert "SIMULATED" in sheet.title


def test_the_board_by_object_is_shown_where_there_is_one(small_run: RunFolder):
    shown = main_causes(Report(small_run).causes)
    assert {one.board[2:] for one in shown} == {("object", "filtering")}
    assert {one.detector for one in shown} == {"paper", "cfar-os", "null"}


def test_a_run_of_an_older_version_has_no_causes_and_no_curves(small_run: RunFolder, tmp_path: Path):
    old = Path(shutil.copytree(small_run.path, tmp_path / "old"))
    shutil.rmtree(old / "curves")
    table = pq.read_table(old / "scores.parquet")
    pq.write_table(table.drop_columns("causes"), old / "scores.parquet")
    report = Report(RunFolder(old))
    assert report.causes == []
    assert EARLIER in report.notes
    assert report.curves == {}
    assert list(Tables(report).causes()) == list(Tables(report).curves()) == []
