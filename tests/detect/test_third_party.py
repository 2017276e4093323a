"""A third party's package, built and installed as its users would, adds a stage and a detector to the project."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

PLUGIN = Path(__file__).parent / "plugin"


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """Folder with the installed package; nothing is downloaded."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-build-isolation"]
    done = subprocess.run([*command, "--target", folder, PLUGIN], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def run(site: Path, *command: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(site)}
    done = subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, check=False, env=environment, cwd=site
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_its_stage_and_its_detector_are_listed_with_their_package_before_anything_of_it_is_imported(site):
    script = (
        "import json, sys\n"
        "from uwbbench.api import registry\n"
        "found = [registry.entry('stages', 'example.energy'), registry.entry('detectors', 'example-energy')]\n"
        "print(json.dumps([[entry.package for entry in found], 'uwbbench_example' in sys.modules]))\n"
    )
    packages, imported = json.loads(run(site, "-c", script))
    assert packages == ["uwbbench-example 0.1.0", "uwbbench-example 0.1.0"]
    assert not imported


def test_its_detector_is_found_by_name_and_finds_the_plate(site):
    script = (
        "import json\n"
        "import numpy as np\n"
        "import uwbbench\n"
        "from uwbbench.config.source import open_dataset\n"
        "dataset = open_dataset('approach', {}, [])\n"
        "capture = dataset.open(dataset.names()[0])\n"
        "detector = uwbbench.load_detector('example-energy')\n"
        "found = detector.run(capture)\n"
        "truth = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]\n"
        "error = np.abs(found.range_m - truth[found.frame])\n"
        "near = truth[found.frame] < 2\n"
        "print(json.dumps([detector.name, len(found.processed), float(np.median(error[near])), int(near.sum())]))\n"
    )
    name, processed, error_m, near = json.loads(run(site, "-c", script))
    assert name == "example-energy"
    assert processed > 400
    assert near > 100
    assert error_m < 0.2


def test_another_detector_may_use_its_stage_and_typos_in_its_parameters_are_named(site):
    script = (
        "from uwbbench.api import ConfigError\n"
        "from uwbbench.detect.pipeline import detector_from_yaml\n"
        "text = 'schema: 1\\nname: a\\npipeline:\\n  - use: first_path.reported\\n  - use: example.energy\\n'\n"
        "print(detector_from_yaml(text))\n"
        "try:\n"
        "    detector_from_yaml(text + '    params: {gard_taps: 3}\\n')\n"
        "except ConfigError as error:\n"
        "    print(error)\n"
    )
    out = run(site, "-c", script)
    assert "Pipeline(a: first_path.reported -> example.energy)" in out
    assert "detector:6: pipeline[1].params.gard_taps: unknown key 'gard_taps'. Did you mean 'guard_taps'?" in out


@pytest.mark.skipif(importlib.util.find_spec("uwbbench.cli") is None, reason="no command line in this installation")
def test_the_command_line_lists_its_stage_and_its_detector(site):
    call = "import sys; from uwbbench.cli import main; sys.argv = ['uwbbench', 'list', {kind!r}]; main()"
    assert "example.energy" in run(site, "-c", call.format(kind="stages"))
    assert "example-energy" in run(site, "-c", call.format(kind="detectors"))


def test_without_it_the_project_does_not_know_it():
    from uwbbench.api import registry

    assert "example.energy" not in registry.entries("stages")
