"""Worker processes, and everything that can be wrong with them."""

import stat
import sys
from pathlib import Path

import pytest

from uwbbench.config.source import CaptureRef
from uwbbench.tools.gate.config import Side
from uwbbench.tools.gate.link import OWN, SetUpError, Worker, join
from uwbbench.tools.gate.worker import PROTOCOL


def interpreter(path: Path, script: str) -> Path:
    """Something that is started like an interpreter."""
    path.write_text(f"#!{sys.executable}\n{script}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


@pytest.fixture
def side() -> Side:
    return Side("head", "paper-filtering", {}, None)


def test_turns_are_timed_and_the_capture_starts_again(capture_file, side) -> None:
    with Worker(OWN, 60.0) as worker:
        joined = join(worker, "a", side, CaptureRef.of_file(capture_file), 150, 2)
        assert joined["frames"] == 150
        assert joined["source"] == "simulated"
        assert all(worker.ask("turn", player="a", size=64)["spent_s"] > 0 for _ in range(5))
        assert len(worker.ask("respond", player="a", count=400, rate_hz=5000.0, paced=False)["responses_us"]) == 400


def test_a_mistake_is_told_and_the_worker_goes_on(capture_file, side, tmp_path) -> None:
    with Worker(OWN, 60.0) as worker:
        with pytest.raises(SetUpError, match="nowhere"):
            join(worker, "a", side, CaptureRef.of_file(tmp_path / "nowhere.h5"), 100, 2)
        assert join(worker, "a", side, CaptureRef.of_file(capture_file), 100, 2)["frames"] == 100


def test_a_mistake_in_another_environment_names_it(capture_file, tmp_path) -> None:
    said = (f'{{"protocol": {PROTOCOL}}}', '{"error": "no such detector"}')
    python = interpreter(tmp_path / "python", "\n".join(f"print({line!r}, flush=True)\ninput()" for line in said))
    with Worker(python, 60.0) as worker, pytest.raises(SetUpError, match="/python: no such detector"):
        join(worker, "a", Side("head", "nothing", {}, python), CaptureRef.of_file(capture_file), 100, 2)


def test_a_missing_interpreter_is_named(tmp_path) -> None:
    with pytest.raises(SetUpError, match=r"bin/python: no Python interpreter to run: No such file"):
        Worker(tmp_path / "bin/python", 60.0)


def test_an_environment_without_uwbbench_is_told_what_to_install(tmp_path) -> None:
    words = "import sys\nsys.exit('No module named uwbbench.tools.gate')"
    with pytest.raises(SetUpError, match="install a uwbbench with gates there"):
        Worker(interpreter(tmp_path / "python", words), 60.0)


def test_another_protocol_is_refused_with_both_versions(tmp_path) -> None:
    words = 'print(\'{"protocol": 99, "uwbbench": "9.9"}\', flush=True)\ninput()'
    with pytest.raises(SetUpError, match=f"uwbbench 9.9 speaks version 99 .* this one version {PROTOCOL}"):
        Worker(interpreter(tmp_path / "python", words), 60.0)


def test_what_is_no_answer_is_refused(tmp_path) -> None:
    with pytest.raises(SetUpError, match="hello there"):
        Worker(interpreter(tmp_path / "python", "print('hello there', flush=True)\ninput()"), 60.0)


def test_no_answer_in_time_is_an_error(tmp_path) -> None:
    with pytest.raises(SetUpError, match=r"no answer within 0.2 s"):
        Worker(interpreter(tmp_path / "python", "input()"), 0.2)


def test_a_worker_that_dies_says_how_and_its_last_words(tmp_path) -> None:
    words = "import sys, os\nsys.stderr.write('first\\nlast words\\n')\nsys.stderr.flush()\nos.kill(os.getpid(), 9)"
    with pytest.raises(SetUpError, match=r"killed by signal 9\): last words"):
        Worker(interpreter(tmp_path / "python", words), 60.0)


def test_another_environment_does_not_inherit_paths_into_this_one(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    words = "import os, sys\nsys.exit('path ' + os.environ.get('PYTHONPATH', 'unset'))"
    with pytest.raises(SetUpError, match="path unset"):
        Worker(interpreter(tmp_path / "python", words), 60.0)
