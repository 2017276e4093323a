"""``uwbbench fit-scene`` as a user calls it."""

import json

import pytest
import yaml

from tests.tools.fit.conftest import FIT, SCENE


@pytest.fixture
def file(tmp_path):
    """A fit that reaches its target."""
    (tmp_path / "plate.yaml").write_text(SCENE)
    path = tmp_path / "own.yaml"
    path.write_text(yaml.safe_dump(FIT, sort_keys=False))
    return path


def test_a_fit_shows_every_residual_and_ends_with_0(uwbbench, file, tmp_path):
    result = uwbbench("fit-scene", file, "-o", "fitted")
    assert result.exit_code == 0
    assert "SIMULATED, 2 draws that the fit did not see" in result.stdout
    assert "not a validation of them" in result.stdout
    assert "reached" in result.stdout
    assert (tmp_path / "fitted" / "plate.yaml").is_file()
    assert "best cost" in result.stderr
    assert uwbbench("validate", file).stdout.endswith("fit 'own', 1 parameters, 1 targets, fine\n")


def test_a_target_out_of_reach_ends_with_1_and_says_how_far(uwbbench, file):
    result = uwbbench(
        "fit-scene", file, "-o", "fitted", "--set", "targets.near.filtering.mae=9", "--json", "-q", code=1
    )
    printed = json.loads(result.stdout)
    assert printed["passed"] is False
    assert printed["missed"] == ["near, filtering, mae"]
    assert result.stderr.startswith("out of reach: near, filtering, mae")


def test_a_wrong_fit_ends_with_2(uwbbench, file):
    result = uwbbench("fit-scene", file, "-o", "fitted", "--set", "checking.seeds=[1]", code=2)
    assert "seed 1 is both for fitting and for checking" in result.stderr


def test_a_folder_that_holds_something_is_refused_before_anything_is_tried(uwbbench, file, tmp_path):
    (tmp_path / "fitted").mkdir()
    (tmp_path / "fitted" / "mine.txt").touch()
    result = uwbbench("fit-scene", file, "-o", "fitted", code=2)
    assert "already exists and is not empty" in result.stderr
    assert "trial" not in result.stderr


def test_the_schema_of_fits_is_printed(uwbbench):
    assert "targets" in json.loads(uwbbench("schema", "fit").stdout)["properties"]
