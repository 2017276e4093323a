"""Score regions of single datasets of an experiment: stored, verified, scored again with, absent where not given."""

from dataclasses import replace
from pathlib import Path

import pytest

from uwbbench.api import ConfigError
from uwbbench.measure.accuracy.region import Region
from uwbbench.measure.accuracy.scoring import ScoringRules
from uwbbench.results import Report
from uwbbench.results.comparison.compare import compare
from uwbbench.run import rescore, run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.verify import verify
from uwbbench.show.text.report import markdown
from uwbbench.tools.schema import experiment_schema

FAR = {"min_range_m": 1.5, "max_range_m": 2.5}
APPROACH = {"use": "approach", "params": {"speed_m_s": 2.0}}


def experiment(**of_far: object) -> dict[str, object]:
    """One capture twice: in the region of the experiment, and in one of its own."""
    datasets = [{**APPROACH, "name": "everywhere"}, {**APPROACH, "name": "far", **of_far}]
    return {"detectors": ["paper"], "datasets": datasets, "scoring": "frame", "latency": False, "stability": False}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """Run whose second dataset is scored from 1.5 to 2.5 m."""
    return run_experiment(read_experiment(experiment(region=FAR)), tmp_path_factory.mktemp("regions") / "run", jobs=1)


def scored_ranges(folder: RunFolder) -> dict[str, tuple[float, float]]:
    """Smallest and largest range of what was to be found, by dataset."""
    by = {one.dataset: one.range_m[one.range_m > 0] for one in Report(folder).scored}
    return {label: (float(range_m.min()), float(range_m.max())) for label, range_m in by.items()}


def test_captures_of_a_dataset_are_scored_in_its_own_region(folder):
    ranges = scored_ranges(folder)
    assert 1.5 <= ranges["far"][0] < 1.6
    assert 2.4 < ranges["far"][1] <= 2.5
    assert ranges["everywhere"][0] < 1.5
    assert "Scored from 1.5 m to 2.5 m." in markdown(Report(folder))


def test_a_run_with_regions_verifies_and_resumes_without_repeating_anything(folder):
    assert verify(folder).passed, verify(folder).problems
    before = folder.scores()
    resumed = run_experiment(read_experiment(experiment(region=FAR)), folder.path, jobs=1, resume=True)
    assert len(resumed.manifest["sessions"]) == 2
    assert resumed.scores().equals(before)


def test_scoring_again_keeps_the_regions(folder, tmp_path):
    made = run_experiment(read_experiment(experiment(region=FAR)), tmp_path / "run", jobs=1)
    rescore(made, [replace(rule, gate_m=0.1) for rule in made.rules])
    assert {rule.gate_m for rule in made.rules} == {0.1}
    assert scored_ranges(made) == scored_ranges(folder)
    assert verify(made).passed


def test_two_runs_are_compared_in_the_regions_of_the_first(folder, tmp_path):
    other = run_experiment(read_experiment(experiment()), tmp_path / "run", jobs=1)
    comparison = compare(folder, other)
    changed = {(one.board[0], one.metric): one.difference.value for one in comparison.scores}
    assert changed["far", "f1"] == 0
    assert any("different rules" in note for note in comparison.notes)


def test_runs_without_regions_say_nothing_of_them(tmp_path):
    made = run_experiment(read_experiment(experiment()), tmp_path / "run", jobs=1)
    assert all("region" not in used for used in made.manifest["experiment"]["datasets"])
    assert all("regions" not in rule.to_dict() for rule in made.rules)


def test_rules_become_plain_values_and_rules_again():
    rules = ScoringRules("peak", 0.1, Region(0.7), regions=(("far", Region(1.0, 2.5)),))
    assert ScoringRules.from_dict(rules.to_dict()) == rules
    assert rules.of("far") == ScoringRules("peak", 0.1, Region(1.0, 2.5))
    assert rules.of("near") == ScoringRules("peak", 0.1, Region(0.7))


def test_an_empty_region_is_refused_by_its_line(tmp_path: Path):
    path = tmp_path / "own.yaml"
    path.write_text(
        "schema: 1\ndetectors: [paper]\ndatasets:\n  - {use: approach, region: {min_range_m: 2, max_range_m: 1}}\n"
    )
    with pytest.raises(ConfigError, match=r"own\.yaml:4: datasets\[0\]\.region\.max_range_m: .*must exceed"):
        read_experiment(path)


def test_editors_know_the_region_of_a_dataset():
    assert "region" in experiment_schema()["$defs"]["ScoredDataset"]["properties"]
