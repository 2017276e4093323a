"""Running units of a run folder again: what is honest repeats, and a consistent forgery does not."""

import dataclasses
import json
import shutil
from pathlib import Path

import pytest

from uwbbench.api import Detections
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.scored import score_rows, table_of, with_metrics
from uwbbench.run.folder.verify import verify
from uwbbench.run.rerun import rerun

EXPERIMENT = """\
schema: 1
name: small
detectors: ["null", oracle]
datasets:
  - {use: approach, params: {speed_m_s: 3.0}}
scoring: [frame]
latency: false
stability: false
"""

pytestmark = pytest.mark.slow  # units are run in processes of their own


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rerun")
    (folder / "small.yaml").write_text(EXPERIMENT)
    return run_experiment(read_experiment(folder / "small.yaml"), folder / "run", jobs=1).path


@pytest.fixture
def run(original: Path, tmp_path: Path) -> RunFolder:
    return RunFolder(Path(shutil.copytree(original, tmp_path / "run")))


def forged(folder: RunFolder) -> None:
    """Give the detector that finds nothing the detections of the other, and make all that follows from them."""
    entries = {entry.detector: entry for entry in folder.entries()}
    stored = folder.detections(entries["oracle"].unit)
    found = Detections(**stored.columns, processed=stored.processed)
    folder.write_detections(entries["null"].unit, found, None)
    rules = list(folder.rules)
    rows = score_rows(found, folder.header(entries["null"].capture_id), rules)
    facts = {**entries["null"].facts, "detections": len(found), "processed": len(found.processed)}
    changed = dataclasses.replace(entries["null"], scores=rows, facts=facts)
    lines = [json.dumps(dataclasses.asdict(entry)) + "\n" for entry in (changed, entries["oracle"])]
    (folder.path / "journal.jsonl").write_text("".join(lines))
    shutil.rmtree(folder.path / "curves", ignore_errors=True)
    scored = {entry.unit: entry.scores for entry in folder.entries()}
    metrics = folder.manifest["experiment"]["metrics"]
    folder.write_scores(table_of(folder.entries(), with_metrics(folder, scored, rules, metrics)), rules)
    folder.seal()


def test_an_honest_run_repeats_bit_for_bit(run: RunFolder) -> None:
    found = rerun(run, 10, [Path()])
    assert (len(found.units), found.identical, found.problems) == (2, 2, ())


def test_a_forgery_that_is_consistent_is_found_by_running_it_again(run: RunFolder) -> None:
    forged(run)
    assert verify(RunFolder(run.path)).problems == ()
    found = rerun(RunFolder(run.path), 10, [Path()])
    assert found.identical == 1
    (problem,) = found.problems
    assert problem.startswith("null approach")
    assert "detections, stored are" in problem


def test_another_detector_under_the_same_name_is_said(run: RunFolder) -> None:
    entries = [dataclasses.replace(entry, identity="0" * 64) for entry in run.entries()]
    (run.path / "journal.jsonl").write_text("".join(json.dumps(dataclasses.asdict(e)) + "\n" for e in entries))
    found = rerun(run, 1, [Path()])
    assert found.identical == 0
    assert "its detector is another one here" in found.problems[0]
