"""Starting up, and what every command has in common."""

import contextlib
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

COMMANDS = [command.name or command.callback.__name__.replace("_", "-") for command in app.registered_commands]
NUMERICAL = {"numpy", "scipy", "sklearn", "numba", "llvmlite", "pandas", "h5py", "pyarrow", "matplotlib", "joblib"}
PLUGINS = {"uwbbench_detectors", "uwbbench_datasets"}
NOT_FOR_HELP = {*NUMERICAL, *PLUGINS, "pydantic", "yaml", "rich", "importlib.metadata", "multiprocessing"}


def loaded_by(words: list[str], modules: set[str], folder: Path) -> list[str]:
    """Which of these modules a command has loaded when it ends."""
    script = (
        "import sys\nfrom uwbbench.cli import app\n"
        f"try:\n    app({words!r})\nexcept SystemExit:\n    pass\n"
        f"print(*({modules!r} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, check=True)
    assert done.stdout
    return done.stderr.split()


LIGHT = [["list"], ["list", "stages", "--json"], ["version"], ["run", "--help"], ["warmup", "--help"]]


@pytest.mark.parametrize("words", LIGHT)
def test_light_commands_load_no_numerical_library_and_no_plugin(words: list[str], tmp_path: Path) -> None:
    assert loaded_by(words, NUMERICAL | PLUGINS, tmp_path) == []


@pytest.mark.parametrize("words", [["--help"], ["--version"]])
def test_help_and_version_load_nothing_that_they_do_not_need(words: list[str], tmp_path: Path) -> None:
    assert loaded_by(words, NOT_FOR_HELP, tmp_path) == []


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


def hears_interrupts() -> None:
    """Undo what a shell does to what it starts in the background, such as these tests."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_interrupting_gives_130_and_a_short_message(tmp_path: Path) -> None:
    fifo = tmp_path / "slow.yaml"
    os.mkfifo(fifo)  # reading it waits for ever, so that the interrupt finds the command at work
    waiting = subprocess.Popen(
        [sys.executable, "-m", "uwbbench.cli", "validate", str(fifo)],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=hears_interrupts,
    )
    writer = os.open(fifo, os.O_WRONLY)  # returns once the command has opened the other end
    message = ""
    try:
        for _ in range(9):  # a signal between two instructions of Python does not end the wait that follows
            time.sleep(0.2)
            waiting.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                _, message = waiting.communicate(timeout=20)
                break
    finally:
        os.close(writer)
    assert (waiting.returncode, message) == (130, "interrupted\n")
