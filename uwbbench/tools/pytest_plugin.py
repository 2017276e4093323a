"""A pytest fixture that times a detector with pytest-benchmark, for developers of detectors.

Found by pytest in every session where uwbbench is installed, so nothing is imported before a test asks for it.
Results are pytest-benchmark's: shown, compared and stored by its own options, such as ``--benchmark-json``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from uwbbench.api.capture import Capture
    from uwbbench.detect.pipeline import Pipeline

ROUNDS, BATCH_ROUNDS = 1000, 10
WARM_UP_WINDOWS = 10


class DetectorBenchmark:
    """Times a detector on a capture under pytest-benchmark; called once in a test.

    Parameters
    ----------
    benchmark : pytest_benchmark.fixture.BenchmarkFixture
    """

    def __init__(self, benchmark: Any) -> None:
        self._benchmark = benchmark

    def __call__(
        self,
        detector: str | Path | Pipeline,
        capture: str | Path | Capture,
        *,
        batch: bool = False,
        rounds: int | None = None,
    ) -> None:
        """Time a detector, warmed up, from the raw samples in memory on.

        Parameters
        ----------
        detector : str, Path or Pipeline
            Name, detector file, or a loaded detector.
        capture : str, Path or Capture
            Capture file, or an open capture.
        batch : bool
            A round is the whole capture in blocks, up to its detections; otherwise it is one frame of a stream, up to
            its rows as plain records, the capture starting again at its end.
        rounds : int, optional
            1 000 frames, or 10 batches, if left out.

        Raises
        ------
        UwbbenchError
            If there is no such detector or capture, the capture has no frames, or they do not go together.
        """
        from uwbbench.api.capture_file import open_capture
        from uwbbench.api.errors import CaptureError
        from uwbbench.detect.pipeline import Pipeline, load_detector
        from uwbbench.measure.latency.loops import warm_up
        from uwbbench.measure.latency.received import received

        pipeline = detector if isinstance(detector, Pipeline) else load_detector(detector)
        opened = open_capture(capture) if isinstance(capture, str | Path) else capture
        frames = received(opened)
        if not len(frames):
            raise CaptureError(f"capture '{opened.name}' has no frames; there is nothing to time")
        self._benchmark.extra_info |= _about(pipeline, opened, "batch" if batch else "stream")
        warm_up(pipeline, opened, frames, WARM_UP_WINDOWS)
        time = self._batch if batch else self._stream
        time(pipeline, opened, frames, rounds)

    def _stream(self, pipeline: Pipeline, capture: Capture, frames: Capture, rounds: int | None) -> None:
        """One frame a round."""
        from uwbbench.measure.latency.received import laps

        stream = pipeline.open(capture)
        source, numbers = laps(frames, rounds or ROUNDS, renumbered="truth" not in stream.needs)
        step, receive, sts = stream.step, source.frames, "sts" in stream.needs
        coming = iter(numbers)

        def run(frame: int) -> None:
            step(receive(frame, frame + 1, sts=sts)).records()

        self._benchmark.pedantic(run, setup=lambda: ((next(coming),), {}), rounds=len(numbers))

    def _batch(self, pipeline: Pipeline, capture: Capture, frames: Capture, rounds: int | None) -> None:
        """The whole capture a round, each time with a fresh stream."""
        from uwbbench.api.frames import BATCH_FRAMES

        def fresh() -> tuple[tuple[Any, ...], dict[str, Any]]:
            return (pipeline.open(capture),), {}

        def run(stream: Any) -> None:
            for block in frames.blocks(BATCH_FRAMES, sts="sts" in stream.needs):
                stream.step(block)
            stream.flush()

        self._benchmark.pedantic(run, setup=fresh, rounds=rounds or BATCH_ROUNDS)


def _about(pipeline: Pipeline, capture: Capture, mode: str) -> dict[str, Any]:
    """What a stored result needs to say to be compared with another."""
    from uwbbench import __version__
    from uwbbench.measure.latency.machine import machine

    return {
        "detector": pipeline.name,
        "detector_identity": pipeline.identity,
        "capture": capture.name,
        "capture_sha256": capture.sha256,
        "capture_source": capture.source,
        "frames": len(capture),
        "taps": capture.radar.taps,
        "mode": mode,
        "uwbbench": __version__,
        "machine": machine(),
    }


@pytest.fixture
def detector_benchmark(request: pytest.FixtureRequest) -> DetectorBenchmark:
    """Time a detector on a capture with pytest-benchmark; see :class:`DetectorBenchmark`.

    Skips where pytest-benchmark is not installed, or switched off by ``-p no:benchmark``.
    """
    if not request.config.pluginmanager.has_plugin("benchmark"):
        pytest.skip("detector_benchmark needs pytest-benchmark: pip install pytest-benchmark")
    return DetectorBenchmark(request.getfixturevalue("benchmark"))
