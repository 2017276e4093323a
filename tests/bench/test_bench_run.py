"""The benchmark as it is called."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent / "run.py"


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, str(SCRIPT), *arguments], capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_part_prints_its_targets_as_json():
    answer = run("file", "--quick", "--json")
    assert answer.returncode == 0, answer.stderr
    told = json.loads(answer.stdout)
    assert told["machine"]["usable_cores"] > 0
    bounded = told["rows"][0]
    assert "frames of a file" in bounded["target"]
    assert bounded["required"] == "<= 64"
    assert bounded["met"] is (bounded["value"] <= 64)


def test_an_unknown_part_is_a_mistake_that_names_the_known_ones():
    answer = run("sreaming")
    assert answer.returncode == 2
    assert "stream" in answer.stderr
    assert "Traceback" not in answer.stderr
