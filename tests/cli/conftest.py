"""What the tests of the command line share: a way to call it, and small capture and detector files."""

import contextlib
import dataclasses
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import pytest
import typer.main
from click.testing import CliRunner, Result

from tests.fixtures.chance import seed
from tests.fixtures.shared import Once
from uwbbench.api import Capture, Trajectory, write_capture
from uwbbench.api.registry import load_plugin
from uwbbench.cli import app

SIMPLE_DETECTOR = """\
schema: 1
name: simple
description: strongest echo behind the ringing
pipeline:
  - {use: first_path.crest}
  - {use: profile.amplitude}
  - {use: peaks}
  - {use: filter.first_path, params: {guard_taps: 6}}
  - {use: select.strongest}
  - {use: range}
"""

Call = Callable[..., Result]


@pytest.fixture(scope="session")
def program() -> click.Command:
    """The command line, put together once."""
    return typer.main.get_command(app)


@pytest.fixture
def uwbbench(program: click.Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Call:
    """Call the command line inside an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("UWBBENCH_DATA", raising=False)

    def call(*words: object, code: int = 0) -> click.testing.Result:
        result = CliRunner().invoke(program, [str(word) for word in words], prog_name="uwbbench")
        crashed = result.exception is not None and not isinstance(result.exception, SystemExit)
        assert not crashed, f"traceback: {result.exception!r}"
        assert result.exit_code == code, f"exit code {result.exit_code}: {result.output}"
        return result

    return call


@pytest.fixture
def shell(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Call the command line in a process of its own, as a shell does."""

    def call(*words: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "uwbbench.cli", *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    return call


def small_approach(**changes: object) -> Capture:
    """Forty frames of the simulated approach, in memory."""
    adapter = load_plugin("datasets", "approach")
    params = adapter.params_type().model_validate(
        {"start_m": 2.0, "stop_m": 1.2, "speed_m_s": 1.0, "seed": seed(), **changes}
    )
    dataset = adapter(params, ())
    return dataset.open(dataset.names()[0])


@pytest.fixture(scope="session")
def small_capture(once: Once) -> Path:
    """A capture file with truth, to be copied."""
    return once("cli-capture", lambda folder: write_capture(folder / "run.h5", small_approach())) / "run.h5"


@pytest.fixture(scope="session")
def ran(once: Once, program: click.Command, small_capture: Path) -> Callable[..., Path]:
    """Run an experiment on the small capture: ``ran(name, experiment)`` is the folder of its files and the run."""

    def run(name: str, experiment: str, detector: str = SIMPLE_DETECTOR) -> Path:
        def make(folder: Path) -> None:
            shutil.copy(small_capture, folder / "run.h5")
            (folder / "simple.yaml").write_text(detector)
            (folder / "small.yaml").write_text(experiment)
            with contextlib.chdir(folder):
                words = ["run", "small.yaml", "--jobs", "1", "--out", name, "--quiet"]
                result = CliRunner().invoke(program, words, prog_name="uwbbench")
            assert result.exit_code == 0, result.output

        return once(f"cli-{name}", make)

    return run


@pytest.fixture
def detector(tmp_path: Path) -> Path:
    """A small detector file."""
    path = tmp_path / "simple.yaml"
    path.write_text(SIMPLE_DETECTOR)
    return path


@pytest.fixture
def capture(small_capture: Path, tmp_path: Path) -> Path:
    """A capture file with truth."""
    return Path(shutil.copy(small_capture, tmp_path / "run.h5"))


@pytest.fixture
def capture_without_truth(tmp_path: Path) -> Path:
    write_capture(tmp_path / "blind.h5", dataclasses.replace(small_approach(), truth=None))
    return tmp_path / "blind.h5"


@pytest.fixture
def capture_with_nan(tmp_path: Path) -> Path:
    """Frames 3 and 7 hold a NaN and an infinity."""
    good = small_approach(sts=False)
    samples = np.array(good.preamble)
    samples[3, 5], samples[7, 9] = np.nan, np.inf
    write_capture(tmp_path / "nan.h5", dataclasses.replace(good, preamble=samples))
    return tmp_path / "nan.h5"


@pytest.fixture
def empty_capture(tmp_path: Path) -> Path:
    """A capture of no frames."""
    good = small_approach(sts=False)
    nothing = Trajectory(np.zeros(0), np.zeros((0, 3)), np.zeros(0))
    parts = {name: getattr(good, name)[:0] for name in ("preamble", "first_path_index")}
    write_capture(tmp_path / "empty.h5", dataclasses.replace(good, trajectory=nothing, **parts))
    return tmp_path / "empty.h5"


@pytest.fixture
def two_receivers(tmp_path: Path) -> Path:
    """A capture file with the receivers front and rear."""
    front = small_approach(sts=False)
    rear = dataclasses.replace(front, radar=dataclasses.replace(front.radar, receiver="rear"))
    write_capture(tmp_path / "two.h5", front, rear)
    return tmp_path / "two.h5"
