"""Hard shapes of the response: crests on the edges of the frame, and echoes that merge."""

from __future__ import annotations

from typing import Any

import numpy as np

from uwbbench.api.case import Evidence, hard_case
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Stage
from uwbbench.measure.robustness.compare import hit_share, still_found
from uwbbench.measure.robustness.scene import ECHO, NOISE_TAPS, TAPS, altered, approach
from uwbbench.measure.robustness.subject import Subject


@hard_case("survive")
def crest_at_the_first_and_last_tap(subject: Subject) -> Evidence:
    """A sample ten times the direct path in the first or last tap yields nothing infinite.

    What lies on the edge of the frame has one neighbour only. Such a sample may hide the echo: it sets the scale, or
    counts as the noise.
    """
    shares = []
    for tap in (0, NOISE_TAPS, TAPS - 1):

        def raised(samples: np.ndarray, tap: int = tap) -> np.ndarray:
            samples[:, tap] += 10.0
            return samples

        capture = altered(subject.capture, raised)
        shares.append(f"{hit_share(subject.run_altered(capture), capture):.0%}")
    return Evidence(f"first, first searched and last tap: echo found in {', '.join(shares)} of frames")


@hard_case("survive")
def two_echoes(subject: Subject) -> Evidence:
    """A second echo 1, 2 or 3 ns behind the first hides them both in at most one frame of ten.

    In quadrature and as strong. Below the pulse width of 3.2 ns there may be one crest between them, so that an echo
    counts as found anywhere from 0.2 m before the first to 0.2 m behind the second.

    A CFAR that averages its training cells takes the second echo for noise as soon as it lies beyond the guard cells:
    that is how the method is defined, its descriptions name it as the fault that OS-CFAR was made to mend, and no
    rounding is at work. Such detectors are asked only for separations within their guard cells.
    """
    within = min(_resolves_taps(stage, subject.radar) for _, stage in subject.stages())
    observed = []
    usual = hit_share(subject.usual, subject.capture)
    for separation_ns in (1.0, 2.0, 3.0):
        late = separation_ns * 1e-9 / subject.radar.sample_interval_s
        if late > within:
            observed.append(f"{separation_ns:g} ns: not asked of averaged training cells")
            continue
        capture = approach(echoes=((0.0, ECHO), (late, 1j * ECHO)))
        detections = subject.run_altered(capture)
        assert capture.truth is not None  # noqa: S101  (the suite's captures have a truth)
        true_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[detections.frame, 0]
        span_m = 0.15 * separation_ns
        offset_m = detections.range_m - true_m
        clipped = detections.with_columns(range_m=detections.range_m - np.clip(offset_m, 0.0, span_m))
        observed.append(f"{separation_ns:g} ns: {still_found(clipped, capture, usual, 0.10)}")
    return Evidence("; ".join(observed))


def _resolves_taps(stage: Stage[Any], radar: Radar) -> float:
    """What a stage says of itself, opened where it says anything of its own: its window may be in pulses."""
    if type(stage).resolves_taps is not Stage.resolves_taps:
        stage.open(radar)
    return stage.resolves_taps
