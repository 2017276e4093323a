"""A stage that only takes time, installed for worker processes: how a benchmark or a test slows a detector down."""

from pathlib import Path

_STAGE = '''
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
'''


def install(site: Path) -> None:
    """Write a distribution with the stages ``test.wait`` and ``test.crash``; put ``site`` on ``PYTHONPATH``."""
    info = site / "waiting_stage-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "waiting_stage.py").write_text(_STAGE)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: waiting-stage\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[uwbbench.stages]\ntest.wait = waiting_stage:Wait\ntest.crash = waiting_stage:Crash\n"
    )


def slowed(path: Path, wait_us: float, detector: str = "paper-filtering") -> Path:
    """Write a detector file: a shipped detector that waits in every frame."""
    from uwbbench.config.detector import read_detector

    steps = [
        f"  - {{use: {s.use}, as: {s.label}, optional: {str(s.optional).lower()}, params: {s.params}}}"
        for s in read_detector(detector).steps
    ]
    lines = "\n".join([*steps, f"  - {{use: test.wait, params: {{wait_us: {wait_us}}}}}"])
    path.write_text(f"schema: 1\nname: {path.stem}\npipeline:\n{lines}\n")
    return path
