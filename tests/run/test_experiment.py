"""The experiment file: what it accepts, and what it says about mistakes."""

import math
from pathlib import Path

import pytest

from uwbbench.api import ConfigError, PluginError, UwbbenchError
from uwbbench.api.locate import shipped
from uwbbench.run.experiment import read_experiment

SMALL = """\
schema: 1
detectors: [paper]
datasets:
  - {use: approach}
"""


def written(folder: Path, text: str, name: str = "mine.yaml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_defaults_are_those_of_the_documentation(tmp_path: Path) -> None:
    found = read_experiment(written(tmp_path, SMALL))
    assert (found.name, found.scoring, found.gate_m) == ("mine", ("frame", "object"), 0.20)
    assert (found.region.min_range_m, found.region.max_range_m, found.region.half_angle_rad) == (0.6, None, None)
    assert found.latency.enabled
    assert [config.name for config in found.detectors] == ["paper"]


def test_a_bare_null_means_the_detector_of_that_name(tmp_path: Path) -> None:
    found = read_experiment(written(tmp_path, SMALL.replace("[paper]", "[null, {use: null, name: again}]")))
    assert [config.name for config in found.detectors] == ["null", "again"]


def test_one_scoring_needs_no_list_and_latency_is_a_switch(tmp_path: Path) -> None:
    found = read_experiment(written(tmp_path, SMALL + "scoring: peak\nlatency: false\n"))
    assert found.scoring == ("peak",)
    assert not found.latency.enabled


def test_a_detector_can_be_renamed_and_changed(tmp_path: Path) -> None:
    use = "[{use: paper, name: wide, set: {pipeline.filter.width.params.minimum: 2.5}}, paper]"
    found = read_experiment(written(tmp_path, SMALL.replace("[paper]", use)))
    widths = {c.name: step.params["minimum"] for c in found.detectors for step in c.steps if step.use == "filter.width"}
    assert widths["wide"] == 2.5
    assert widths["paper"] != 2.5


def test_a_relative_detector_path_starts_from_the_experiment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "elsewhere").mkdir()
    written(tmp_path, "schema: 1\nname: own\npipeline:\n  - {use: reference.nothing}\n", "own.yaml")
    path = written(tmp_path, SMALL.replace("[paper]", "[./own.yaml]"))
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert read_experiment(path).detectors[0].name == "own"


def test_an_extended_experiment_keeps_the_paths_of_its_own_folder(tmp_path: Path) -> None:
    (tmp_path / "base").mkdir()
    written(tmp_path / "base", "schema: 1\nname: own\npipeline:\n  - {use: reference.nothing}\n", "own.yaml")
    written(tmp_path / "base", SMALL.replace("[paper]", "[own.yaml, paper]"), "base.yaml")
    child = written(tmp_path, "extends: base/base.yaml\ngate_m: 0.1\nset: {region.max_range_m: 3.0}\n")
    found = read_experiment(child)
    assert [config.name for config in found.detectors] == ["own", "paper"]
    assert (found.gate_m, found.region.max_range_m, found.name) == (0.1, 3.0, "mine")


def test_experiments_that_extend_each_other_are_refused(tmp_path: Path) -> None:
    written(tmp_path, "extends: b.yaml\n", "a.yaml")
    written(tmp_path, "extends: a.yaml\n", "b.yaml")
    with pytest.raises(ConfigError, match="circle"):
        read_experiment(tmp_path / "a.yaml")


def test_changes_are_checked_like_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, SMALL)
    assert read_experiment(path, {"datasets.approach.params.channel": 5}).datasets[0].params == {"channel": 5}
    with pytest.raises(ConfigError, match="gate_m"):
        read_experiment(path, {"gate_m": -1})


def test_half_angles_are_written_in_degrees(tmp_path: Path) -> None:
    found = read_experiment(written(tmp_path, SMALL + "region: {half_angle_deg: 30}\n"))
    assert found.region.half_angle_rad == pytest.approx(math.pi / 6)


def test_metrics_are_a_list_or_say_exactly_where_each_is_shown(tmp_path: Path) -> None:
    listed = read_experiment(written(tmp_path, SMALL + "metrics: [bias, bias]\n"))
    assert listed.metrics == ("bias",)
    assert listed.to_dict()["metrics"] == ["bias"]
    exact = read_experiment(written(tmp_path, SMALL + "metrics: {rank: mae, charts: [mae, f1]}\n"))
    assert exact.metrics == exact.to_dict()["metrics"] == {"rank": "mae", "charts": ["mae", "f1"]}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("detectors", "detektors"), r"mine\.yaml:2: detektors: unknown key.*Did you mean 'detectors'"),
        (("[paper]", "[papre]"), r"mine\.yaml:2: detectors\[0\]: .*Did you mean 'paper'"),
        (("[paper]", "[paper, paper]"), r"detectors\[1\]: detector 'paper' appears twice"),
        (("[paper]", "[]"), r"mine\.yaml:2: detectors: "),
        (("[paper]", "[{use: paper, set: {pipeline.peeks.params.x: 1}}]"), r"mine\.yaml:2: .*no item 'peeks"),
        (("{use: approach}", "{use: aproach}"), r"mine\.yaml:4: .*Did you mean 'approach'"),
        (("{use: approach}", "{use: approach, params: {chanel: 5}}"), r"mine\.yaml:4: .*Did you mean 'channel'"),
        (("{use: approach}", "{use: approach, params: {channel: 7}}"), r"mine\.yaml:4: datasets\[0\]\.params\.channel"),
        (("{use: approach}", "{use: approach}\n  - {use: approach, name: approach}"), r"mine\.yaml:5: .*appears twice"),
        (("schema: 1", "schema: 2"), r"mine\.yaml:1: schema"),
        (("schema: 1", "schema: 1\nscoring: [frame, objekt]"), r"mine\.yaml:2: scoring\[1\]"),
        (("schema: 1", "schema: 1\nmetrics: [mea]"), r"mine\.yaml:2: .*Did you mean 'mae'"),
        (("schema: 1", "schema: 1\nmetrics: {rank: mea}"), r"mine\.yaml:2: metrics\.rank: .*Did you mean 'mae'"),
        (("schema: 1", "schema: 1\nmetrics: {table: [f1, p59]}"), r"mine\.yaml:2: metrics\.table\[1\]: .*'p95'"),
        (("schema: 1", "schema: 1\nmetrics: {rank: bias}"), r"metrics\.rank: .*'bias' has no better end"),
        (("schema: 1", "schema: 1\nmetrics: {ranks: f1}"), r"mine\.yaml:2: metrics\.ranks: .*Did you mean 'rank'"),
        (("schema: 1", "schema: 1\nmetrics: {charts: []}"), r"mine\.yaml:2: metrics\.charts"),
        (("schema: 1", "schema: 1\nmetrics: f1"), r"mine\.yaml:2: metrics: "),
        (("schema: 1", "schema: 1\ngate_m: .nan"), r"mine\.yaml:2: gate_m"),
        (("schema: 1", "schema: 1\nset: {gate_m: 1}"), r"mine\.yaml:2: .*'extends' is missing"),
        (("schema: 1", "schema: 1\nextends: nowhere"), r"mine\.yaml:2: extends: no experiment named 'nowhere'"),
        (("schema: 1", "schema: 1\nregion: {min_range_m: 3, max_range_m: 2}"), r"mine\.yaml:2: .*must exceed"),
        (("schema: 1", "schema: 1\nlatency: {reference: papre}"), r"mine\.yaml:2: .*Did you mean"),
    ],
)
def test_a_mistake_is_named_with_file_line_and_key(tmp_path: Path, change: tuple[str, str], says: str) -> None:
    path = written(tmp_path, SMALL.replace(*change, 1))
    with pytest.raises((ConfigError, PluginError), match=says) as caught:
        read_experiment(path)
    assert all(line.count("mine.yaml") == 1 for line in str(caught.value).splitlines())


def test_steps_that_do_not_fit_are_found_before_anything_runs(tmp_path: Path) -> None:
    written(tmp_path, "schema: 1\nname: own\npipeline:\n  - {use: filter.width, params: {minimum: 1}}\n", "own.yaml")
    with pytest.raises(ConfigError, match=r"mine\.yaml:2: .*step 'filter.width' needs 'detections'"):
        read_experiment(written(tmp_path, SMALL.replace("[paper]", "[own.yaml]")))


def test_captures_are_chosen_by_pattern_and_repeated_datasets_get_distinct_labels(tmp_path: Path) -> None:
    more = "  - {use: approach, params: {runs: 3}, captures: ['*-[13]']}\n  - {use: approach, name: third}\n"
    found = read_experiment(written(tmp_path, SMALL + more))
    assert [source.label for source in found.datasets] == ["approach", "approach 2", "third"]
    assert [ref.name for ref in found.datasets[1].references()] == ["approach-ch9-metal-1", "approach-ch9-metal-3"]


def test_a_pattern_that_fits_no_capture_is_an_error(tmp_path: Path) -> None:
    found = read_experiment(written(tmp_path, SMALL.replace("{use: approach}", "{use: approach, captures: [x-1]}")))
    with pytest.raises(UwbbenchError, match="has no capture 'x-1'"):
        found.datasets[0].references()


@pytest.mark.parametrize("name", sorted(shipped("experiments")))
def test_every_shipped_experiment_is_valid(name: str) -> None:
    assert read_experiment(name).name == name
