"""Three detectors on the same captures: who finds the plate, how far off, and at what cost.

Simulated approaches to a plate. Leaves ``compare_detectors.png``: time a frame, relative to a reference detector in
alternating blocks, against F1; both with their 95 % intervals.
"""

import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

import uwbbench

EXPERIMENT = {
    "name": "three detectors",
    "detectors": ["paper-filtering", "background-svd", "cfar-os"],
    "datasets": [
        {"use": "approach", "name": "plywood", "params": {"material": "plywood", "speed_m_s": 1.5, "runs": 9}}
    ],
    "scoring": "frame",
    "latency": {"frames": 60, "blocks": 30},
    "stability": False,
}


def main(folder: Path) -> None:
    """Run, print the table, draw the picture."""
    run = uwbbench.run(EXPERIMENT, tempfile.mkdtemp(), jobs=1)
    table = run.leaderboard
    print(table[["dataset", "source", "detector", "f1", "f1_low", "f1_high", "mae"]].to_string(index=False))

    times = run.times.set_index("detector")
    figure = Figure(figsize=(6, 3.6), layout="constrained")
    axes = figure.subplots()
    for row in table.itertuples():
        time = times.loc[row.detector]
        across = [[time.ratio - time.ratio_low], [time.ratio_high - time.ratio]]
        up = [[row.f1 - row.f1_low], [row.f1_high - row.f1]]
        axes.errorbar(time.ratio, row.f1, up, across, fmt="o", capsize=3, label=row.detector)
    axes.set(xscale="log", xlabel=f"time a frame, in times of {time.reference}", ylabel="F1, frame scoring")
    axes.set_title("Approaches to a plywood plate, SIMULATED: left and up is better")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.grid(which="both", alpha=0.3)
    axes.legend()
    figure.savefig(folder / "compare_detectors.png", dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).parent)
