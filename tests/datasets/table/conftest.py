"""The capture that recordings are written from."""

import pytest

from tests.datasets.table.layouts import FRAMES
from uwbbench.api import Capture, Obstacle
from uwbbench.config.source import open_dataset


@pytest.fixture(scope="module")
def original() -> Capture:
    dataset = open_dataset("approach", {"start_m": 1.0, "stop_m": 0.856}, [])
    capture = dataset.open(dataset.names()[0])
    assert len(capture) == FRAMES
    return capture


@pytest.fixture(scope="module")
def original_object(original) -> Obstacle:
    return original.truth.objects[0]
