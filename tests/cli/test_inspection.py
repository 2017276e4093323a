"""``list``, ``show``, ``info``, ``validate`` and ``schema``."""

import json
from importlib.metadata import entry_points
from pathlib import Path

import h5py
import pytest

from uwbbench.api.locate import shipped
from uwbbench.detect.pipeline import load_detector

# list


@pytest.mark.parametrize("kind", ["stages", "datasets", "metrics", "terms"])
def test_list_names_every_registered_plugin(uwbbench, kind) -> None:
    registered = sorted(point.name for point in entry_points(group=f"uwbbench.{kind}"))
    found = json.loads(uwbbench("list", kind, "--json").stdout)
    assert [row["name"] for row in found[kind]] == registered
    table = uwbbench("list", kind).stdout
    assert all(name in table for name in registered)


def test_list_names_every_shipped_detector(uwbbench) -> None:
    rows = json.loads(uwbbench("list", "detectors", "--json").stdout)["detectors"]
    assert {"paper", "null", "constant", "oracle"} <= set(shipped("detectors")) <= {row["name"] for row in rows}


def test_list_without_kind_has_all_kinds(uwbbench) -> None:
    assert list(json.loads(uwbbench("list", "--json").stdout)) == [
        "stages",
        "mappers",
        "detectors",
        "datasets",
        "metrics",
        "terms",
    ]


def test_list_of_an_unknown_kind_names_the_kinds(uwbbench) -> None:
    assert "detectors" in uwbbench("list", "stges", code=2).stderr


def test_tables_in_a_pipe_are_not_cut_off(uwbbench) -> None:
    assert "uwbbench_detectors.first_path.estimators:LeadingEdgeFirstPath" in uwbbench("list", "stages").stdout


# show


def test_show_a_stage_gives_parameters_ports_and_fidelity(uwbbench) -> None:
    text = uwbbench("show", "filter.prominence").stdout
    assert "prominence" in text.split("consumes:")[1]
    assert "from-source" in text
    facts = json.loads(uwbbench("show", "peaks", "--json").stdout)["stage"]
    height = next(row for row in facts["params"] if row["name"] == "relative_height")
    assert (height["type"], height["default"]) == ("number > 0, <= 1", "0.5")
    assert height["description"]


@pytest.mark.parametrize("kind", ["stages", "datasets", "metrics", "terms", "detectors"])
def test_everything_listed_can_be_shown(uwbbench, kind) -> None:
    for row in json.loads(uwbbench("list", kind, "--json").stdout)[kind]:
        assert kind[:-1] in json.loads(uwbbench("show", row["name"], "--json").stdout)
        shown = uwbbench("show", row["name"]).stdout
        assert shown
        assert "`" not in shown, "markup of a docstring"


def test_show_a_dataset_gives_its_card(uwbbench) -> None:
    text = uwbbench("show", "pulson440-rail").stdout
    assert "MIT" in text
    assert "scan_2105627.txt" in text


@pytest.mark.parametrize("name", ["paper", "paper-filtering", "constant", "null"])
def test_what_show_prints_of_a_detector_is_that_detector(uwbbench, tmp_path: Path, name: str) -> None:
    (tmp_path / "copy.yaml").write_text(uwbbench("show", name).stdout)
    assert load_detector(tmp_path / "copy.yaml").identity == load_detector(name).identity


def test_show_a_detector_file(uwbbench, detector: Path) -> None:
    assert "strongest echo behind the ringing" in uwbbench("show", "./simple.yaml").stdout


def test_show_an_unknown_name_suggests_the_nearest(uwbbench) -> None:
    assert "Did you mean 'filter.prominence'?" in uwbbench("show", "filter.promience", code=2).stderr


# info


def test_info_tells_what_is_in_a_capture(uwbbench, capture: Path) -> None:
    found = json.loads(uwbbench("info", capture, "--json").stdout)
    (receiver,) = found["receivers"]
    assert (found["source"], found["license"], found["radar"]["channel"]) == ("simulated", "BSD-3-Clause", 9)
    assert (receiver["receiver"], receiver["frames"], receiver["invalid_frames"]) == ("front", 39, 0)
    assert receiver["duration_s"] == pytest.approx(39 / 48)
    assert found["truth"] == {
        "exhaustive": True,
        "objects": [{"name": "plate", "material": "metal", "structure": False, "moves": False}],
    }


def test_info_labels_simulated_captures(uwbbench, capture: Path) -> None:
    assert "SIMULATED" in uwbbench("info", capture).stdout


def test_info_counts_invalid_frames(uwbbench, capture_with_nan: Path) -> None:
    assert json.loads(uwbbench("info", capture_with_nan, "--json").stdout)["receivers"][0]["invalid_frames"] == 2


def test_info_shows_every_receiver(uwbbench, two_receivers: Path) -> None:
    found = json.loads(uwbbench("info", two_receivers, "--json").stdout)
    assert [receiver["receiver"] for receiver in found["receivers"]] == ["front", "rear"]
    assert "rear" in uwbbench("info", two_receivers).stdout


def test_info_of_a_capture_without_truth_says_so(uwbbench, capture_without_truth: Path) -> None:
    assert json.loads(uwbbench("info", capture_without_truth, "--json").stdout)["truth"] is None
    assert "no ground truth" in uwbbench("info", capture_without_truth).stdout


def test_info_of_an_empty_capture(uwbbench, empty_capture: Path) -> None:
    receiver = json.loads(uwbbench("info", empty_capture, "--json").stdout)["receivers"][0]
    assert (receiver["frames"], receiver["duration_s"]) == (0, 0.0)


def test_brackets_in_names_are_not_taken_for_markup(uwbbench, capture: Path) -> None:
    with h5py.File(capture, "r+") as file:
        file.move("truth/objects/plate", "truth/objects/[red]plate")
    assert "[red]plate" in uwbbench("info", capture).stdout


def test_info_of_what_is_no_capture_names_the_file(uwbbench, tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("no HDF5")
    h5py.File(tmp_path / "other.h5", "w").close()
    for name in ("text.h5", "other.h5", "missing.h5", "."):
        assert uwbbench("info", name, code=2).stderr.startswith(f"error: {name}: ")


def test_a_truncated_capture_is_one_message(uwbbench, capture: Path) -> None:
    whole = capture.read_bytes()
    for share in (0.1, 0.5, 0.95):
        capture.write_bytes(whole[: int(len(whole) * share)])
        assert "run.h5" in uwbbench("info", capture, code=2).stderr


# validate


def test_valid_files_pass(uwbbench, detector: Path, tmp_path: Path) -> None:
    (tmp_path / "experiment.yaml").write_text(
        "schema: 1\ndetectors: [./simple.yaml, null]\ndatasets: [{use: approach}]\nscoring: frame\n"
    )
    text = uwbbench("validate", "simple.yaml", "experiment.yaml").stdout
    assert "simple.yaml: detector 'simple', 6 steps" in text
    assert "experiment.yaml: experiment 'experiment', 2 detectors" in text


def test_every_shipped_file_is_valid(uwbbench) -> None:
    uwbbench("validate", *shipped("detectors").values(), *shipped("experiments").values())


@pytest.mark.parametrize(
    ("step", "place", "says"),
    [
        ("{use: peaks, params: {relative_heigth: 1}}", "pipeline[1].params.relative_heigth", "'relative_height'?"),
        ("{use: peaks, params: {relative_height: 2}}", "pipeline[1].params.relative_height", "found 2"),
        ("{use: peaks, parms: {}}", "pipeline[1].parms", "Did you mean 'params'?"),
        ("{use: peeks}", "pipeline[1].use", "Did you mean 'peaks'?"),
    ],
)
def test_a_typo_is_named_with_file_line_and_nearest_key(uwbbench, tmp_path, step, place, says) -> None:
    (tmp_path / "typo.yaml").write_text(
        f"schema: 1\nname: typo\npipeline:\n  - {{use: profile.amplitude}}\n  - {step}\n"
    )
    stderr = uwbbench("validate", "typo.yaml", code=2).stderr
    assert f"typo.yaml:5: {place}" in stderr
    assert says in stderr


def test_a_stage_in_the_wrong_place_is_named(uwbbench, tmp_path: Path) -> None:
    (tmp_path / "order.yaml").write_text(
        "schema: 1\nname: order\npipeline: [{use: select.strongest}, {use: profile.amplitude}, {use: peaks}]\n"
    )
    stderr = uwbbench("validate", "order.yaml", code=2).stderr
    assert "order.yaml" in stderr
    assert "select.strongest" in stderr


def test_a_wrong_experiment_is_named_with_its_line(uwbbench, tmp_path: Path) -> None:
    (tmp_path / "e.yaml").write_text("schema: 1\ndetectors: [paper]\ndatasets: [{use: approach}]\ngate: 0.2\n")
    stderr = uwbbench("validate", "e.yaml", code=2).stderr
    assert "e.yaml:4: gate" in stderr
    assert "gate_m" in stderr


def test_one_wrong_file_does_not_hide_another(uwbbench, detector: Path, tmp_path: Path) -> None:
    for name in ("a.yaml", "b.yaml"):
        (tmp_path / name).write_text("schema: 1\npipline: []\n")
    result = uwbbench("validate", "a.yaml", "simple.yaml", "b.yaml", code=2)
    assert "a.yaml" in result.stderr
    assert "b.yaml" in result.stderr
    assert "Did you mean 'pipeline'?" in result.stderr
    assert "simple.yaml" in result.stdout


def test_validating_a_missing_file_names_it(uwbbench) -> None:
    assert "gone.yaml" in uwbbench("validate", "gone.yaml", code=2).stderr


# schema


def test_schema_is_json_and_can_be_written_to_a_new_folder(uwbbench, tmp_path: Path) -> None:
    printed = json.loads(uwbbench("schema", "detector").stdout)
    uwbbench("schema", "-o", "new/folder/detector.json")
    assert json.loads((tmp_path / "new/folder/detector.json").read_text()) == printed
    assert json.loads(uwbbench("schema", "experiment").stdout)["properties"]["datasets"]


def test_schema_refuses_an_unknown_suffix(uwbbench) -> None:
    assert ".json" in uwbbench("schema", "-o", "schema.txt", code=2).stderr
