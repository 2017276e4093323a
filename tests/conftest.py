"""Captures that many tests share."""

import os
from pathlib import Path

import pytest

from uwbbench.api import Capture
from uwbbench.registry import load

_DATA = Path(os.environ.get("UWBBENCH_DATA", Path(__file__).parents[2] / "shared" / "data"))


def simulated_approach(**params: object) -> Capture:
    """One run of the built-in simulated approach."""
    adapter = load("datasets", "approach")
    dataset = adapter(adapter.params_type().model_validate(params), ())
    return dataset.open(dataset.names()[0])


@pytest.fixture(scope="session")
def approach() -> Capture:
    """A metal plate approached on channel 9, with STS."""
    return simulated_approach()


@pytest.fixture(scope="session")
def approach_without_sts() -> Capture:
    """The same plate, without STS."""
    return simulated_approach(sts=False)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the measured captures; tests that need them skip where it is missing."""
    if not _DATA.is_dir():
        pytest.skip(f"measured captures not found in {_DATA}; set UWBBENCH_DATA")
    return _DATA
