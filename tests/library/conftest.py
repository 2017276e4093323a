"""A small run made by the public function, and copies of it to change."""

import shutil
from pathlib import Path

import pytest

import uwbbench
from tests.fixtures.shared import Once

SMALL = {
    "name": "small",
    "detectors": ["paper", "paper-filtering"],
    "datasets": [{"use": "approach", "name": "plates", "params": {"speed_m_s": 3.0, "runs": 3}}],
    "scoring": "frame",
    "latency": {"frames": 20, "blocks": 8},
    "stability": False,
    "intervals": {"resamples": 100},
}


@pytest.fixture(scope="session")
def made(once: Once) -> uwbbench.Run:
    """Two detectors on three simulated captures, timed."""
    return uwbbench.open_run(once("library", lambda folder: uwbbench.run(SMALL, folder / "small", jobs=1)) / "small")


@pytest.fixture
def copied(made: uwbbench.Run, tmp_path: Path) -> uwbbench.Run:
    return uwbbench.open_run(shutil.copytree(made.path, tmp_path / "copy"))
