"""Experiments made of others."""

from pathlib import Path

import pytest

from uwbbench.api import ConfigError
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.results import Report
from uwbbench.run import rescore, run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.scored import rules_of

PLATE = "{{use: approach, name: {name}, params: {{speed_m_s: 6.0, runs: 1}}, repeats: []}}"
USUAL = "schema: 1\nlatency: false\nstability: false\n"


def part(folder: Path, name: str, detectors: str, scoring: str, more: str = "") -> None:
    dataset = PLATE.format(name=name)
    text = f"{USUAL}detectors: {detectors}\ndatasets: [{dataset}]\nscoring: {scoring}\n{more}"
    (folder / f"{name}.yaml").write_text(text)


@pytest.fixture
def both(tmp_path: Path) -> Path:
    part(tmp_path, "one", "[constant, 'null']", "[frame]", "region: {min_range_m: 0.8}\n")
    part(tmp_path, "two", "['null']", "[object, frame]", "gate_m: 0.3\n")
    (tmp_path / "both.yaml").write_text(f"{USUAL}experiments: [one.yaml, two.yaml]\n")
    return tmp_path / "both.yaml"


def test_datasets_keep_the_detectors_scorings_and_region_of_their_experiment(both: Path) -> None:
    experiment = read_experiment(both)
    assert [config.name for config in experiment.detectors] == ["constant", "null"]
    assert experiment.scoring == ("frame", "object")
    one, two = experiment.datasets
    assert (one.label, one.detectors, one.scoring) == ("one", ("constant", "null"), ("frame",))
    assert (two.label, two.detectors, two.scoring) == ("two", ("null",), ("object", "frame"))
    assert one.region is not None
    assert one.region.min_range_m == 0.8
    assert two.region is None
    assert (one.gate_m, two.gate_m) == (None, 0.3)
    frame, _ = rules_of(experiment.to_dict())
    assert [frame.of(label).gate_m for label in ("one", "two")] == [0.2, 0.3]
    assert ScoringRules.from_dict(frame.to_dict()) == frame


def test_each_dataset_is_run_and_scored_as_in_its_own_experiment(both: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run_experiment(read_experiment(both), run, jobs=1)
    expected = {
        ("one", "constant", "frame"),
        ("one", "null", "frame"),
        ("two", "null", "object"),
        ("two", "null", "frame"),
    }

    def boards() -> set[tuple[str, str, str]]:
        report = Report(RunFolder(run))
        assert report.unscored == []
        return {(about["dataset"], about["detector"], about["scoring"]) for about, _ in report.estimates}

    assert boards() == expected
    rescore(RunFolder(run))
    assert boards() == expected


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("experiments: []", "expected a list of names"),
        ("experiments: [one.yaml, thre.yaml]", "both.yaml"),
        ("experiments: [one.yaml]\ndetectors: ['null']", "'detectors' comes from the experiments"),
        ("experiments: [one.yaml]\nstrongest: 2", "'one.yaml' has strongest None, but 2 is to hold for all"),
        ("experiments: [both.yaml]", "itself made of experiments"),
    ],
)
def test_what_cannot_be_combined_is_one_message_with_its_place(both: Path, change: str, message: str) -> None:
    both.write_text(f"{USUAL}{change}\n")
    with pytest.raises(ConfigError, match=message) as caught:
        read_experiment(both)
    assert "both.yaml" in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"datasets.0.scoring": ["peak"]}, "'peak' is not among the experiment's scoring"),
        ({"datasets.0.detectors": ["constnt"]}, "'constnt' is not among the experiment's detectors. Did you mean"),
    ],
)
def test_a_dataset_chooses_among_what_the_experiment_has(
    both: Path, change: dict[str, list[str]], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        read_experiment(both.parent / "one.yaml", change)
