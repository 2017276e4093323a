"""The fixture that times a detector with pytest-benchmark."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import uwbbench

TESTS = """\
import pytest
from uwbbench.config.source import open_dataset

@pytest.fixture(scope="module")
def capture():
    dataset = open_dataset("approach", {"speed_m_s": 3.0}, [])
    return dataset.open(dataset.names()[0])

def test_stream(detector_benchmark, capture):
    detector_benchmark("paper-filtering", capture, rounds=60)

def test_batch(detector_benchmark, capture):
    detector_benchmark("paper-filtering", capture, batch=True, rounds=3)

def test_mistake(detector_benchmark, capture):
    with pytest.raises(Exception, match="Did you mean 'paper'?"):
        detector_benchmark("papre", capture)
"""


def run_pytest(folder: Path, *words: str) -> str:
    (folder / "test_speed.py").write_text(TESTS)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-rs", *words]
    alone = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_XDIST")}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=alone)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_results_go_into_pytest_benchmarks_json_with_detector_and_capture(tmp_path) -> None:
    run_pytest(tmp_path, "--benchmark-json=out.json")
    found = {one["name"]: one for one in json.loads((tmp_path / "out.json").read_text())["benchmarks"]}
    assert {name: one["stats"]["rounds"] for name, one in found.items()} == {"test_stream": 60, "test_batch": 3}
    about = found["test_batch"]["extra_info"]
    assert (about["detector"], about["mode"], about["frames"]) == ("paper-filtering", "batch", 45)
    assert about["detector_identity"] == uwbbench.load_detector("paper-filtering").identity
    assert len(about["capture_sha256"]) == 64
    assert about["machine"]["cores"] >= 1


@pytest.mark.slow
def test_without_pytest_benchmark_it_skips_and_says_why(tmp_path) -> None:
    out = run_pytest(tmp_path, "-p", "no:benchmark")
    assert "3 skipped" in out
    assert "needs pytest-benchmark: pip install pytest-benchmark" in out


@pytest.mark.parametrize("module", ["numpy", "pydantic", "uwbbench.detect.pipeline", "uwbbench.api.capture"])
def test_a_session_that_does_not_use_it_imports_nothing_heavy(tmp_path, module) -> None:
    script = f"import uwbbench.tools.pytest_plugin, sys\nprint({module!r} in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
