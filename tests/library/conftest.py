"""A small run made by the public function, and copies of it to change."""

import shutil
from pathlib import Path

import pytest

import uwbbench

SMALL = {
    "name": "small",
    "detectors": ["paper", "cfar-os"],
    "datasets": [{"use": "approach", "name": "plates", "params": {"speed_m_s": 3.0, "runs": 3}}],
    "scoring": "frame",
    "latency": {"frames": 20},
    "stability": False,
    "intervals": {"resamples": 100},
}


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> uwbbench.Run:
    """Two detectors on three simulated captures, timed."""
    return uwbbench.run(SMALL, tmp_path_factory.mktemp("library") / "small", jobs=1)


@pytest.fixture
def copied(made: uwbbench.Run, tmp_path: Path) -> uwbbench.Run:
    return uwbbench.open_run(shutil.copytree(made.path, tmp_path / "copy"))
