"""Hard shapes of the response: flat tops, edges of the frame, and widths far down a long block."""

from __future__ import annotations

import numpy as np

from uwbbench.api import Detections, Evidence, FloatArray, StagesOnTrial, Violation, hard_case

TAPS = StagesOnTrial.radar.taps


def _profiled(subject: StagesOnTrial, profile: FloatArray) -> dict[str, FloatArray]:
    """Columns of the peaks of profiles (frames, taps), the profile being the whole frame."""
    block = subject.through(subject.stage("peaks"), subject.block_of(profile.astype(complex), profile=profile))
    return {name: block.detections[name] for name in ("frame", "tap", "prominence", "width_taps")}


@hard_case("equal")
def plateaus(subject: StagesOnTrial) -> Evidence:
    """A flat top is one peak, at its middle rounded down; a shoulder and a flat valley are none.

    The reference is the definition, written out for one profile.
    """
    flat = np.array([[0, 1, 2, 2, 2, 1, 0, 3, 3, 0, 1, 1, 2, 1, 1, 0, 4, 4, 4, 4, 0]], float)
    found = _profiled(subject, flat)
    _same("taps", found["tap"], [3, 7, 12, 17])
    _same("prominences", found["prominence"], [2, 3, 2, 4])
    return Evidence("4 peaks where the definition has them", error_ulp=0.0)


@hard_case("equal")
def edges_of_the_frame(subject: StagesOnTrial) -> Evidence:
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


@hard_case("equal")
def widths_in_long_blocks(subject: StagesOnTrial) -> Evidence:
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


@hard_case("equal")
def interpolation_at_the_edges(subject: StagesOnTrial) -> Evidence:
    """Interpolation leaves detections on the first and last tap where they are, and flat tops in their middle."""
    rows = np.array([[9.0, 1, 0, 3, 3, 3, 0, 1, 9]])
    taps = np.array([0.0, 4.0, 8.0])
    block = subject.block_of(rows.astype(complex), detections=Detections(np.zeros(3, int), tap=taps))
    moved = subject.through(subject.stage("interpolate"), block).detections["tap"]
    _same("taps", moved, taps.tolist())
    return Evidence("taps 0, 4 and 8 stay", error_ulp=0.0)
