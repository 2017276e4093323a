"""A folder that was changed after its run is found out; one that was not passes."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.run import rescore, run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.verify import verify

EXPERIMENT = """\
schema: 1
name: small
detectors: [oracle, paper-filtering]
datasets:
  - {use: approach, params: {speed_m_s: 3.0, runs: 2}}
scoring: [frame, object]
latency: {frames: 20, blocks: 8, reference: paper-filtering}
"""

Edit = Callable[[Path], None]


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run."""
    folder = tmp_path_factory.mktemp("verify")
    (folder / "small.yaml").write_text(EXPERIMENT)
    return run_experiment(read_experiment(folder / "small.yaml"), folder / "run", jobs=1).path


@pytest.fixture
def run(original: Path, tmp_path: Path) -> Path:
    """A copy that may be changed."""
    return Path(shutil.copytree(original, tmp_path / "run"))


def problems(run: Path) -> str:
    return "\n".join(verify(RunFolder(run)).problems)


def sealed(run: Path) -> None:
    """Seal a folder again, as a forger would."""
    RunFolder(run).seal()


def lines(run: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (run / "journal.jsonl").read_text().splitlines()]


def journal(run: Path, entries: list[dict[str, Any]]) -> None:
    (run / "journal.jsonl").write_text("".join(json.dumps(entry) + "\n" for entry in entries))


def edited_entry(run: Path, of: str, changes: dict[str, Any]) -> None:
    """Change the first line of a kind, and seal the folder again."""
    entries = lines(run)
    first = next(entry for entry in entries if entry["kind"] == of)
    first |= {key: {**first[key], **value} if isinstance(value, dict) else value for key, value in changes.items()}
    journal(run, entries)
    sealed(run)


def manifest(run: Path, **changes: Any) -> None:
    path = run / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_a_run_that_nobody_touched_passes(original: Path) -> None:
    found = verify(RunFolder(original))
    assert found.problems == ()
    assert found.checked["units scored again"] == 4
    assert found.checked["times summed up again"] == 2
    assert found.checked["files"] == len(RunFolder(original).result_files())


def test_scoring_again_and_reporting_keep_the_seal(run: Path) -> None:
    rescore(RunFolder(run), [ScoringRules("frame", 0.1)])
    (run / "report.md").write_text("a report")
    assert problems(run) == ""


def test_scoring_again_does_not_bless_what_was_changed_before(run: Path) -> None:
    (run / "journal.jsonl").write_text((run / "journal.jsonl").read_text() + "\n")
    rescore(RunFolder(run))
    assert problems(run) == "journal.jsonl: was changed after the run ended"


def test_continuing_a_run_seals_it_again(run: Path, original: Path) -> None:
    values = json.loads((run / "manifest.json").read_text())
    (run / "manifest.json").write_text(json.dumps({k: v for k, v in values.items() if k not in ("seal", "files")}))
    assert "has no seal: the run did not end, or an earlier version made it" in problems(run)
    run_experiment(read_experiment(original.parent / "small.yaml"), run, jobs=1, resume=True)
    assert problems(run) == ""


def test_a_file_changed_missing_or_added_is_named(run: Path) -> None:
    first, second = sorted((run / "detections").iterdir())[:2]
    first.write_bytes(first.read_bytes() + b" ")
    second.unlink()
    (run / "times" / "extra.parquet").write_bytes(b"")
    found = problems(run)
    assert f"detections/{first.name}: was changed after the run ended" in found
    assert f"detections/{second.name}: is missing" in found
    assert "times/extra.parquet: was added after the run ended" in found


def test_a_manifest_edited_by_hand_does_not_fit_its_seal(run: Path) -> None:
    sessions = json.loads((run / "manifest.json").read_text())["sessions"]
    sessions[0]["machine"]["cpu"] = "a better one"
    manifest(run, sessions=sessions)
    assert "manifest.json: was changed after the run ended: its seal does not fit" in problems(run)


def test_another_machine_does_not_fit_the_times_even_with_a_new_seal(run: Path) -> None:
    sessions = json.loads((run / "manifest.json").read_text())["sessions"]
    sessions[0]["machine"]["cpu"] = "a better one"
    manifest(run, sessions=sessions)
    sealed(run)
    assert "latency oracle" in problems(run)
    assert "its identity is not that of its detector, capture, rules and machine" in problems(run)


def test_a_score_edited_by_hand_is_not_that_of_the_detections(run: Path) -> None:
    table = pq.ParquetFile(run / "scores.parquet").read()
    column = table.column_names.index("f1")
    values = table.column("f1").to_pylist()
    edited = table.set_column(column, "f1", pa.array([0.5, *values[1:]]))
    pq.write_table(edited.replace_schema_metadata(table.schema.metadata), run / "scores.parquet")
    sealed(run)
    assert "f1 0.5, not " in problems(run)
    assert problems(run).count("\n") == 0


def test_causes_that_do_not_add_up_to_the_errors_are_found_out(run: Path) -> None:
    entries = lines(run)
    row = next(entry for entry in entries if entry["kind"] == "accuracy")["scores"][0]
    row["causes"] = json.dumps({"misses": {"no candidate": row["fn"] + 1}, "false": {"noise": row["fp"]}})
    journal(run, entries)
    sealed(run)
    assert f"the causes of fn add up to {row['fn'] + 1}, not to {row['fn']}" in problems(run)


def test_a_row_of_scores_taken_out_is_missed(run: Path) -> None:
    table = pq.ParquetFile(run / "scores.parquet").read()
    pq.write_table(table.slice(1), run / "scores.parquet")
    sealed(run)
    assert "the row is missing" in problems(run)


def test_detections_of_another_detector_do_not_give_the_scores(run: Path) -> None:
    units = {e["detector"]: e["unit"] for e in lines(run) if e["kind"] == "accuracy"}
    first, second = (run / "detections" / f"{unit}.parquet" for unit in units.values())
    content = first.read_bytes(), second.read_bytes()
    first.write_bytes(content[1])
    second.write_bytes(content[0])
    sealed(run)
    assert "edited, or made by another version" in problems(run)


def test_a_line_taken_out_of_the_journal_is_missed(run: Path) -> None:
    entries = lines(run)
    del entries[next(place for place, entry in enumerate(entries) if entry["kind"] == "accuracy")]
    journal(run, entries)
    sealed(run)
    assert "no line about" in problems(run)


@pytest.mark.parametrize(
    ("kind", "changes", "expected"),
    [
        ("accuracy", {"identity": "0" * 64}, "its identity is not that of"),
        ("accuracy", {"detector": "better"}, "the name of its files is not that of what it is about"),
        ("accuracy", {"unit": "../../../etc/passwd"}, "the name of its files is not that of what it is about"),
        ("accuracy", {"capture_id": "../../secret"}, "its capture is not the one that it names"),
        ("accuracy", {"status": "excellent"}, "status must be done or failed, not excellent"),
        ("accuracy", {"facts": {"detections": 7000}}, "states 7000 detections, stored are"),
        ("accuracy", {"facts": {"source": "measured"}}, "its capture is simulated"),
        ("accuracy", {"scores": []}, "has 0 rows of scores"),
        ("accuracy", {"scores": 5}, "does not hold what a run of this version writes"),
        ("latency", {"facts": {"p50_us": 0.001}}, "p50_us 0.001, not"),
        ("latency", {"facts": {"missed": -1}}, "missed -1, not"),
        ("stability", {"identity": "x"}, "its identity is not that of"),
        ("stability", {"kind": "magic"}, "no kind of unit 'magic'"),
    ],
)
def test_a_journal_edited_and_sealed_again_is_found_out(
    run: Path, kind: str, changes: dict[str, Any], expected: str
) -> None:
    edited_entry(run, kind, changes)
    assert expected in problems(run)


@pytest.mark.parametrize("name", ["journal.jsonl", "scores.parquet", "detections", "captures", "times"])
@pytest.mark.parametrize("share", [0.0, 0.6])
def test_a_truncated_file_is_a_problem_and_no_crash(run: Path, name: str, share: float) -> None:
    for path in [run / name] if (run / name).is_file() else sorted((run / name).iterdir()):
        content = path.read_bytes()
        path.write_bytes(content[: int(share * len(content))])
    assert not verify(RunFolder(run)).passed
    sealed(run)
    assert not verify(RunFolder(run)).passed


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=3,
)


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whatever_stands_in_the_manifest_is_no_crash(run: Path, original: Path, data: st.DataObject) -> None:
    values = json.loads((original / "manifest.json").read_text())
    at: Any = values
    while True:
        keys = list(at) if isinstance(at, dict) else list(range(len(at)))
        key = data.draw(st.sampled_from([key for key in keys if key not in ("format", "format_version")]))
        if not (isinstance(at[key], dict | list) and at[key] and data.draw(st.booleans())):
            break
        at = at[key]
    at[key] = data.draw(VALUES.filter(lambda value: value != at[key]))
    (run / "manifest.json").write_text(json.dumps(values))
    assert not verify(RunFolder(run)).passed


def test_a_torn_line_of_a_crash_before_a_resumed_run_is_a_note(run: Path) -> None:
    (run / "journal.jsonl").write_text('{"unit": "to\n' + (run / "journal.jsonl").read_text())
    sealed(run)
    found = verify(RunFolder(run))
    assert found.passed
    assert found.notes == ("journal.jsonl line 1 is torn or damaged and was ignored",)
