"""How often a latency gate raises a false alarm, and how often it catches a detector that is 10 % slower.

Run ``python tests/bench/bench_gate.py [GATES [DETECTOR ...]]``. Each gate is what ``uwbbench gate`` does, canary
included, with players loaded and warmed up anew; only the worker process is kept, to save its start.

The slower detector has a stage behind it that counts to a number in every frame, the other the same stage counting to
zero. The number is chosen once for each detector, in steps that come nearer, and what it makes is then measured anew,
in blocks of their own and more of them than any gate has: catching counts for something only where that is near 10 %.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import waiting

from uwbbench.api import write_capture
from uwbbench.config.source import CaptureRef, open_dataset
from uwbbench.measure.accuracy.stats import clopper_pearson
from uwbbench.measure.latency.machine import load
from uwbbench.measure.latency.player import turn_frames
from uwbbench.measure.latency.ratio import Ratio
from uwbbench.tools.gate.check import GateVerdict
from uwbbench.tools.gate.config import LatencyGateModel, Side
from uwbbench.tools.gate.latency import checks_within
from uwbbench.tools.gate.link import Worker, join, worker_of

GATES = 100
SLOWDOWN = 0.10
NEAR = (1.09, 1.11)
"""Between these a slow-down is one of 10 %."""

DETECTORS = ("paper-filtering", "background-mean")
"""One of some microseconds a frame, whose kernel does everything at once, and a chain of a hundred."""

CALIBRATION_BLOCKS = 200
APPROACHES = 2
SETTINGS = LatencyGateModel()


@dataclass(frozen=True)
class Slowed:
    """A detector, and the same slowed down.

    Attributes
    ----------
    base, head : Side
    rounds : int
        What the head counts to in every frame.
    ratio : Ratio
        How much slower it is.
    """

    base: Side
    head: Side
    rounds: int
    ratio: Ratio

    @property
    def near(self) -> bool:
        """Whether it is slower by what was asked for."""
        return NEAR[0] <= self.ratio.value <= NEAR[1]


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

    verdicts: Counter[GateVerdict]
    ratios: list[float]

    def text(self, what: str) -> str:
        """Alarms with their exact 95 % interval, and the other verdicts."""
        gates, alarms = self.verdicts.total(), self.verdicts[GateVerdict.REGRESSION]
        low, high = clopper_pearson(alarms, gates)
        others = ", ".join(f"{count} {verdict}" for verdict, count in self.verdicts.items())
        spread = "{:.4f} [{:.4f} to {:.4f}]".format(*np.quantile(self.ratios or [np.nan], [0.5, 0, 1]))
        return f"{what}: {alarms} alarms in {gates} gates [{low:.1%}, {high:.1%}], ratios {spread} ({others})"


@contextmanager
def bench() -> Iterator[tuple[Worker, CaptureRef, Path]]:
    """A worker that knows the stage ``test.count``, a capture file, and a folder for detectors."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        waiting.install(folder / "site")
        dataset = open_dataset("approach", {"speed_m_s": 0.15}, [])
        write_capture(folder / "approach.h5", dataset.open(dataset.names()[0]))
        before = os.environ.get("PYTHONPATH")
        os.environ["PYTHONPATH"] = str(folder / "site")
        try:
            with worker_of(Side("base", DETECTORS[0], {}, None), 600.0) as worker:
                yield worker, CaptureRef.of_file(folder / "approach.h5"), folder
        finally:
            os.environ.pop("PYTHONPATH") if before is None else os.environ.update(PYTHONPATH=before)


def counting(folder: Path, detector: str, rounds: int) -> Side:
    """A detector that counts in every frame."""
    path = folder / f"{detector}-{rounds}.yaml"
    return Side(f"{rounds} rounds", str(waiting.with_stage(path, "test.count", {"rounds": rounds}, detector)), {}, None)


def slowed(worker: Worker, ref: CaptureRef, folder: Path, detector: str, slowdown: float = SLOWDOWN) -> Slowed:
    """Find the number of rounds that slows a detector by a share."""
    base, rounds = counting(folder, detector, 0), 100
    for _ in range(APPROACHES):
        found = measured(worker, base, counting(folder, detector, rounds), ref)
        rounds = round(rounds * min(max(slowdown / max(found.value - 1, 1e-9), 0.1), 10.0))
    head = counting(folder, detector, rounds)
    return Slowed(base, head, rounds, measured(worker, base, head, ref))


def measured(worker: Worker, base: Side, head: Side, ref: CaptureRef) -> Ratio:
    """Ratio of two detectors from many blocks."""
    sides = {"base": base, "head": head}
    joined = [join(worker, player, side, ref, SETTINGS.frames, 10) for player, side in sides.items()]
    size = turn_frames([found["call_s"] for found in joined], joined[0]["frames"])
    asked = {"size": size, "count": CALIBRATION_BLOCKS}
    return Ratio.of(worker.ask("blocks", base="base", head="head", **asked)["log_ratios"])


def tally(worker: Worker, ref: CaptureRef, base: Side, head: Side, gates: int = GATES) -> Tally:
    """Verdicts of gates in a row."""
    found = Tally(Counter(), [])
    for _ in range(gates):
        checks = checks_within(worker, base, head, SETTINGS, "bench", ref, lambda _: None)
        found.verdicts[checks[-1].verdict] += 1
        if checks[-1].value is not None:
            found.ratios.append(checks[-1].value)
        if checks[-1].verdict not in (GateVerdict.PASS, GateVerdict.REGRESSION):
            print("   ", *(f"{check.kind} {check.verdict} {check.measured_text}" for check in checks), flush=True)
    return found


def main() -> int:
    """Print both rates for each detector; 1 if one of them is not what gates promise."""
    gates = int(sys.argv[1]) if len(sys.argv) > 1 else GATES
    kept = True
    with bench() as (worker, ref, folder):
        for detector in sys.argv[2:] or DETECTORS:
            started = time.perf_counter()
            pair = slowed(worker, ref, folder, detector)
            interval = f"[{pair.ratio.low:.4f}, {pair.ratio.high:.4f}]"
            print(f"{detector}: {pair.rounds} rounds make its time {pair.ratio.value:.4f} {interval} times as long")
            same = tally(worker, ref, pair.base, pair.base, gates)
            print(same.text("  base against base"), flush=True)
            slower = tally(worker, ref, pair.base, pair.head, gates)
            print(slower.text(f"  head {SLOWDOWN:.0%} slower"))
            print(f"  {time.perf_counter() - started:.0f} s, load {load()}", flush=True)
            alarms, caught = same.verdicts[GateVerdict.REGRESSION], slower.verdicts[GateVerdict.REGRESSION]
            kept &= pair.near and alarms == 0 and caught >= math.ceil(0.95 * gates)
    return int(not kept)


if __name__ == "__main__":
    sys.exit(main())
