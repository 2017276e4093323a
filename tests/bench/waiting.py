"""Stages that only take time, installed for worker processes: how a benchmark or a test slows a detector down."""

from pathlib import Path

_STAGES = '''
from itertools import repeat
from time import perf_counter_ns

from pydantic import Field
from uwbbench.api import Params, Stage, ports


class WaitParams(Params):
    wait_us: float = Field(0.0, ge=0)


class Wait(Stage[WaitParams]):
    """Keeps the processor busy for so long in every frame, and changes nothing."""

    consumes = ports("detections")

    def step(self, block):
        until = perf_counter_ns() + int(self.params.wait_us * 1e3) * len(block.frames)
        while perf_counter_ns() < until:
            pass
        return block


class Crash(Stage[WaitParams]):
    """Takes its process down."""

    consumes = ports("detections")

    def step(self, block):
        import os

        os._exit(7)


class CountParams(Params):
    rounds: int = Field(0, ge=0)


class Count(Stage[CountParams]):
    """Counts in every frame: work of which twice as many rounds take twice the time, some 10 ns each."""

    consumes = ports("detections")

    def step(self, block):
        for _ in repeat(None, self.params.rounds):
            pass
        return block


class Uneven(Stage[WaitParams]):
    """Waits on the receiver that its process opens first, and on no later one: a base that differs from itself."""

    consumes = ports("detections")
    first = None

    def open(self, radar):
        super().open(radar)
        Uneven.first = Uneven.first or radar
        self._wait_ns = int(self.params.wait_us * 1e3) if radar is Uneven.first else 0

    def step(self, block):
        until = perf_counter_ns() + self._wait_ns * len(block.frames)
        while perf_counter_ns() < until:
            pass
        return block
'''

STAGES = {"test.wait": "Wait", "test.crash": "Crash", "test.count": "Count", "test.uneven": "Uneven"}


def install(site: Path) -> None:
    """Write a distribution with these stages; put ``site`` on ``PYTHONPATH``."""
    info = site / "waiting_stage-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "waiting_stage.py").write_text(_STAGES)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: waiting-stage\nVersion: 1.0\n")
    points = "\n".join(f"{name} = waiting_stage:{cls}" for name, cls in STAGES.items())
    (info / "entry_points.txt").write_text(f"[uwbbench.stages]\n{points}\n")


def with_stage(path: Path, use: str, params: dict[str, float], detector: str = "paper-filtering") -> Path:
    """Write a detector file: a shipped detector with one of these stages behind it."""
    from uwbbench.config.detector import read_detector

    steps = [
        f"  - {{use: {s.use}, as: {s.label}, optional: {str(s.optional).lower()}, params: {s.params}}}"
        for s in read_detector(detector).steps
    ]
    lines = "\n".join([*steps, f"  - {{use: {use}, params: {params}}}"])
    path.write_text(f"schema: 1\nname: {path.stem}\npipeline:\n{lines}\n")
    return path


def slowed(path: Path, wait_us: float, detector: str = "paper-filtering") -> Path:
    """Write a detector file: a shipped detector that waits in every frame."""
    return with_stage(path, "test.wait", {"wait_us": wait_us}, detector)
