"""Memory that a long stream keeps."""

import math
import mmap
import sys

import numpy as np
import pytest

from uwbbench.api import Capture, Detections
from uwbbench.detect.pipeline import load_detector
from uwbbench.measure.latency import memory
from uwbbench.measure.latency.received import received


class Keeping:
    """A detector that keeps some bytes of every frame."""

    needs: frozenset[str] = frozenset()

    def __init__(self, bytes_a_frame: int) -> None:
        self.bytes_a_frame, self.kept = bytes_a_frame, []

    def open(self, _: Capture) -> "Keeping":
        self.kept: list[object] = []
        return self

    def step(self, _: object) -> Detections:
        self.kept.append(np.zeros(self.bytes_a_frame, np.uint8))
        return Detections.empty()


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """All frames are watched, however slow the machine."""
    monkeypatch.setattr(memory, "LIMIT_S", math.inf)


@pytest.mark.slow
@pytest.mark.usefixtures("patient")
def test_what_a_stream_keeps_of_each_frame_is_found(approach: Capture) -> None:
    found = memory.growth(Keeping(4000), approach, received(approach, 40))  # type: ignore[arg-type]
    assert found["memory_growth_bytes"] == pytest.approx(4e6, rel=0.1)
    assert found["growth_frames"] == memory.MEASURED_FRAMES


@pytest.mark.slow
@pytest.mark.usefixtures("patient")
def test_a_stream_that_keeps_nothing_does_not_grow(approach: Capture) -> None:
    found = memory.growth(load_detector("null"), approach, received(approach, 40))
    assert found["memory_growth_bytes"] is not None
    assert found["memory_growth_bytes"] < 5000


@pytest.mark.slow
def test_a_slow_detector_is_watched_for_fewer_frames(approach: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "LIMIT_S", 0.01)
    monkeypatch.setattr(memory, "MEASURED_FRAMES", 10**5)
    found = memory.growth(Keeping(4000), approach, received(approach, 40))  # type: ignore[arg-type]
    assert found["growth_frames"] is not None
    assert 0 < found["growth_frames"] < 10**5


@pytest.mark.skipif(sys.platform == "win32", reason="not told by Windows")
def test_the_peak_holds_what_was_touched() -> None:
    before = memory.resident_bytes()
    # Mapped anew by the system: an array may be given memory that freed objects have left resident.
    with mmap.mmap(-1, 64 << 20) as held:
        np.frombuffer(held, np.uint8)[:] = 1
        now = memory.resident_bytes()
        assert memory.peak_bytes() > len(held)
        if before is not None:
            assert now is not None
            assert now - before > len(held) / 2
