"""Hard frames for what has learned: echoes and silence unlike any of training, and no direct path to count from."""

from __future__ import annotations

import numpy as np

from uwbbench.api import Block, ComplexArray, Detections, Evidence, StagesOnTrial, Violation, hard_case

TAPS = StagesOnTrial.radar.taps
CREST = 7


def _judged(subject: StagesOnTrial, samples: ComplexArray) -> Detections:
    """Rows of the detector's classifier, with the features that it asks for."""
    stage = subject.stage("classify")
    block: Block = subject.block_of(samples, first_path=np.full(len(samples), float(CREST)))
    if "features" in stage.consumes:
        block = subject.through(subject.stage("wavelet"), block)
    return subject.through(stage, block).detections


@hard_case("survive")
def frames_unlike_any_of_training(subject: StagesOnTrial) -> Evidence:
    """Silence behind the direct path, a constant, and echoes 60 to 400 dB above the direct path are judged soundly.

    Every probability lies between 0 and 1, and those of the classes sum to 1 within 1e-6. A score that runs over in
    single precision, or an exponential of it, would give NaN.
    """
    frames = np.zeros((6, TAPS), complex)
    frames[:, CREST] = 1
    frames[1] = 1
    for row, level_db in enumerate((60.0, 120.0, 240.0, 400.0), 2):
        frames[row, CREST + 9] = 10 ** (level_db / 20)
    found = _judged(subject, frames)
    columns = {name: found[name] for name in found.columns if "probability" in name}
    for name, values in columns.items():
        if not ((values >= 0) & (values <= 1)).all():
            raise Violation(f"'{name}' of {values[~((values >= 0) & (values <= 1))][0]:g}")
    classes = [values for name, values in columns.items() if name.startswith("class_probability_")]
    if classes:
        error = float(np.max(np.abs(np.sum(classes, axis=0) - 1), initial=0.0))
        if not error <= 1e-6:
            raise Violation(f"probabilities of the classes miss 1 by {error:.2g}")
    return Evidence(f"{len(found)} rows with {len(columns)} probabilities")


@hard_case("reject")
def frames_without_a_direct_path_to_count_from(subject: StagesOnTrial) -> Evidence:
    """A frame that is zero at its direct path, or nowhere finite, has no features and no row."""
    frames = np.zeros((3, TAPS), complex)
    frames[1, CREST + 9] = 1
    frames[2] = np.nan
    found = _judged(subject, frames)
    if len(found):
        raise Violation(f"{len(found)} rows")
    return Evidence("no row")
