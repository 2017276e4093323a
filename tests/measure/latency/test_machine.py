"""What is told of the machine."""

from pathlib import Path

import pytest

from uwbbench.measure.latency.machine import governor, load, machine, turbo, versions


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True)
    path.write_text(text)


def test_the_governor_is_read_where_the_system_tells(tmp_path: Path) -> None:
    assert governor(tmp_path) is None
    write(tmp_path / "cpu0/cpufreq/scaling_governor", "powersave\n")
    assert governor(tmp_path) == "powersave"


@pytest.mark.parametrize(
    ("file", "text", "expected"),
    [
        ("cpufreq/boost", "1\n", True),
        ("cpufreq/boost", "0\n", False),
        ("intel_pstate/no_turbo", "1\n", False),
        ("intel_pstate/no_turbo", "0\n", True),
    ],
)
def test_turbo_is_read_from_either_driver(tmp_path: Path, file: str, text: str, expected: bool) -> None:
    assert turbo(tmp_path) is None
    write(tmp_path / file, text)
    assert turbo(tmp_path) is expected


def test_the_machine_and_the_versions_are_named() -> None:
    assert {"cpu", "cores", "governor", "turbo", "os"} <= set(machine())
    assert set(versions()) == {"python", "numpy", "numba"}
    waiting = load()
    assert waiting is None or waiting >= 0
