"""A gate decides whether a change of a detector may go in.

The change raises a threshold far too much. Simulated approaches. Leaves ``gate_a_change.png``: each measured value
with its 95 % interval, and the limit that it is held against.
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import uwbbench

GATE = {
    "name": "prominence raised",
    "head": {"detector": "paper-filtering", "set": {"pipeline.filter.prominence.params.minimum": 0.15}},
    "datasets": [{"use": "approach", "name": "plates", "params": {"speed_m_s": 0.6, "runs": 4}}],
    "accuracy": [
        {"metric": "precision", "scoring": "frame", "minimum": 0.95},
        {"metric": "recall", "scoring": "frame", "minimum": 0.95},
        {"metric": "f1", "scoring": "frame", "minimum": 0.95},
    ],
}
COLOURS = {"pass": "tab:green", "regression": "tab:red", "inconclusive": "tab:orange", "invalid": "tab:gray"}


def main(folder: Path) -> None:
    """Gate the change, print the verdicts, draw them."""
    result = uwbbench.gate(GATE)
    figure = Figure(figsize=(7, 2.6), layout="constrained")
    axes = figure.subplots()
    for row, check in enumerate(result.checks):
        print(f"{check.name}: {check.measured_text}, limit {check.limit_text}: {check.verdict.value}")
        interval = [[check.value - check.low], [check.high - check.value]]
        colour = COLOURS[check.verdict.value]
        axes.errorbar(check.value, row, xerr=interval, fmt="o", capsize=4, color=colour)
        axes.plot([check.limit] * 2, [row - 0.3, row + 0.3], color="black")
        axes.annotate(check.verdict.value, (check.low, row), (0, 9), textcoords="offset points", color=colour)
        axes.axhline(row, color="0.9", zorder=0)
    axes.set_yticks(range(len(result.checks)), [rule["metric"] for rule in GATE["accuracy"]])
    axes.set(
        xlim=(0.8, 1.02),
        ylim=(len(result.checks) - 0.5, -0.7),
        xlabel="value with its interval; black: least value that is allowed",
    )
    axes.set_title(f"gate '{result.gate}', SIMULATED captures: {result.verdict.value.upper()}")
    figure.savefig(folder / "gate_a_change.png", dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).parent)
