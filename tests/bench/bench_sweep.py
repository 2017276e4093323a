"""A grid of threshold sets: how many times faster a sweep is than running a detector for each set.

Run through ``python tests/bench/run.py sweep``. 10 x 10 x 10 thresholds (prominence, width, score) on 10 000 simulated
frames. The others are timed on a part of the work and scaled, as the whole takes minutes: the naive script on 1 000
frames with its one set, the detector, fused as ``Pipeline.run`` makes it, on all frames with four sets.
"""

from __future__ import annotations

from dataclasses import dataclass

import frames as made
import naive
import numpy as np
from harness import Disagreement, Effort, Row, Run, at_least, at_most, interleaved, median, ratio, told

from uwbbench.api import Capture, FloatArray
from uwbbench.detect.pipeline import Pipeline, load_detector
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.tools.tune.sweep.scores import SetScores, set_scores
from uwbbench.tools.tune.sweep.sweep import Sweep, Swept

FRAMES, SCRIPT_FRAMES, DETECTOR_SETS = 10_000, 1_000, 4
CHANNEL = 9
GRID = {
    "pipeline.filter.prominence.params.minimum": [naive.MINIMUM_PROMINENCE[CHANNEL], *np.linspace(0.01, 0.4, 9)],
    "pipeline.filter.width.params.minimum": [naive.MINIMUM_WIDTH[CHANNEL], *np.linspace(0.5, 4, 9)],
    "pipeline.filter.snr.params.minimum_db": [naive.MINIMUM_SCORE_DB[CHANNEL], *np.linspace(12, 36, 9)],
}


@dataclass(frozen=True)
class Samples:
    """Seconds (rounds,) for the whole grid on all frames.

    Attributes
    ----------
    counted : array
        Sweep, peaks included, with the number of detections that each set retains.
    retained : array
        Sweep with the detection that each set retains in each frame.
    scored : array
        Sweep with the scores of each set.
    detector : array
        The detector once for each set, scaled.
    script : array
        The script once for each set, scaled.
    """

    counted: FloatArray
    retained: FloatArray
    scored: FloatArray
    detector: FloatArray
    script: FloatArray


def rows(effort: Effort) -> list[Row]:
    """All targets of this module."""
    samples = measure(effort)
    per_set = median(samples.detector / len(Sweep(load_detector("paper-filtering"), GRID)) * 1e3)
    return [
        at_least("sweep of 1 000 sets, against the naive script", 1000, ratio(samples.script, samples.counted)),
        at_least("sweep of 1 000 sets, against the fused detector", 20, ratio(samples.detector, samples.counted)),
        at_most("sweep of 1 000 sets on 10 000 frames, peaks included", 120, median(samples.counted * 1e3), "ms"),
        at_least("... with what each set retains, against the script", 1000, ratio(samples.script, samples.retained)),
        at_least("... and against the fused detector", 20, ratio(samples.detector, samples.retained)),
        told("... with the scores of each set", median(samples.scored * 1e3), "ms"),
        told("the fused detector for one set", per_set, "ms"),
    ]


def measure(effort: Effort) -> Samples:
    """Time all programs in turns."""
    capture = made.approach(effort.frames(FRAMES), channel=CHANNEL, sts=False)
    detector = load_detector("paper-filtering")
    sweep = Sweep(detector, GRID)
    part = capture.frames(0, SCRIPT_FRAMES)
    some = [sweep.detector(index) for index in np.linspace(0, len(sweep) - 1, DETECTOR_SETS).astype(int)]
    check(capture, sweep)

    def swept() -> Swept:
        return Sweep(detector, GRID).run(capture)

    def counted() -> Run:
        return lambda: swept().retained

    def retained() -> Run:
        return lambda: retained_rows(swept())

    def scored() -> Run:
        return lambda: scores(swept(), capture)

    def detected() -> Run:
        return lambda: each(some, capture)

    def scripted() -> Run:
        return lambda: naive.filtering(capture, part)

    seconds = interleaved(
        {"counted": counted, "retained": retained, "scored": scored, "detector": detected, "script": scripted},
        effort.rounds(15),
    )
    seconds["detector"] *= len(sweep) / len(some)
    seconds["script"] *= len(sweep) * len(capture) / len(part)
    return Samples(**seconds)


def retained_rows(swept: Swept) -> None:
    """Detection that each set retains in each frame, a block of sets at a time."""
    for block in np.array_split(np.arange(len(swept.sweep)), 20):
        swept.rows(block)


def scores(swept: Swept, capture: Capture) -> SetScores:
    """Scores of all sets."""
    return set_scores(swept, capture, ScoringRules())


def each(detectors: list[Pipeline], capture: Capture) -> None:
    """Run every detector."""
    for one in detectors:
        one.run(capture)


def check(capture: Capture, sweep: Sweep) -> None:
    """Refuse to time programs that do not find the same.

    Raises
    ------
    Disagreement
    """
    swept = sweep.run(capture)
    for index in np.linspace(0, len(sweep) - 1, DETECTOR_SETS).astype(int):
        own, found = sweep.detector(index).run(capture), swept.detections(index)
        if not (np.array_equal(own.frame, found.frame) and np.array_equal(own["tap"], found["tap"])):
            raise Disagreement(f"the sweep differs from the detector in set {index}")
    script = naive.filtering(capture, capture.frames())  # its thresholds are those of set 0
    first = swept.rows([0])[0]
    taps = np.where(first < 0, -1, swept.found["tap"][first])
    if not np.array_equal(taps, [-1 if found is None else found.tap for found in script]):
        raise Disagreement("the sweep differs from the naive script")
