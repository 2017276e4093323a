"""Starting up, and what every command has in common."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import uwbbench as package
from uwbbench.cli import app

COMMANDS = [command.name or command.callback.__name__ for command in app.registered_commands]
NUMERICAL = {"numpy", "scipy", "pandas", "sklearn", "h5py", "pyarrow", "uwbbench_detectors", "uwbbench_datasets"}


@pytest.mark.parametrize("words", [["--help"], ["list"], ["list", "stages", "--json"], ["version"], ["--version"]])
def test_light_commands_import_no_numerical_library_and_no_plugin(words: list[str], tmp_path: Path) -> None:
    script = (
        "import sys\nfrom uwbbench.cli import app\n"
        f"try:\n    app({words!r})\nexcept SystemExit:\n    pass\n"
        f"print(*({NUMERICAL!r} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr.split() == []


def test_the_help_does_not_import_pydantic(tmp_path: Path) -> None:
    command = [sys.executable, "-X", "importtime", "-m", "uwbbench.cli", "--help"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "uwbbench.registry" in done.stderr
    assert "pydantic" not in done.stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(uwbbench, command) -> None:
    assert f"uwbbench {command} " in uwbbench(command, "--help").stdout.split("Example")[1]


def test_the_help_lists_every_command_with_a_whole_sentence(uwbbench) -> None:
    text = uwbbench("--help").stdout
    for command in COMMANDS:
        assert f"\n  {command} " in text
    assert "..." not in text.split("Commands:")[1]


def test_no_command_is_a_usage_error_that_shows_the_commands(shell) -> None:
    done = shell()
    assert done.returncode == 2
    assert "Commands:" in done.stdout + done.stderr


def test_unknown_command_is_a_usage_error(uwbbench) -> None:
    assert "scroe" in uwbbench("scroe", code=2).stderr


def test_unknown_option_is_a_usage_error(uwbbench) -> None:
    assert "--jsn" in uwbbench("version", "--jsn", code=2).stderr


def test_version_is_the_packages(uwbbench) -> None:
    assert json.loads(uwbbench("version", "--json").stdout)["uwbbench"] == package.__version__
    assert uwbbench("--version").stdout == f"uwbbench {package.__version__}\n"


def test_a_mistake_in_a_real_process_is_one_message_without_traceback(shell) -> None:
    done = shell("info", "nowhere.h5")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: nowhere.h5: no such capture file\n"


def test_an_unexpected_exception_keeps_its_traceback(shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "yaml.py").write_text("raise ZeroDivisionError('a broken library')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "some.yaml").write_text("schema: 1")
    done = shell("validate", "some.yaml")
    assert done.returncode == 1
    assert "Traceback" in done.stderr
    assert "a broken library" in done.stderr


def test_a_reader_that_leaves_early_is_no_error(tmp_path: Path) -> None:
    listing = subprocess.Popen(
        [sys.executable, "-m", "uwbbench.cli", "list", "--json"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    listing.stdout.close()
    assert listing.stderr.read() == b""
    assert listing.wait() == 0
    listing.stderr.close()


def test_interrupting_gives_130_and_a_short_message(tmp_path: Path) -> None:
    fifo = tmp_path / "slow.yaml"
    os.mkfifo(fifo)  # reading it waits for ever, so that the interrupt finds the command at work
    waiting = subprocess.Popen(
        [sys.executable, "-m", "uwbbench.cli", "validate", str(fifo)],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    writer = os.open(fifo, os.O_WRONLY)  # returns once the command has opened the other end
    time.sleep(0.2)
    waiting.send_signal(signal.SIGINT)
    try:
        _, message = waiting.communicate(timeout=30)
    finally:
        os.close(writer)
    assert (waiting.returncode, message) == (130, "interrupted\n")
