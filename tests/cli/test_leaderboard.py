"""``leaderboard``, ``verify`` and ``diff`` as a user calls them."""

import json
import shutil
from pathlib import Path

import pytest

from tests.cli.conftest import SIMPLE_DETECTOR

EXPERIMENT = """\
schema: 1
name: small
detectors: [./simple.yaml, "null"]
datasets:
  - {use: capture, params: {files: ["*.h5"]}}
scoring: [frame, object]
latency: false
stability: false
intervals: {resamples: 100}
"""


@pytest.fixture
def before(ran, tmp_path: Path) -> Path:
    """A run of two detectors, beside their capture."""
    shutil.copytree(ran("before", EXPERIMENT), tmp_path, dirs_exist_ok=True)
    return tmp_path / "before"


@pytest.fixture
def after(ran, before: Path) -> Path:
    """The same with a detector that guards more taps, and so misses what is near."""
    deaf = SIMPLE_DETECTOR.replace("guard_taps: 6", "guard_taps: 14")
    return Path(shutil.copytree(ran("after", EXPERIMENT, deaf) / "after", before.parent / "after"))


@pytest.mark.slow
def test_verify_says_what_was_checked(uwbbench, before: Path) -> None:
    assert uwbbench("verify", "before").stdout.startswith("before: consistent (")
    found = json.loads(uwbbench("verify", "before", "--json").stdout)
    assert found["before"]["passed"]
    assert found["before"]["problems"] == []


def test_verify_lists_what_does_not_hold_and_exits_with_1(uwbbench, before: Path) -> None:
    (before / "journal.jsonl").write_text("")
    text = uwbbench("verify", "before", code=1).stdout
    assert "DOES NOT HOLD" in text
    assert "journal.jsonl: was changed after the run ended" in text
    assert not json.loads(uwbbench("verify", "before", "--json", code=1).stdout)["before"]["passed"]


@pytest.mark.parametrize("command", [("verify",), ("leaderboard",), ("diff", "before")])
@pytest.mark.parametrize("content", [None, "{", '{"format": "uwbbench-run", "format_version": 0}', "\xff"])
def test_what_is_no_run_folder_is_one_message(uwbbench, before: Path, tmp_path: Path, command, content) -> None:
    (tmp_path / "other").mkdir()
    if content is not None:
        (tmp_path / "other" / "manifest.json").write_bytes(content.encode("latin-1"))
    error = uwbbench(*command, "other", code=2).stderr
    assert error.count("\n") == 1
    assert "other" in error


def test_leaderboard_prints_a_table_without_a_site(uwbbench, before: Path, after: Path) -> None:
    text = uwbbench("leaderboard", "before", "after").stdout
    assert "SIMULATED" in text
    assert "1 scene cannot rank" in text
    assert text.count("simple (") >= 2, "two versions of the same name"


def test_leaderboard_writes_a_site_and_replaces_it(uwbbench, before: Path, after: Path, tmp_path: Path) -> None:
    uwbbench("leaderboard", "before", "after", "-o", "site")
    assert (tmp_path / "site" / ".nojekyll").is_file()
    assert len(list((tmp_path / "site" / "detectors").iterdir())) == 3
    uwbbench("leaderboard", "before", "-o", "site")
    assert len(list((tmp_path / "site" / "detectors").iterdir())) == 2


def test_what_could_not_be_scored_is_told_on_the_site(
    uwbbench, capture_without_truth: Path, detector, tmp_path
) -> None:
    more = "  - {use: capture, name: lost, params: {files: [none.h5]}}\nscoring"
    (tmp_path / "small.yaml").write_text(EXPERIMENT.replace("scoring", more))
    uwbbench("run", "small.yaml", "--out", "before", "--jobs", 1, "--quiet", code=3)
    uwbbench("leaderboard", "before", "-o", "site")
    assert "Nothing could be scored" in (tmp_path / "site" / "index.html").read_text()
    assert "no file matches" in (tmp_path / "site" / "runs.html").read_text()
    (page,) = (tmp_path / "site" / "detectors").glob("simple-*")
    assert "has no ground truth" in page.read_text()


def test_leaderboard_json_is_one_object(uwbbench, before: Path) -> None:
    found = json.loads(uwbbench("leaderboard", "before", "--json").stdout, parse_constant=pytest.fail)
    assert [suite["name"] for suite in found["suites"]] == ["small"]


def test_leaderboard_writes_nothing_where_a_run_does_not_verify(uwbbench, before: Path, after: Path, tmp_path) -> None:
    (after / "scores.parquet").unlink()
    error = uwbbench("leaderboard", "before", "after", "-o", "site", code=1).stderr
    assert "after: scores.parquet: is missing" in error
    assert not (tmp_path / "site").exists()


def test_leaderboard_does_not_write_into_a_run_folder(uwbbench, before: Path) -> None:
    assert "is no site that" in uwbbench("leaderboard", "before", "-o", "before", code=2).stderr


def test_diff_of_a_run_with_itself_is_empty(uwbbench, before: Path) -> None:
    shutil.copytree(before, before.parent / "copy")
    text = uwbbench("diff", "before", "copy", "--exit-code").stdout
    assert "the same configuration, code, data and machine" in text
    assert "no score differs" in text
    assert "compared): none" in text


def test_diff_tells_what_went_in_then_scores_then_frames(uwbbench, before: Path, after: Path, tmp_path: Path) -> None:
    found = uwbbench("diff", "before", "after", "--figure", "worst.png")
    order = ["What went in", "guard_taps", "What came out", "recall", "Frames that flipped", "TP", "The worst first"]
    places = [found.stdout.index(text) for text in order]
    assert places == sorted(places)
    assert (tmp_path / "worst.png").read_bytes().startswith(b"\x89PNG")
    uwbbench("diff", "before", "after", "--exit-code", code=1)


def test_diff_draws_without_the_capture_and_says_so(uwbbench, before: Path, after: Path) -> None:
    (before.parent / "run.h5").unlink()
    found = uwbbench("diff", "before", "after", "--figure", "worst.svg", "--scoring", "object")
    assert "the response is not shown" in found.stderr
    assert (before.parent / "worst.svg").is_file()


def test_diff_json_is_one_object_with_nulls(uwbbench, before: Path, after: Path) -> None:
    found = json.loads(uwbbench("diff", "before", "after", "--json").stdout, parse_constant=pytest.fail)
    assert found["differs"]
    kinds = [change["kind"] for change in found["changes"]]
    assert kinds == sorted(kinds, key=["configuration", "code", "data", "machine"].index)
    assert sum(row["frames"] for row in found["flips"]["counts"]) > 0


def test_diff_refuses_a_wrong_figure_or_scoring(uwbbench, before: Path) -> None:
    assert "expected .png or .svg or .pdf" in uwbbench("diff", "before", "before", "--figure", "x.txt", code=2).stderr
    assert "was not scored by 'peak'" in uwbbench("diff", "before", "before", "--scoring", "peak", code=2).stderr


def test_help_shows_an_example(uwbbench) -> None:
    for command in ("leaderboard", "verify", "diff"):
        assert f"Example: uwbbench {command}" in uwbbench(command, "--help").stdout
