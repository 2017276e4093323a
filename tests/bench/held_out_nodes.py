"""Settings of detectors of walkers for a node of the measured walk that they were not chosen on.

    python tests/bench/held_out_nodes.py --data-dir DATA

Each detector has a small grid of settings. For each node of et4173-walk the setting is taken that does best on the
*other* node and on simulated walks (scenes ``walker`` and ``walker-p440``, seed 7001), the mean of both; what it finds
on the node held out is the figure that may be reported. Beside it stands what the detector does as shipped.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from held_out import GRIDS as FILTERS
from held_out import RATES, Recording, Setting
from threadpoolctl import threadpool_limits

from uwbbench.config.source import data_roots, open_dataset
from uwbbench.measure.accuracy.scoring import ScoringRules

RULES = ScoringRules("frame", 0.3)
SEED = 7001

GRIDS: Mapping[str, list[Setting]] = {
    "champion-still": [
        {
            "track.before_detect.speed_m_s": speed,
            "track.before_detect.acceleration_m_s2": acceleration,
            "leading_edge.fraction": fraction,
        }
        for speed, acceleration, fraction in itertools.product((1.0, 2.0, 3.0), (0.25, 0.5, 1.0), (0.05, 0.1, 0.3))
    ],
    **{name: FILTERS[name] for name in ("cfar-os", "background-mean", "background-ema", "background-svd")},
    "background-cfar-kalman": [
        {"cfar.ca.false_alarm_rate": rate, "track.kalman.acceleration_m_s2": acceleration}
        for rate, acceleration in itertools.product(RATES, (0.25, 0.5, 1.0, 2.0))
    ],
    "walker-svd": [
        {"select.first_above.fraction": fraction, "smooth.median.frames": frames}
        for fraction, frames in itertools.product((0.05, 0.1, 0.3, 0.5), (1, 5, 15))
    ],
    "walker-rpca": [{}],
}


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data-dir", type=Path, help="folder of the recordings; else UWBBENCH_DATA and the cache")
    parser.add_argument("--detector", action="append", choices=list(GRIDS), help="only this one; may be repeated")
    chosen = parser.parse_args()
    walk = open_dataset("et4173-walk", {}, data_roots(chosen.data_dir))
    nodes = {name: Recording((walk.open(name),), RULES) for name in walk.names()}
    walks = open_dataset("simulated", {"scenes": ["walker", "walker-p440"], "seed": SEED}, ())
    captures = tuple(capture for run in walks.runs() for capture in walks.simulate(run).captures)
    simulated = Recording(captures, RULES, simulated=True)
    print("| detector | node | held out: recall, MAE | as shipped | settings: recall | setting chosen |")
    print("|" + " --- |" * 6)
    with threadpool_limits(1):
        for detector in chosen.detector or GRIDS:
            _rows(detector, nodes, simulated)


def _rows(detector: str, nodes: Mapping[str, Recording], simulated: Recording) -> None:
    """Print a row for each node."""
    grid = GRIDS[detector]
    found = {name: [node.scores(detector, setting)[0] for setting in grid] for name, node in nodes.items()}
    walks = [simulated.value(simulated.scores(detector, setting)) for setting in grid]
    for name, node in nodes.items():
        others = [scores for other, scores in found.items() if other != name]
        value = [walks[k] + np.mean([scores[k].recall for scores in others]) for k in range(len(grid))]
        best = int(np.argmax(value))
        shipped = node.scores(detector, {})[0]
        figures = [f"{each.recall:.3f}, {100 * each.matched_mae_m:.1f} cm" for each in (found[name][best], shipped)]
        recalls = [each.recall for each in found[name]]
        setting = ", ".join(f"{key.rpartition('.')[2]} {value:g}" for key, value in grid[best].items())
        cells = [detector, name, *figures, f"{min(recalls):.3f} to {max(recalls):.3f}", setting]
        print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
