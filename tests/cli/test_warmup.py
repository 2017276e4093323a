"""``uwbbench warmup``."""

import json
from pathlib import Path

import pytest

BROKEN = """\
from uwbbench.api import Stage, ports


class Broken(Stage):
    produces = ports("detections")

    def step(self, block):
        raise ZeroDivisionError("far away")
"""
YAML = "schema: 1\nname: broken\npipeline:\n  - {use: broken}\n"


@pytest.mark.slow
def test_a_second_process_loads_what_the_first_compiled(shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "kernels.py").write_text(
        "from uwbbench.api.compiling import compiled\n\n\n@compiled\ndef first(samples):\n    return samples[0, 0]\n"
    )
    (tmp_path / "stages.py").write_text(
        "from uwbbench.api import Stage, ports\n\n\nclass First(Stage):\n    produces = ports('detections')\n\n"
        "    def step(self, block):\n        import kernels\n\n        kernels.first(block.frames.preamble)\n"
        "        return block\n"
    )
    facts = tmp_path / "first-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: first\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text("[uwbbench.stages]\nfirst = stages:First\n")
    (tmp_path / "first.yaml").write_text("schema: 1\nname: first\npipeline:\n  - {use: first}\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("UWBBENCH_CACHE_DIR", str(tmp_path / "kept"))
    told = [shell("warmup", "-d", "first.yaml", "--json") for _ in range(2)]
    cold, warm = (json.loads(done.stdout) for done in told)
    for found in (cold, warm):
        assert found["failed"] == 0
        assert [one["detector"] for one in found["detectors"]] == ["first.yaml"]
    assert (cold["detectors"][0]["compiled"], cold["detectors"][0]["loaded"]) == (2, 0)
    assert (warm["detectors"][0]["compiled"], warm["detectors"][0]["loaded"]) == (0, 2)
    assert len(list((tmp_path / "kept").iterdir())) == 2
    assert "[1/1] first.yaml: " in told[0].stderr


def test_people_see_a_line_for_each_detector_and_the_sum(uwbbench) -> None:
    lines = uwbbench("warmup", "-d", "null", "-d", "constant", "-d", "null").stdout.splitlines()
    assert [line.split(":")[0] for line in lines[:2]] == ["[1/2] null", "[2/2] constant"]
    assert lines[0].endswith("nothing more to compile")
    assert lines[2].startswith("2 detectors in ")


def test_a_detector_that_fails_is_exit_code_3_and_does_not_stop_the_others(
    uwbbench, install_plugin, tmp_path: Path
) -> None:
    install_plugin("broken", {"stages": {"broken": "broken_stages:Broken"}}, {"broken_stages.py": BROKEN})
    (tmp_path / "broken.yaml").write_text(YAML)
    words = ("warmup", "-d", "broken.yaml", "-d", "null")
    result = uwbbench(*words, code=3)
    assert "[1/2] broken.yaml: failed: ZeroDivisionError: far away" in result.stderr
    assert "[2/2] null: " in result.stdout
    found = json.loads(uwbbench(*words, "--json", code=3).stdout)
    assert found["failed"] == 1
    assert [one["failure"] for one in found["detectors"]] == ["ZeroDivisionError: far away", None]


def test_an_unknown_detector_is_a_mistake_that_ends_the_command_before_anything_runs(uwbbench) -> None:
    result = uwbbench("warmup", "-d", "null", "-d", "papre", code=2)
    assert "Did you mean 'paper'?" in result.stderr
    assert result.stdout == ""
