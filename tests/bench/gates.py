"""What regression gates said of a detector against itself, and of one that is a tenth slower.

Run through ``python tests/bench/run.py gate``; ``bench_gate.py`` is how it is measured.
"""

from __future__ import annotations

from collections.abc import Iterator

import bench_gate
import numpy as np
from harness import Effort, Interval, Row, at_least, at_most

from uwbbench.measure.accuracy.stats import clopper_pearson
from uwbbench.tools.gate.check import GateVerdict


def rows(effort: Effort) -> Iterator[Row]:
    """All targets of this module."""
    gates = effort.gates
    with bench_gate.bench() as (worker, ref, folder):
        for detector in bench_gate.DETECTORS:
            pair = bench_gate.slowed(worker, ref, folder, detector)
            same = bench_gate.tally(worker, ref, pair.base, pair.base, gates)
            title = f"{gates} gates of {detector}, base against base: share of regressions"
            yield at_most(title, 0, _share(same), "", _note(same))
            slower = bench_gate.tally(worker, ref, pair.base, pair.head, gates)
            title = f"{gates} gates of {detector}, {bench_gate.SLOWDOWN:.0%} slower: share caught"
            made = f"made slower by {pair.ratio.value - 1:.1%}" + ("" if pair.near else ", NOT what was asked for")
            yield at_least(title, 0.95, _share(slower), "", f"{made}; {_note(slower)}")


def _share(tally: bench_gate.Tally) -> Interval:
    """Regressions among the verdicts, with the exact interval of a binomial share."""
    found, gates = tally.verdicts[GateVerdict.REGRESSION], tally.verdicts.total()
    return Interval(found / gates, *clopper_pearson(found, gates))


def _note(tally: bench_gate.Tally) -> str:
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in tally.verdicts.items())
    return f"{verdicts}; median ratio {np.median(tally.ratios):.3f}" if tally.ratios else verdicts
