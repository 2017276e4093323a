"""What a stored run is trusted with."""

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.fixtures.chance import seed
from uwbbench.api import UwbbenchError
from uwbbench.config.source import open_dataset
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.tools.gate.stored import StoredRun


@pytest.fixture
def run(tmp_path) -> Path:
    """A small run of two detectors."""
    file = tmp_path / "small.yaml"
    file.write_text(
        "schema: 1\ndetectors: [paper-filtering, oracle]\nlatency: false\nstability: false\n"
        f"datasets: [{{use: approach, params: {{speed_m_s: 3.0, seed: {seed()}}}}}]\n"
    )
    return run_experiment(read_experiment(file), tmp_path / "run", jobs=1).path


@pytest.fixture
def sha256() -> str:
    dataset = open_dataset("approach", {"speed_m_s": 3.0, "seed": seed()}, [])
    return dataset.open(dataset.names()[0]).sha256


def edit_table(path: Path, column: str, change) -> None:
    table = pq.read_table(path)
    values = pa.array([change(value) for value in table.column(column).to_pylist()], table.column(column).type)
    pq.write_table(table.set_column(table.column_names.index(column), column, values), path)


def test_detections_are_found_by_the_content_of_their_capture(run, sha256) -> None:
    stored = StoredRun(run, None, "paper-filtering")
    assert stored.detector == "paper-filtering"
    assert len(stored.detections("any name", sha256)) > 0
    with pytest.raises(UwbbenchError, match="no capture with the content of 'other'"):
        stored.detections("other", "0" * 64)


def test_the_detector_is_the_named_one_or_the_heads(run) -> None:
    assert StoredRun(run, "oracle", "paper-filtering").detector == "oracle"
    with pytest.raises(UwbbenchError, match=r"nothing of detector 'orcale'. Did you mean 'oracle'\?"):
        StoredRun(run, "orcale", "paper-filtering")
    with pytest.raises(UwbbenchError, match="nothing of detector 'mine'"):
        StoredRun(run, None, "mine")


def test_edited_detections_are_refused(run, sha256) -> None:
    for path in (run / "detections").iterdir():
        edit_table(path, "range_m", lambda value: value + 0.01)
    with pytest.raises(UwbbenchError, match=r"do not follow from its stored detections \(mae_m .*edited by hand"):
        StoredRun(run, None, "paper-filtering").detections("approach", sha256)


def test_edited_scores_are_refused(run, sha256) -> None:
    edit_table(run / "scores.parquet", "f1", lambda _: 0.5)
    with pytest.raises(UwbbenchError, match=r"\(f1 \(frame, filtering\) differs\)"):
        StoredRun(run, None, "paper-filtering").detections("approach", sha256)


def test_a_removed_row_of_scores_is_refused(run, sha256) -> None:
    path = run / "scores.parquet"
    pq.write_table(pq.read_table(path).slice(0, 1), path)
    with pytest.raises(UwbbenchError, match="rows of scores"):
        StoredRun(run, None, "paper-filtering").detections("approach", sha256)


@pytest.mark.parametrize("key", ["sha256", "radar", "truth"])
def test_an_edited_capture_is_refused(run, sha256, key) -> None:
    for path in (run / "captures").glob("*.json"):
        data = json.loads(path.read_text())
        del data[key]
        path.write_text(json.dumps(data))
    with pytest.raises(UwbbenchError, match=f"is damaged: KeyError: '{key}'"):
        StoredRun(run, None, "paper-filtering").detections("approach", sha256)


def test_a_torn_journal_is_mentioned(run, sha256) -> None:
    path = run / "journal.jsonl"
    lines = path.read_text().splitlines()
    kept = [line for line in lines if '"paper-filtering"' in line]
    torn = [line[:50] for line in lines if '"paper-filtering"' not in line]
    path.write_text("\n".join([*kept, *torn]))
    with pytest.raises(UwbbenchError, match="torn or damaged"):
        StoredRun(run, None, "paper-filtering").detections("other", "0" * 64)


def test_scoring_a_run_again_by_other_rules_does_not_spoil_it(run, sha256) -> None:
    from uwbbench.measure.accuracy.scoring import ScoringRules
    from uwbbench.run import rescore

    rescore(RunFolder(run), [ScoringRules("object", 0.05)])
    assert len(StoredRun(run, None, "paper-filtering").detections("approach", sha256)) > 0


def test_what_is_no_run_is_refused(tmp_path) -> None:
    with pytest.raises(UwbbenchError, match="is not a run folder"):
        StoredRun(tmp_path, None, "paper-filtering")
