"""What a comparison of two runs finds, against what was changed and against counting by hand."""

import json
import math
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.fixtures.chance import reseeded
from uwbbench.api import StoreError
from uwbbench.measure.accuracy.metrics.detection import Recall
from uwbbench.measure.accuracy.scoring import ScoringRules, outcomes
from uwbbench.measure.accuracy.stats import paired_difference
from uwbbench.results.comparison import Comparison, compare
from uwbbench.results.comparison.flips import _name
from uwbbench.run import rescore, run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder

EXPERIMENT = """\
schema: 1
name: small
detectors: [{{use: paper-filtering, set: {{pipeline.filter.prominence.params.minimum: {prominence}}}}}, cfar-os]
datasets: [{{use: approach, name: plate, params: {{speed_m_s: 0.7, runs: 2, channel: 5, material: {material}}}}}]
scoring: [frame, object]
latency: false
stability: false
"""

Make = Callable[..., RunFolder]


@pytest.fixture(scope="module")
def make(tmp_path_factory: pytest.TempPathFactory) -> Make:
    def made(prominence: float = 0.05, material: str = "plywood") -> RunFolder:
        folder = tmp_path_factory.mktemp("compare")
        (folder / "small.yaml").write_text(reseeded(EXPERIMENT.format(prominence=prominence, material=material)))
        return run_experiment(read_experiment(folder / "small.yaml"), folder / "run", jobs=1)

    return made


@pytest.fixture(scope="module")
def first(make: Make) -> RunFolder:
    return make()


@pytest.fixture(scope="module")
def second(make: Make) -> RunFolder:
    return make(prominence=0.02)


@pytest.fixture(scope="module")
def found(first: RunFolder, second: RunFolder) -> Comparison:
    return compare(first, second)


def copy_of(folder: RunFolder, target: Path) -> Path:
    return Path(shutil.copytree(folder.path, target))


def test_what_went_in_is_what_was_changed_and_nothing_else(found: Comparison) -> None:
    told = {(one.kind, one.where): (one.before, one.after) for one in found.changes}
    threshold = "detectors.paper-filtering.pipeline.filter.prominence.params.minimum"
    assert told.pop(("configuration", threshold)) == (0.05, 0.02)
    assert list(told) == [("code", "identity of detector paper-filtering")]


def test_a_detector_that_did_not_change_has_the_same_scores(found: Comparison) -> None:
    assert {one.detector for one in found.changed_scores} == {"paper-filtering"}
    assert found.flip_counts["cfar-os"] == Counter()
    assert all(one.difference.value == 0 for one in found.scores if one.detector == "cfar-os")


def test_differences_are_second_minus_first_in_pairs(found: Comparison, first: RunFolder, second: RunFolder) -> None:
    rule = first.rules[0]
    sides = []
    for folder in (first, second):
        entries = [e for e in folder.entries() if (e.kind, e.detector) == ("accuracy", "paper-filtering")]
        entries.sort(key=lambda entry: entry.capture)
        sides.append(
            [outcomes(folder.detections(e.unit), folder.header(e.capture_id), rule)["filtering"] for e in entries]
        )
    (one,) = [
        change
        for change in found.scores
        if (change.detector, change.metric, *change.board[2:]) == ("paper-filtering", "recall", "frame", "filtering")
    ]
    scenes = [first.scene(entry.dataset, entry.capture) for entry in entries]
    assert repr(one.difference) == repr(paired_difference(Recall, sides[1], sides[0], scenes)), "NaN equals nothing"
    assert one.difference.value == pytest.approx(one.after - one.before)
    assert one.difference.value > 0, "a lower threshold finds more"


def test_flips_are_those_of_counting_frame_by_frame(found: Comparison, first: RunFolder, second: RunFolder) -> None:
    counted: Counter[tuple[str, str]] = Counter()
    frames = 0
    for entry in first.entries():
        header = first.header(entry.capture_id)
        pair = [outcomes(f.detections(entry.unit), header, first.rules[0])["filtering"] for f in (first, second)]
        for row in range(len(pair[0].group)):
            before, after = ([int(o.tp[row]), int(o.fp[row]), int(o.fn[row])] for o in pair)
            frames += 1
            if before != after:
                counted[_name(before), _name(after)] += 1
    assert sum(found.flip_counts.values(), Counter()) == counted
    assert counted["FN", "TP"] > 0
    assert found.compared_frames == frames


def test_the_worst_frames_stand_first(first: RunFolder, second: RunFolder) -> None:
    backwards = compare(second, first, most=10_000)
    losses = [one.loss for one in backwards.worst]
    assert losses == sorted(losses, reverse=True)
    assert len(losses) == sum(sum(counter.values()) for counter in backwards.flip_counts.values())
    assert [one.frame for one in compare(second, first, most=3).worst] == [one.frame for one in backwards.worst[:3]]
    worst = backwards.worst[0]
    assert (worst.before, worst.after, worst.loss) == ("TP", "FN", 2)
    detections = second.detections(worst.unit.entries[0].unit)
    assert worst.frame in detections.frame
    assert worst.frame not in first.detections(worst.unit.entries[1].unit).frame
    assert math.isnan(worst.error_after_m)
    assert worst.error_before_m <= 0.2


def test_turning_the_runs_around_turns_the_differences_around(
    found: Comparison, first: RunFolder, second: RunFolder
) -> None:
    back = compare(second, first)
    for one, other in zip(found.scores, back.scores, strict=True):
        np.testing.assert_allclose(one.difference.value, -other.difference.value, atol=1e-12)
    assert {
        (after, before): count for counter in back.flip_counts.values() for (before, after), count in counter.items()
    } == {key: count for counter in found.flip_counts.values() for key, count in counter.items()}


def test_a_run_beside_its_copy_does_not_differ(first: RunFolder, tmp_path: Path) -> None:
    same = compare(first, RunFolder(copy_of(first, tmp_path / "copy")))
    assert not same.differs
    assert same.changes == same.changed_scores == same.worst == same.notes == ()


def test_captures_of_other_content_are_told_and_left_out(first: RunFolder, make: Make) -> None:
    other = compare(first, make(material="metal"))
    assert other.scores == ()
    assert other.differs
    assert "configuration" in {one.kind for one in other.changes}
    assert any("units not compared: only in the first run" in note for note in other.notes)


def test_other_rules_of_the_second_run_are_told_and_not_used(first: RunFolder, tmp_path: Path) -> None:
    stricter = RunFolder(copy_of(first, tmp_path / "stricter"))
    rescore(stricter, [ScoringRules("frame", 0.01)])
    found = compare(first, stricter)
    assert [one.where for one in found.changes] == ["rules of the scores"]
    assert found.changed_scores == ()
    assert any("judged here by those of the first" in note for note in found.notes)


def test_other_sources_are_named(first: RunFolder, tmp_path: Path) -> None:
    path = copy_of(first, tmp_path / "patched")
    values = json.loads((path / "manifest.json").read_text())
    values["sources"]["cfar.os"] = "0" * 64
    values["sessions"][-1]["machine"]["cpu"] = "another"
    (path / "manifest.json").write_text(json.dumps(values))
    RunFolder(path).seal()
    told = {(one.kind, one.where) for one in compare(first, RunFolder(path)).changes}
    assert told == {("code", "sources of cfar.os"), ("machine", "cpu")}


def test_a_run_that_did_not_end_is_told(first: RunFolder, tmp_path: Path) -> None:
    path = copy_of(first, tmp_path / "unfinished")
    RunFolder(path).update_manifest()
    assert any("is not sealed" in note for note in compare(first, RunFolder(path)).notes)


@pytest.mark.parametrize("key", ["experiment", "sessions", "detectors", "data"])
@pytest.mark.parametrize("value", [5, [], {"name": 3}, None])
def test_a_manifest_edited_by_hand_is_told_in_one_line(
    first: RunFolder, tmp_path: Path, key: str, value: object
) -> None:
    path = copy_of(first, tmp_path / "edited")
    values = json.loads((path / "manifest.json").read_text())
    (path / "manifest.json").write_text(json.dumps({**values, key: value}))
    try:
        told = compare(first, RunFolder(path)).notes[0]
    except StoreError as error:
        told = str(error)
    assert "edited" in told or "was changed after the run ended" in told
    assert "\n" not in told


def test_causes_that_grew_come_first_and_add_up_to_what_the_misses_did(
    found: Comparison, first: RunFolder, second: RunFolder
) -> None:
    def misses(run: RunFolder, detector: str) -> int:
        table = run.scores().query("scoring == 'frame' and detector == @detector and table == 'filtering'")
        return int(table["fn"].sum())

    growth = [change.growth for change in found.causes]
    assert growth == sorted(growth, reverse=True)
    assert {change.detector for change in found.causes} == {"paper-filtering"}
    missed = [change for change in found.causes if change.error == "missed"]
    assert sum(change.growth for change in missed) == misses(second, "paper-filtering") - misses(
        first, "paper-filtering"
    )
    fewer = next(change for change in missed if change.cause == "dropped by filter.prominence")
    assert fewer.growth < 0


def test_causes_of_other_rules_and_of_older_runs_are_noted_and_not_compared(
    first: RunFolder, second: RunFolder, tmp_path: Path
) -> None:
    strict = RunFolder(Path(shutil.copytree(second.path, tmp_path / "strict")))
    rescore(strict, [ScoringRules("frame", 0.1)])
    by_others = compare(first, strict)
    assert by_others.causes == ()
    assert "causes of errors not compared: the runs were scored by different rules" in by_others.notes
    rescore(strict, first.rules[:1])
    entries = [json.loads(line) for line in (strict.path / "journal.jsonl").read_text().splitlines()]
    for entry in entries:
        for row in entry["scores"]:
            row.pop("causes")
    (strict.path / "journal.jsonl").write_text("".join(json.dumps(entry) + "\n" for entry in entries))
    rescore(strict)
    older = compare(first, strict)
    assert any("causes of errors of" in note and "not stored" in note for note in older.notes)
