"""A robot that maps while it drives: odometry that drifts, the echoes of two receivers, and a filter that uses both.

Leaves ``map_while_driving.png``: the true rods and path, and what a mapper made of odometry and echoes.
"""

import sys
import tempfile
from pathlib import Path

import uwbbench

EXPERIMENT = """
schema: 1
detectors: [odometry, slam-points]
datasets:
  - use: simulated
    name: rods
    params: {scenes: [rods-loop], runs: 1, seed: 7001}
    captures: ["rods-loop/drift-0.02/*"]
scoring: [pose, map]
stability: false
latency: false
"""


def main(folder: Path) -> None:
    """Drive twice round, print how far off, draw the map."""
    scratch = Path(tempfile.mkdtemp())
    (scratch / "rods.yaml").write_text(EXPERIMENT)
    run = uwbbench.run(scratch / "rods.yaml", out=scratch / "run")
    print(run.scores[run.scores.scoring == "pose"][["detector", "ate_m", "end_error_m"]].to_string(index=False))
    uwbbench.plot("map", run, folder / "map_while_driving.png", detector="slam-points")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).parent)
