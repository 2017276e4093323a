"""Bounds: what reads the truth, or does not look at all, stands beside detectors and leads nothing."""

import pytest

from tests.fixtures.chance import reseeded
from tests.fixtures.contributions import content_of
from uwbbench.config.detector import detector_from_text, is_bound
from uwbbench.results import Report
from uwbbench.results.pareto import Speed, points
from uwbbench.results.verdicts import BOUNDS, ranks_of
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.show.page import Content
from uwbbench.show.page.answer import sentences
from uwbbench.show.text.report import markdown

EXPERIMENT = """\
schema: 1
name: bounds
detectors: [oracle, "null", paper-filtering, paper-subsample]
datasets: [{use: approach, name: plate, params: {speed_m_s: 4.0, runs: 6}, repeats: []}]
scoring: object
latency: false
stability: false
"""


RATIOS = {"oracle": 0.1, "paper-filtering": 1.0, "paper-subsample": 2.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """Two detectors between their bounds, on six scenes."""
    path = tmp_path_factory.mktemp("bounds")
    (path / "bounds.yaml").write_text(reseeded(EXPERIMENT))
    return run_experiment(read_experiment(path / "bounds.yaml"), path / "run", jobs=1)


@pytest.fixture(scope="module")
def report(folder: RunFolder) -> Report:
    return Report(folder)


@pytest.mark.parametrize(
    ("file", "bound"),
    [
        ("schema: 1\nname: a\npipeline: [{use: reference.oracle}]\n", True),
        ("schema: 1\nname: a\npipeline: [{use: reference.constant}]\n", True),
        ("schema: 1\nname: a\nextends: paper-filtering\n", False),
        ("schema: 1\nname: a\nextends: paper-filtering\nfidelity: reference\n", True),
    ],
)
def test_a_bound_is_known_by_its_stages_and_its_file(file: str, bound: bool) -> None:
    assert is_bound(detector_from_text(file)) is bound


def test_a_run_stores_who_is_a_bound(folder: RunFolder) -> None:
    assert folder.manifest["bounds"] == ["oracle", "null"]
    assert RunFolder(folder.path).bounds == {"oracle", "null"}


def test_of_an_older_run_the_files_of_its_detectors_say_it(folder: RunFolder) -> None:
    older = RunFolder(folder.path)
    del older.manifest["bounds"]
    assert older.bounds == {"oracle", "null"}


def test_bounds_have_no_rank_are_compared_with_nobody_and_stand_last(report: Report) -> None:
    (ranks,) = [ranks for board, ranks in report.ranks.items() if board[3] == "filtering"]
    assert set(ranks.sets) == {"paper-filtering", "paper-subsample"}
    assert ranks.order[2:] == ("oracle", "null")
    assert {(pair.first, pair.second) for pair in ranks.pairs} == {("paper-filtering", "paper-subsample")}
    assert ranks.leader != "oracle"
    assert "oracle" not in ranks.top


def test_the_comparisons_are_those_of_a_run_without_bounds(report: Report) -> None:
    (board,) = [board for board in report.boards if board[3] == "filtering"]
    alone = {name: report.boards[board][name] for name in ("paper-filtering", "paper-subsample")}
    again = ranks_of(alone, report.metrics, {name: report._estimates[board][name] for name in alone}, {})
    assert again.pairs == report.ranks[board].pairs
    assert again.sets == report.ranks[board].sets


def test_no_sentence_names_a_bound_and_every_table_marks_it(report: Report) -> None:
    (said,) = sentences(Content(report))
    assert "oracle" not in said
    text = markdown(report)
    assert "| oracle (bound) | – |" in text
    assert BOUNDS in text


def test_a_bound_is_not_on_the_front_and_puts_nobody_off_it(report: Report) -> None:
    (board,) = [board for board in report.boards if board[3] == "filtering"]
    speeds = {name: Speed("r", ratio, 0.9 * ratio, 1.1 * ratio, 1, 100.0, 1.0) for name, ratio in RATIOS.items()}
    drawn = {
        point.detector: point
        for point in points(report.boards[board], speeds, report.metrics["f1"], report.settings, report.bounds)
    }
    assert drawn["oracle"].bound
    assert not drawn["oracle"].on_front
    assert drawn["paper-filtering"].on_front


def test_the_site_ranks_detectors_and_marks_bounds(folder: RunFolder) -> None:
    content = content_of(folder.path)
    (section,) = content.sections
    assert "oracle" not in content.sentence(section)
    rows = {row[0].text: [cell.text for cell in row] for row in content.board(section.main).rows}
    assert rows["oracle (bound)"][1] == "–"
    assert rows["oracle (bound)"][4] == "bound"
    (board,) = [one for one in content.to_dict()["suites"][0]["boards"] if one["table"] == "filtering"]
    assert {one["detector"]: one["bound"] for one in board["standings"]} == {
        "paper-filtering": False,
        "paper-subsample": False,
        "oracle": True,
        "null": True,
    }
