"""Hard shapes of the response: flat tops, edges of the frame, echoes that merge, and widths far down a long block."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.detections import Detections
from uwbbench.measure.robustness.case import Evidence, Violation, case
from uwbbench.measure.robustness.compare import hit_share, still_found
from uwbbench.measure.robustness.scene import ECHO, NOISE_TAPS, RADAR, TAPS, altered, approach
from uwbbench.measure.robustness.subject import Subject, block_of, through


def _profiled(subject: Subject, profile: FloatArray) -> dict[str, FloatArray]:
    """Columns of the peaks of profiles (frames, taps), the profile being the whole frame."""
    block = through(subject.stage("peaks"), block_of(profile.astype(complex), profile=profile))
    return {name: block.detections[name] for name in ("frame", "tap", "prominence", "width_taps")}


@case("equal")
def plateaus(subject: Subject) -> Evidence:
    """A flat top is one peak, at its middle rounded down; a shoulder and a flat valley are none.

    The reference is the definition, written out for one profile.
    """
    flat = np.array([[0, 1, 2, 2, 2, 1, 0, 3, 3, 0, 1, 1, 2, 1, 1, 0, 4, 4, 4, 4, 0]], float)
    found = _profiled(subject, flat)
    _same("taps", found["tap"], [3, 7, 12, 17])
    _same("prominences", found["prominence"], [2, 3, 2, 4])
    return Evidence("4 peaks where the definition has them", error_ulp=0.0)


@case("equal")
def edges_of_the_frame(subject: Subject) -> Evidence:
    """The first and last tap, and flat tops that reach them, are no peaks; the taps beside them may be."""
    edges = np.array(
        [[5, 1, 0, 0, 0, 0, 1, 5], [5, 5, 1, 0, 0, 1, 5, 5], [0, 5, 0, 0, 0, 0, 5, 0], [0, 1, 2, 3, 4, 5, 6, 7]], float
    )
    found = _profiled(subject, edges)
    _same("frames", found["frame"], [2, 2])
    _same("taps", found["tap"], [1, 6])
    return Evidence("peaks beside the edges found, none on them", error_ulp=0.0)


def _same(what: str, found: FloatArray, expected: list[float]) -> None:
    if not np.array_equal(found, expected):
        raise Violation(f"{what} {found.tolist()}, expected {expected}")


@case("equal")
def widths_in_long_blocks(subject: Subject) -> Evidence:
    """A frame's peaks have the same widths and prominences, to the last bit, alone and as frame 20 000 of a block.

    Crossings counted from the start of a long concatenation lose digits as it grows: 7e-9 taps at a million frames.
    """
    rng = np.random.default_rng(3)
    frame = rng.uniform(0.1, 1.0, TAPS)
    alone = _profiled(subject, frame[None])
    block = np.zeros((20_001, TAPS))
    block[-1] = frame
    last = _profiled(subject, block)
    for name in ("tap", "prominence", "width_taps"):
        if not np.array_equal(alone[name], last[name]):
            error = float(np.max(np.abs(alone[name] - last[name])))
            raise Violation(f"{name} differs by {error:.2g} from that of the frame alone")
    return Evidence(f"{len(alone['tap'])} peaks, bit for bit the same", error_ulp=0.0)


@case("survive")
def crest_at_the_first_and_last_tap(subject: Subject) -> Evidence:
    """A sample ten times the direct path in the first or last tap yields nothing infinite.

    What lies on the edge of the frame has one neighbour only. Such a sample may hide the echo: it sets the scale, or
    counts as the noise.
    """
    found = []
    for tap in (0, NOISE_TAPS, TAPS - 1):

        def raised(samples: np.ndarray, tap: int = tap) -> np.ndarray:
            samples[:, tap] += 10.0
            return samples

        capture = altered(subject.capture, raised)
        found.append(f"{hit_share(subject.run_altered(capture), capture):.0%}")
    return Evidence(f"first, first searched and last tap: echo found in {', '.join(found)} of frames")


@case("equal")
def interpolation_at_the_edges(subject: Subject) -> Evidence:
    """Interpolation leaves detections on the first and last tap where they are, and flat tops in their middle."""
    rows = np.array([[9.0, 1, 0, 3, 3, 3, 0, 1, 9]])
    taps = np.array([0.0, 4.0, 8.0])
    block = block_of(rows.astype(complex), detections=Detections(np.zeros(3, int), tap=taps))
    moved = through(subject.stage("interpolate"), block).detections["tap"]
    _same("taps", moved, taps.tolist())
    return Evidence("taps 0, 4 and 8 stay", error_ulp=0.0)


@case("survive")
def two_echoes(subject: Subject) -> Evidence:
    """A second echo 1, 2 or 3 ns behind the first hides them both in at most one frame of ten.

    In quadrature and as strong. Below the pulse width of 3.2 ns there may be one crest between them, so that an echo
    counts as found anywhere from 0.2 m before the first to 0.2 m behind the second.

    A CFAR that averages its training cells (``ca``, ``go``) takes the second echo for noise as soon as it lies beyond
    the guard cells: that is how the method is defined, its descriptions name it as the fault that OS-CFAR was made to
    mend, and no rounding is at work. Such detectors are asked only for separations within their guard cells.
    """
    averaging = [name for name in ("cfar.ca", "cfar.go") if subject.uses(name)]
    within = min((subject.stage(name).params.guard_taps for name in averaging), default=math.inf)
    told = []
    usual = hit_share(subject.usual, subject.capture)
    for separation_ns in (1.0, 2.0, 3.0):
        late = separation_ns * 1e-9 / RADAR.sample_interval_s
        if late > within:
            told.append(f"{separation_ns:g} ns: not asked of averaged training cells")
            continue
        capture = approach(echoes=((0.0, ECHO), (late, 1j * ECHO)))
        found = subject.run_altered(capture)
        assert capture.truth is not None  # noqa: S101  (the suite's captures have a truth)
        true_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[found.frame, 0]
        span_m = 0.15 * separation_ns
        offset_m = found.range_m - true_m
        clipped = found.with_columns(range_m=found.range_m - np.clip(offset_m, 0.0, span_m))
        told.append(f"{separation_ns:g} ns: {still_found(clipped, capture, usual, 0.10)}")
    return Evidence("; ".join(told))
