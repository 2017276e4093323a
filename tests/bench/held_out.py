"""Settings of ``background-*`` and ``cfar-*`` for a recording that they were not chosen on.

    python tests/bench/held_out.py --data-dir DATA

Each detector has a small grid of settings, in units that travel between radars: seconds, pulse lengths, and the rate of
false alarms in noise. For each measured recording the setting is taken that does best on the *other* recordings and on
simulated scenes of a like radar; what it finds on the recording held out is the figure that may be reported. Beside it
stand the shipped defaults. The scenes are simulated and their truth is all that moves, so that they speak against false
alarms, which no recording does: their truth is not exhaustive.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from p440_scenes import passing, walking
from threadpoolctl import threadpool_limits

from uwbbench import load_detector
from uwbbench.api import Capture
from uwbbench.config.source import data_roots, open_dataset
from uwbbench.measure.accuracy.scoring import Region, Scores, ScoringRules, score

SECONDS = (0.25, 0.5, 1.0, 2.0, 4.0)
RATES = (1e-2, 1e-3, 1e-4, 1e-5)
"""Of one tap of noise alone."""
TRAINING, GUARD = (6, 12, 24), (1, 2)
"""In pulse lengths, of both sides and of one."""
SCENES = 4
"""Of each simulated kind."""

Setting = Mapping[str, Any]


def snr_db(rate: float) -> float:
    """Level over the noise's mean power that its power, distributed exponentially, exceeds so often."""
    return float(10 * np.log10(-np.log(rate)))


def background(stage: str, key: str, share: float) -> list[Setting]:
    """Settings of a detector that subtracts a background, of ``share`` of the seconds."""
    return [
        {f"{stage}.{key}": share * seconds, "filter.snr.minimum_db": round(snr_db(rate), 1)}
        for seconds, rate in itertools.product(SECONDS, RATES)
    ]


def cfar(stage: str) -> list[Setting]:
    """Settings of a CFAR detector behind an exponential background."""
    return [
        {
            "clutter.exponential.memory_s": seconds / 2,
            f"{stage}.training_pulses": training,
            f"{stage}.guard_pulses": guard,
            f"{stage}.false_alarm_rate": rate,
        }
        for seconds, training, guard, rate in itertools.product(SECONDS[:3], TRAINING, GUARD, RATES[:3])
    ]


GRIDS = {
    "background-mean": background("clutter.mean", "window_s", 1.0),
    "background-ema": background("clutter.exponential", "memory_s", 0.5),
    "background-svd": background("clutter.svd", "window_s", 1.0),
    "cfar-ca": cfar("cfar.ca"),
    "cfar-os": cfar("cfar.os"),
}


@dataclass(frozen=True)
class Recording:
    """Captures that count as one, and how they are scored.

    Attributes
    ----------
    captures : tuple of Capture
    rules : ScoringRules
    simulated : bool
        Scored by F1, else by recall.
    """

    captures: tuple[Capture, ...]
    rules: ScoringRules
    simulated: bool = False

    def scores(self, detector: str, setting: Setting) -> list[Scores]:
        """Scores of a detector on each capture."""
        changes = {
            f"pipeline.{key.rpartition('.')[0]}.params.{key.rpartition('.')[2]}": v for key, v in setting.items()
        }
        r = self.rules
        pipeline = load_detector(detector, changes=changes)
        return [
            score(pipeline.run(each), each, r.scoring, r.gate_m, r.region, strongest=r.strongest)
            for each in self.captures
        ]

    def value(self, scores: list[Scores]) -> float:
        """What a setting is chosen by."""
        return float(np.mean([each.f1 if self.simulated else each.recall for each in scores]))


def measured(data_dir: Path | None) -> dict[str, Recording]:
    """The three recordings, as the experiments of these names score them."""
    roots = data_roots(data_dir)

    def captures(use: str, **params: object) -> Iterator[Capture]:
        dataset = open_dataset(use, params, roots)
        yield from (dataset.open(name) for name in dataset.names())

    sides = [
        each for side in ("left", "right") for each in captures("pulson440-rail", frames="moving", reflectors=side)
    ]
    return {
        "rail": Recording(tuple(sides), ScoringRules("object", 0.2, Region(6.0, 10.0), 2)),
        "tree": Recording(tuple(captures("pulson440-tree")), ScoringRules("object", 0.2, Region(4.5, 12.0), 1)),
        "walk": Recording(tuple(captures("et4173-walk")), ScoringRules("frame", 0.3)),
    }


def simulated() -> dict[str, Recording]:
    """Scenes of a like radar."""
    return {
        "passing": Recording(tuple(passing(i) for i in range(SCENES)), ScoringRules("object", 0.2), simulated=True),
        "walking": Recording(tuple(walking(i) for i in range(SCENES)), ScoringRules("frame", 0.3), simulated=True),
    }


def rows(detector: str, recordings: Mapping[str, Recording], scenes: Mapping[str, Recording]) -> Iterator[list[str]]:
    """A row of the table for each recording held out."""
    every = {**recordings, **scenes}
    values = []
    for number, setting in enumerate(GRIDS[detector]):
        print(f"\r{detector}: setting {number + 1} of {len(GRIDS[detector])} ", end="", file=sys.stderr, flush=True)
        values.append({name: each.value(each.scores(detector, setting)) for name, each in every.items()})
    print(file=sys.stderr)
    for name, held in recordings.items():
        others = [float(np.mean([v for other, v in row.items() if other != name])) for row in values]
        chosen = GRIDS[detector][int(np.argmax(others))]
        yield [
            detector,
            name,
            *_figures(held.scores(detector, chosen)),
            *_figures(held.scores(detector, {})),
            _text(chosen),
        ]
    best = int(np.argmax([float(np.mean(list(row.values()))) for row in values]))
    everywhere = ", ".join(f"{name} {value:.2f}" for name, value in values[best].items())
    yield [detector, "(none)", "", "", "", "", _text(GRIDS[detector][best]) + f" [{everywhere}]"]


def _figures(scores: list[Scores]) -> tuple[str, str]:
    """Recall with its chance level, and the mean error of matches."""
    recall, chance, error = (
        np.mean([getattr(each, name) for each in scores]) for name in ("recall", "chance_recall", "matched_mae_m")
    )
    return f"{recall:.2f} ({chance:.2f})", f"{100 * error:.1f} cm"


def _text(setting: Setting) -> str:
    return ", ".join(f"{key.rpartition('.')[2]} {value:g}" for key, value in setting.items())


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data-dir", type=Path, help="folder of the recordings; else UWBBENCH_DATA and the cache")
    parser.add_argument("--detector", action="append", choices=list(GRIDS), help="only this one; may be repeated")
    chosen = parser.parse_args()
    recordings, scenes = measured(chosen.data_dir), simulated()
    columns = ("detector", "held out", "recall (chance)", "MAE", "shipped: recall (chance)", "MAE", "setting chosen")
    print("| " + " | ".join(columns) + " |\n|" + " --- |" * len(columns))
    with threadpool_limits(1):  # threads only contend over matrices as small as these
        for detector in chosen.detector or GRIDS:
            for row in rows(detector, recordings, scenes):
                print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
