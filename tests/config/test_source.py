"""Where data and configs are searched, and references to captures that travel between processes."""

import json
import pickle
from pathlib import Path

import pytest

from uwbbench.api import ConfigError, PluginError
from uwbbench.api.locate import config_folder, find_config
from uwbbench.config.source import CaptureRef, data_roots, open_dataset


def test_data_is_searched_in_the_documented_order(tmp_path, monkeypatch):
    monkeypatch.setenv("UWBBENCH_DATA", str(tmp_path / "env"))
    monkeypatch.setenv("UWBBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    found = data_roots(tmp_path / "option", tmp_path / "configs" / "a.yaml")
    assert found == tuple(tmp_path / name for name in ("option", "env", "configs", "", "cache"))


def test_a_folder_named_twice_is_searched_once(tmp_path, monkeypatch):
    monkeypatch.setenv("UWBBENCH_DATA", str(tmp_path))
    assert data_roots(tmp_path).count(tmp_path) == 1


def test_an_unknown_dataset_and_a_mistyped_parameter_are_named():
    with pytest.raises(PluginError, match=r"no dataset named 'aproach' is installed\. Did you mean 'approach'"):
        open_dataset("aproach", {}, [])
    with pytest.raises(ConfigError, match=r"dataset 'approach'.*unknown key 'spede'"):
        open_dataset("approach", {"spede": 1}, [])


def test_a_reference_survives_another_process_and_opens_the_same_capture():
    ref = CaptureRef("approach", {"start_m": 0.7}, (), "approach-ch9-metal-1")
    assert pickle.loads(pickle.dumps(ref)).open().sha256 == ref.open().sha256  # noqa: S301
    assert json.dumps(ref.params)


def test_a_config_is_found_by_path_beside_the_file_that_names_it(tmp_path):
    (tmp_path / "mine.yaml").write_text("")
    assert find_config("detectors", "mine.yaml", tmp_path) == tmp_path / "mine.yaml"
    assert find_config("detectors", "./mine.yaml", tmp_path) == tmp_path / "mine.yaml"
    assert find_config("detectors", str(tmp_path / "mine.yaml")) == tmp_path / "mine.yaml"


def test_a_path_into_configs_is_found_from_anywhere(tmp_path):
    shipped = next((config_folder() / "detectors").glob("*.yaml"))
    assert find_config("detectors", f"configs/detectors/{shipped.name}", tmp_path) == shipped
    assert find_config("detectors", shipped.stem, tmp_path) == shipped


def test_a_detector_that_two_packages_bring_is_refused(install_plugin):
    shipped = next((config_folder() / "detectors").glob("*.yaml"))
    install_plugin("rival", {"detectors": {shipped.stem: "rival:mine.yaml"}}, {"rival/__init__.py": ""})
    with pytest.raises(PluginError, match=r"several packages \(uwbbench and rival 1\.0\)"):
        find_config("detectors", shipped.stem)


def test_the_config_folder_is_that_of_the_checkout():
    assert config_folder() == Path(__file__).parents[2] / "configs"
