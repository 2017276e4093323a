"""How often a latency gate raises a false alarm, and how often it catches a detector that is 10 % slower.

Run ``python tests/bench/bench_gate.py``. Each gate is what ``uwbbench gate`` does, canary included, with players loaded
and warmed up anew; only the worker process is kept, to save its start. The slower detector waits in every frame for a
tenth of the time that the same detector was measured to take.
"""

import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import waiting

from uwbbench.api import write_capture
from uwbbench.config.source import CaptureRef, open_dataset
from uwbbench.gate.check import Verdict
from uwbbench.gate.config import LatencyGateModel, Side
from uwbbench.gate.latency import TURN_FRAMES, checks_within
from uwbbench.gate.link import Worker, join, worker_of
from uwbbench.stats import clopper_pearson

GATES = 100
SLOWDOWN = 0.10
DETECTOR = "paper-filtering"
PASSES = 10
SETTINGS = LatencyGateModel()


@dataclass(frozen=True)
class Tally:
    """Verdicts of many gates.

    Attributes
    ----------
    verdicts : Counter
        How often each came out.
    ratios : list of float
        Measured ratio of each gate that measured one.
    """

    verdicts: Counter[Verdict]
    ratios: list[float]

    def text(self, what: str) -> str:
        """Alarms with their exact 95 % interval, and the other verdicts."""
        gates, alarms = self.verdicts.total(), self.verdicts[Verdict.REGRESSION]
        low, high = clopper_pearson(alarms, gates)
        others = ", ".join(f"{count} {verdict}" for verdict, count in self.verdicts.items())
        middle = sorted(self.ratios)[len(self.ratios) // 2] if self.ratios else float("nan")
        return f"{what}: {alarms} alarms in {gates} gates [{low:.1%}, {high:.1%}], median ratio {middle:.4f} ({others})"


@contextmanager
def bench() -> Iterator[tuple[Worker, CaptureRef, Path]]:
    """A worker that knows the stage ``test.wait``, a capture file, and a folder for detectors."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        waiting.install(folder / "site")
        dataset = open_dataset("approach", {"speed_m_s": 0.15}, [])
        write_capture(folder / "approach.h5", dataset.open(dataset.names()[0]))
        before = os.environ.get("PYTHONPATH")
        os.environ["PYTHONPATH"] = str(folder / "site")
        try:
            with worker_of(Side("base", DETECTOR, {}, None), 600.0) as worker:
                yield worker, CaptureRef.of_file(folder / "approach.h5"), folder
        finally:
            os.environ.pop("PYTHONPATH") if before is None else os.environ.update(PYTHONPATH=before)


def frame_us(worker: Worker, base: Side, ref: CaptureRef) -> float:
    """Time that a detector takes for a frame: of every part of the capture the fastest pass, as others interrupt."""
    frames = join(worker, "base", base, ref, SETTINGS.frames, SETTINGS.warmup_windows)["frames"]
    parts = frames // TURN_FRAMES
    spent_s = [
        [worker.ask("turn", player="base", size=TURN_FRAMES)["spent_s"] for _ in range(parts)] for _ in range(PASSES)
    ]
    return sum(map(min, zip(*spent_s, strict=True))) / (parts * TURN_FRAMES) * 1e6


def tally(worker: Worker, ref: CaptureRef, folder: Path, slowdown: float, gates: int = GATES) -> Tally:
    """Verdicts of gates of a detector against itself, made slower by a share."""
    base = Side("base", str(waiting.slowed(folder / "base.yaml", 0.0, DETECTOR)), {}, None)
    found = Tally(Counter(), [])
    for _ in range(gates):
        path = waiting.slowed(folder / "head.yaml", slowdown * frame_us(worker, base, ref), DETECTOR)
        head = Side("head", str(path), {}, None)
        check = checks_within(worker, base, head, SETTINGS, "bench", ref, lambda _: None)[-1]
        found.verdicts[check.verdict] += 1
        if check.value is not None:
            found.ratios.append(check.value)
    return found


def main() -> int:
    """Print both rates; 1 if one of them is not what gates promise."""
    gates = int(sys.argv[1]) if len(sys.argv) > 1 else GATES
    started = time.perf_counter()
    with bench() as (worker, ref, folder):
        same = tally(worker, ref, folder, 0.0, gates)
        print(same.text("base against base"))
        slower = tally(worker, ref, folder, SLOWDOWN, gates)
        print(slower.text(f"head {SLOWDOWN:.0%} slower"))
    print(f"{time.perf_counter() - started:.0f} s")
    alarms, caught = same.verdicts[Verdict.REGRESSION], slower.verdicts[Verdict.REGRESSION]
    return int(alarms > 0 or caught < 0.95 * gates)


if __name__ == "__main__":
    sys.exit(main())
