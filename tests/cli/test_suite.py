"""``freeze`` and ``seeds``, and ``run`` of a suite: quickly, privately, and with a detector of one's own."""

import json
import stat
from pathlib import Path

import pytest

SUITE = """\
schema: 1
detectors: [oracle]
datasets:
  - {use: capture, name: file, params: {files: ["*.h5"]}}
  - {use: limits, name: drawn, params: {scene: echo, snr_db: 20, frames: 9, runs: 3}}
scoring: object
latency: false
stability: false
quick: {captures: 1}
"""


@pytest.fixture
def suite(uwbbench, tmp_path: Path, capture: Path) -> Path:
    path = tmp_path / "tiny.yaml"
    path.write_text(SUITE)
    assert "tiny is frozen as version" in uwbbench("freeze", path).stdout
    return path


def test_freezing_again_says_what_has_changed(uwbbench, suite: Path) -> None:
    assert "tiny is still version" in uwbbench("freeze", suite).stdout
    suite.write_text(SUITE.replace("snr_db: 20", "snr_db: 21"))
    assert "3 of 4 captures are new or changed" in uwbbench("freeze", suite).stdout


def test_a_changed_capture_is_a_usage_error_that_names_it(uwbbench, suite: Path, tmp_path: Path) -> None:
    suite.write_text(SUITE.replace("frames: 9", "frames: 8"))
    result = uwbbench("run", suite, "--out", tmp_path / "run", "--jobs", 1, code=2)
    assert "capture 'echo-20db/1' of dataset 'drawn' was changed" in result.stderr
    assert "'uwbbench freeze' makes it another version" in result.stderr


def test_seeds_are_drawn_once_and_give_a_private_half_without_files(uwbbench, suite: Path, tmp_path: Path) -> None:
    path = tmp_path / "secret"
    uwbbench("seeds", path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert "already exists" in uwbbench("seeds", path, code=2).stderr
    run = uwbbench("run", suite, "--quick", "--seeds", path, "--out", tmp_path / "run", "--jobs", 1)
    assert "left out: file, which cannot be drawn from seeds" in run.stderr
    part = json.loads((tmp_path / "run/manifest.json").read_text())["experiment"]["suite"]
    assert part["quick"]
    assert len(part["seeds"]) == 64
    path.chmod(0o644)
    refused = uwbbench("run", suite, "--seeds", path, "--out", tmp_path / "other", code=2)
    assert "others may read this seed file (mode 0644)" in refused.stderr


@pytest.mark.slow
def test_a_detector_of_ones_own_takes_the_place_of_the_suites(
    uwbbench, suite: Path, detector: Path, tmp_path: Path
) -> None:
    uwbbench("run", suite, "--quick", "-d", detector, "-d", "oracle", "--out", tmp_path / "run", "--jobs", 1)
    manifest = json.loads((tmp_path / "run/manifest.json").read_text())
    assert len(manifest["detectors"]) == 2
    assert manifest["experiment"]["suite"]["version"]
