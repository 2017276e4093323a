"""Which runs are put together, what counts of them, and who is better than whom."""

import math
from pathlib import Path

import pytest

from tests.fixtures.contributions import changed, elsewhere, failing, suites_of
from uwbbench.api import StoreError
from uwbbench.measure.accuracy.boards import holm
from uwbbench.measure.accuracy.metrics.detection import F1
from uwbbench.measure.accuracy.stats import paired_difference
from uwbbench.results.leaderboard import Unverified, read_runs
from uwbbench.results.leaderboard.ranking import Ranking, rankings, speeds_by_machine, speeds_of
from uwbbench.results.leaderboard.suites import Contender, Suite
from uwbbench.run.folder import RunFolder

pytestmark = pytest.mark.slow


def named(suite: Suite, name: str) -> Contender:
    (found,) = [one for one in suite.contenders if one.name == name]
    return found


def first_board(suite: Suite) -> Ranking:
    return rankings(suite)[0]


def ranks(ranking: Ranking) -> dict[str, int | None]:
    return {one.contender.name: one.ranks for one in ranking.standings}


def test_runs_on_the_same_captures_under_the_same_rules_are_one_suite(alice: Path, bob: Path) -> None:
    (suite,) = suites_of(alice, bob)
    assert {one.name for one in suite.contenders} == {"paper-filtering", "twin", "null", "cfar-os"}
    assert [run.name for run in named(suite, "paper-filtering").runs] == ["alice", "bob"]
    assert len(suite.captures) == 6
    assert all(len(content) == 64 for content in suite.captures.values())


def test_another_gate_is_another_version(alice: Path, dave: Path) -> None:
    found = suites_of(alice, dave)
    assert len(found) == 2
    assert len({suite.version for suite in found}) == 2
    assert {suite.name for suite in found} == {"suite"}


def test_the_same_name_with_another_identity_is_another_version_of_the_detector(alice: Path, carol: Path) -> None:
    (suite,) = suites_of(alice, carol)
    versions = [one for one in suite.contenders if one.name == "paper-filtering"]
    assert len({one.identity for one in versions}) == len({one.key for one in versions}) == 2


def test_the_order_of_the_runs_changes_nothing(alice: Path, bob: Path, carol: Path) -> None:
    one, other = suites_of(alice, bob, carol), suites_of(carol, bob, alice)
    assert [suite.version for suite in one] == [suite.version for suite in other]
    assert [c.key for s in one for c in s.contenders] == [c.key for s in other for c in s.contenders]


def test_the_newest_run_counts_where_two_did_the_same(alice: Path, bob: Path) -> None:
    (suite,) = suites_of(alice, bob)
    assert {run.name for run, _ in named(suite, "paper-filtering").chosen.values()} == {"bob"}
    assert named(suite, "paper-filtering").disagreements == []


def test_a_failure_does_not_hide_what_worked_in_another_run(alice: Path, bob: Path, tmp_path: Path) -> None:
    capture = RunFolder(bob).entries()[0].capture
    broken = failing(bob, tmp_path / "broken", "paper-filtering", capture)
    (suite,) = suites_of(alice, broken)
    assert {entry.status for _, entry in named(suite, "paper-filtering").chosen.values()} == {"done"}
    (alone,) = suites_of(broken)
    failed = [entry.capture for _, entry in named(alone, "paper-filtering").chosen.values() if entry.status == "failed"]
    assert failed == [capture]


def test_a_capture_that_a_run_could_not_use_does_not_split_the_suite(alice: Path, carol: Path, tmp_path: Path) -> None:
    capture = RunFolder(carol).entries()[0].capture
    broken = failing(carol, tmp_path / "broken", "paper-filtering", capture)
    assert len(suites_of(alice, broken)) == 1


def test_a_detector_that_was_not_scored_everywhere_has_no_rank(alice: Path, bob: Path, tmp_path: Path) -> None:
    capture = RunFolder(bob).entries()[0].capture
    (suite,) = suites_of(alice, failing(bob, tmp_path / "broken", "cfar-os", capture))
    assert ranks(first_board(suite)) == {"paper-filtering": (1, 2), "twin": (1, 2), "null": None, "cfar-os": None}


def test_equal_detectors_share_a_rank_and_a_bound_has_none(alice: Path) -> None:
    (suite,) = suites_of(alice)
    board = first_board(suite)
    assert ranks(board) == {"paper-filtering": (1, 2), "twin": (1, 2), "null": None}
    first, twin, null = (named(suite, name).key for name in ("paper-filtering", "twin", "null"))
    pair = board.pair(first, twin, "f1")
    assert pair is not None
    assert (pair.verdict, pair.better, pair.difference.value) == ("not told apart", None, 0.0), (
        "six scenes prove no more"
    )
    assert board.pair(null, first, "f1") is None


def test_pairs_are_those_of_the_statistics_adjusted_together(alice: Path, bob: Path) -> None:
    (suite,) = suites_of(alice, bob)
    board = first_board(suite)
    outcomes = {
        one.contender.key: [part.outcome for part in sorted(one.scored, key=lambda s: s.capture)]
        for one in board.standings
    }
    pairs = [pair for pair in board.pairs if pair.metric == "f1"]
    assert len(pairs) == 3  # of three detectors; a bound is compared with none
    p_values = []
    for pair in pairs:
        expected = paired_difference(F1, outcomes[pair.first], outcomes[pair.second])
        assert pair.difference.value == expected.value
        assert (pair.difference.low, pair.difference.high) == pytest.approx((expected.low, expected.high))
        p_values.append(expected.p_value)
    assert [pair.adjusted for pair in pairs] == pytest.approx(holm(p_values).tolist())


def test_a_pair_seen_from_the_other_side_is_turned_around(alice: Path) -> None:
    (suite,) = suites_of(alice)
    board = first_board(suite)
    pair = board.pairs[1]
    turned = board.pair(pair.second, pair.first, pair.metric)
    assert turned is not None
    assert turned.difference.value == -pair.difference.value
    assert (turned.difference.low, turned.difference.high) == (-pair.difference.high, -pair.difference.low)
    assert turned.better == pair.better


def test_times_of_two_machines_are_ratios_put_together(alice: Path, tmp_path: Path) -> None:
    far = elsewhere(alice, tmp_path / "far", factor=4.0)
    (suite,) = suites_of(alice, far)
    twin = named(suite, "twin")
    by_machine = list(speeds_by_machine(suite, twin, "plate").values())
    assert len(by_machine) == 2
    together = speeds_of(suite, "plate")[twin.key]
    low, high = sorted(speed.ratio for speed in by_machine)
    assert together.ratio == pytest.approx(math.sqrt(low * high))
    assert together.ratio == pytest.approx(2 * low)
    assert together.low == min(speed.low for speed in by_machine)
    assert together.high == max(speed.high for speed in by_machine)
    assert math.isnan(together.p50_us)
    assert math.isnan(together.deadline), "a frame period in times of the reference holds on one machine"


def test_a_ratio_to_another_reference_is_not_put_beside_the_others(alice: Path, tmp_path: Path) -> None:
    def other_reference(manifest: dict, entries: list[dict]) -> None:
        manifest["reference"] = "f" * 64
        manifest["sessions"][-1]["started"] = "2020-01-01T00:00:00+00:00"

    stranger = changed(alice, tmp_path / "stranger", other_reference)
    (suite,) = suites_of(alice, stranger)
    twin = named(suite, "twin")
    assert len(twin.timed) == 2
    assert [speed.captures for speed in speeds_by_machine(suite, twin, "plate").values()] == [1]


def test_a_run_that_does_not_verify_is_refused_with_all_that_is_wrong(alice: Path, bob: Path, tmp_path: Path) -> None:
    def better(manifest: dict, entries: list[dict]) -> None:
        entries[0]["scores"][0]["f1"] = 0.123

    forged = changed(bob, tmp_path / "forged", better)
    with pytest.raises(Unverified, match=r"forged: journal\.jsonl.*f1 0\.123, not"):
        read_runs([alice, forged])


def test_the_same_run_twice_is_refused(alice: Path, tmp_path: Path) -> None:
    import shutil

    copy = Path(shutil.copytree(alice, tmp_path / "copy"))
    with pytest.raises(StoreError, match="is the same run as"):
        read_runs([alice, copy])


def test_runs_in_folders_of_the_same_name_keep_distinct_names(alice: Path, bob: Path, tmp_path: Path) -> None:
    import shutil

    for name, run in (("one", alice), ("two", bob)):
        shutil.copytree(run, tmp_path / name / "run")
    assert {run.name for run in read_runs([tmp_path / "one/run", tmp_path / "two/run"])} == {"one/run", "two/run"}
