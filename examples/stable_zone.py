"""A sweep over thresholds: the best ones, what they are worth on captures held out, and how far off they may be.

Simulated approaches. Leaves ``stable_zone.png``: F1 for each pair of thresholds, and the zone in which the choice
hardly matters.
"""

import sys
import tempfile
from pathlib import Path

import uwbbench

TUNING = {
    "name": "plates",
    "detector": "paper-filtering",
    "grid": {
        "pipeline.filter.prominence.params.minimum": {"start": 0.0, "stop": 0.2, "count": 41},
        "pipeline.filter.width.params.minimum": {"start": 0.0, "stop": 4.0, "count": 41},
    },
    "tuning": [{"use": "approach", "name": "tuned on", "params": {"speed_m_s": 0.6, "runs": 3}}],
    "held_out": [{"use": "approach", "name": "held out", "params": {"speed_m_s": 0.6, "runs": 3, "seed": 7}}],
    "groups": ["overall"],
}


def main(folder: Path) -> None:
    """Tune, print what was chosen and what it is worth, draw the zone."""
    outcome = uwbbench.tune(TUNING, tempfile.mkdtemp(), figure=folder / "stable_zone.png")
    (tuned,) = outcome.groups
    for path, value in tuned.values.items():
        print(f"{path} = {value:.3g}")
    print(f"F1 on the captures tuned on: {tuned.before.scores.f1[0]:.3f} -> {tuned.after.scores.f1[0]:.3f}")
    print(f"F1 on those held out: {tuned.held_out_before.scores.f1[0]:.3f} -> {tuned.held_out_after.scores.f1[0]:.3f}")
    print(f"share of the grid within {tuned.zone.within:g} of the best F1: {tuned.zone.share:.0%}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).parent)
