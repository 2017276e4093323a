"""Runs compared and put together from Python."""

import pytest

import uwbbench
from tests.library.conftest import SMALL
from uwbbench.api import ConfigError, StoreError
from uwbbench.results.leaderboard import Unverified


@pytest.fixture(scope="session")
def cautious(tmp_path_factory) -> uwbbench.Run:
    """The same captures with another threshold."""
    detector = {"use": "paper", "set": {"pipeline.filter.prominence.params.minimum": 0.2}}
    experiment = SMALL | {"detectors": [detector], "latency": False}
    return uwbbench.run(experiment, tmp_path_factory.mktemp("library") / "cautious", jobs=1)


def test_a_comparison_says_what_went_in_and_what_came_out(made, cautious):
    found = uwbbench.compare(made, cautious.path)
    assert any("prominence" in change.where for change in found.changes)
    assert {one.detector for one in found.changed_scores} == {"paper"}
    assert found.differs


def test_a_run_does_not_differ_from_itself(made):
    assert not uwbbench.compare(made, made).differs


def test_a_comparison_by_a_scoring_that_the_run_has_not_is_refused(made):
    with pytest.raises(ConfigError, match="was not scored by"):
        uwbbench.compare(made, made, scoring="object")


def test_a_leaderboard_has_a_row_a_board_and_version_of_a_detector(made, cautious):
    table = uwbbench.leaderboard([made, cautious.path]).table
    board = table[table["table"] == "filtering"]
    assert sorted(board["detector"]) == ["paper", "paper", "paper-filtering"]
    assert board["identity"].nunique() == 3
    assert board["time_ratio"].notna().sum() == 2


def test_a_leaderboard_compares_its_detectors_in_pairs(made, cautious):
    pairs = uwbbench.leaderboard([made, cautious]).pairs
    assert set(pairs["verdict"]) <= {"differs", "equal", "not told apart", "too few", "undefined"}
    assert {"difference", "low", "high", "p_adjusted"} <= set(pairs)


@pytest.mark.slow
def test_a_leaderboard_writes_its_site(made, tmp_path):
    board = uwbbench.leaderboard([made], tmp_path / "site")
    assert "SIMULATED" in (tmp_path / "site" / "index.html").read_text()
    assert board.write(tmp_path / "other").is_file()
    assert board.to_dict()["suites"][0]["name"] == "small"


def test_a_folder_of_other_things_gets_no_site(made, tmp_path):
    (tmp_path / "thesis.md").write_text("years of work")
    with pytest.raises(StoreError, match="is no site"):
        uwbbench.leaderboard([made], tmp_path)


def test_a_run_that_does_not_verify_is_on_no_leaderboard(made, copied):
    with (copied.path / "scores.parquet").open("ab") as file:
        file.write(b"0")
    with pytest.raises(Unverified, match=r"scores\.parquet"):
        uwbbench.leaderboard([made, copied])


def test_a_leaderboard_of_nothing_has_an_empty_table():
    assert uwbbench.leaderboard([]).table.empty
