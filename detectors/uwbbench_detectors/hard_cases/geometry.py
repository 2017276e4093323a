"""Hard angles and paths: phases at half a turn, full arcsines, and echoes that are hardly behind the direct path."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction

import numpy as np

from uwbbench.api import (
    Detections,
    Evidence,
    FloatArray,
    NotApplicable,
    StagesOnTrial,
    Violation,
    bistatic_range,
    bistatic_range_sine,
    exact_ulps,
    hard_case,
    wrap_angle,
)

TAPS = StagesOnTrial.radar.taps


FLOAT32_PI = float(np.float32(np.pi))
"""Larger than pi."""


def _phase_differences(subject: StagesOnTrial, sts1: list[complex], sts2: list[complex]) -> FloatArray:
    """Phase differences that the detector finds between pairs of samples, one frame each."""
    stage = subject.stage("pdoa", reference="none", sample="same_tap")
    if stage.params.phase == "arctan" or stage.params.wrap != "half_open":
        raise NotApplicable("the detector is set to lose quadrants, or to another interval")
    frames, tap = len(sts1), 9
    block = subject.block_of(np.ones((frames, TAPS), complex), first_path=np.zeros(frames))
    responses = np.zeros((2, frames, TAPS), complex)
    responses[0, :, tap], responses[1, :, tap] = sts1, sts2
    found = Detections(np.arange(frames), tap=np.full(frames, float(tap)))
    block = block.replace(
        frames=dataclasses.replace(block.frames, sts1=responses[0], sts2=responses[1]), detections=found
    )
    return subject.through(stage, block).detections["pdoa_rad"]


@hard_case("equal")
def phase_difference_of_pi(subject: StagesOnTrial) -> Evidence:
    """Opposite phases differ by -pi, never by +pi, on whichever side of the cut they lie; zero samples by no number.

    The angle of a conjugate product gives +pi where the modulo form gives -pi. The interval is half open.
    """
    sts1 = [1, -1, 1j, complex(-1, 0.0), complex(-1, -0.0), 1, 0]
    sts2 = [-1, 1, -1j, 1, 1, complex(-1, -0.0), 1]
    found = _phase_differences(subject, sts1, sts2)
    if not np.all(found[:-1] == -np.pi) or not np.isnan(found[-1]):
        raise Violation(f"phase differences {found.tolist()}, expected -pi throughout and nan for the zero sample")
    return Evidence("-pi in six ways", error_ulp=0.0)


@hard_case("equal")
def quadrants(subject: StagesOnTrial) -> Evidence:
    """Phase differences are right in all four quadrants, within 4 units of pi.

    A literal arctan(Q/I) loses the quadrant, and has no value on the imaginary axis.
    """
    angles = np.linspace(-3.1, 3.1, 63)
    expected = wrap_angle(angles - 0.4)
    found = _phase_differences(subject, [complex(np.exp(0.4j))] * 63, np.exp(1j * angles).tolist())
    error_ulp = float(np.max(np.abs(found - expected)) / np.spacing(np.pi))
    if not error_ulp <= 4:
        raise Violation(f"phase differences are up to {error_ulp:.3g} units of pi off")
    return Evidence("63 angles", error_ulp=error_ulp)


@hard_case("equal")
def wrapping_at_pi(subject: StagesOnTrial) -> Evidence:
    """Angles at and beside odd multiples of pi wrap into [-pi, pi), to the nearest number on the right side."""
    subject.stage("pdoa")
    edge = np.array([np.pi, -np.pi, np.nextafter(np.pi, 4), np.nextafter(-np.pi, -4), -1e-300, 3 * np.pi, FLOAT32_PI])
    wrapped = wrap_angle(edge)
    if not np.all((wrapped >= -np.pi) & (wrapped < np.pi)):
        raise Violation(f"{wrapped.tolist()} leave [-pi, pi)")
    turned = (wrapped - edge + np.pi) % (2 * np.pi) - np.pi
    error_ulp = float(np.max(np.abs(turned)) / np.spacing(np.pi))
    if not error_ulp <= 4:
        raise Violation(f"wrapping turns angles by {error_ulp:.3g} units of pi")
    return Evidence("7 angles", error_ulp=error_ulp)


@hard_case("survive")
def full_phase_in_the_arcsine(subject: StagesOnTrial) -> Evidence:
    """Phase differences of pi, a unit beyond it, and single-precision pi give an azimuth, of the right sign.

    pi rounded to single precision exceeds pi, and the arcsine of alpha / pi has no value there: its argument must be
    limited. An azimuth beyond 90 degrees is the formula's own: 94.7 degrees for the form of arXiv 2512.01018.
    """
    alpha = np.array([np.pi, np.nextafter(np.pi, 4), FLOAT32_PI, 3.2])
    alpha = np.concatenate([alpha, -alpha])
    block = subject.block_of(np.ones((8, TAPS), complex), detections=Detections(np.arange(8), pdoa_rad=alpha))
    stage = subject.stage("azimuth", bias_deg=0.0, sign=1)
    azimuth_rad = subject.through(stage, block).detections["azimuth_rad"]
    limit = math.pi / 2 / 0.95
    if not np.all(np.abs(azimuth_rad) <= np.nextafter(limit, 2)) or not np.all(np.sign(azimuth_rad) == np.sign(alpha)):
        raise Violation(f"azimuths {azimuth_rad.tolist()}")
    return Evidence(f"all within {math.degrees(np.abs(azimuth_rad).max()):.1f} degrees")


EXCESS_M = (5e-324, 1e-300, 1e-15, 1e-12, 1e-6, 0.3, 7.0, 1e6)


def _range_m(excess_m: float, distance_m: float, towards_tx: float) -> Fraction:
    """Exact range ``e (e + 2 D) / (2 (e + D (1 - cos)))`` for the cosine between target and transmitter."""
    e, d = Fraction(excess_m), Fraction(distance_m)
    return e * (e + 2 * d) / (2 * (e + d * (1 - Fraction(towards_tx))))


@hard_case("equal")
def hardly_behind_the_direct_path(subject: StagesOnTrial) -> Evidence:
    """Ranges of paths 5e-324 m to 1 000 km beyond the TX-RX distance are exact to 4 units in the last place.

    The reference is rational arithmetic. ``d^2 - D^2`` would lose 6e-5 of the range at an excess of 1e-12 m, and all
    of it below 1e-16 m.
    """
    subject.stage("range")
    excess_m = np.array(EXCESS_M)
    ahead = np.tile([1.0, 0.0, 0.0], (len(excess_m), 1))
    worst = 0.0
    for transmitter, cosine in (((0.0, -0.25, 0.0), 0.0), ((-0.25, 0.0, 0.0), -1.0)):
        exact = [_range_m(e, 0.25, cosine) for e in EXCESS_M]
        worst = max(worst, exact_ulps(bistatic_range(excess_m, ahead, np.array(transmitter)), exact))
    exact = [_range_m(e, 0.25, 0.0) for e in EXCESS_M]
    worst = max(worst, exact_ulps(bistatic_range_sine(excess_m, np.zeros(len(excess_m)), 0.25), exact))
    if not worst <= 4:
        raise Violation(f"ranges are up to {worst:.3g} units off")
    return Evidence(f"excess paths from {EXCESS_M[0]:g} to {EXCESS_M[-1]:g} m", error_ulp=worst)


@hard_case("equal")
def path_as_long_as_the_baseline(subject: StagesOnTrial) -> Evidence:
    """A path equal to the TX-RX distance has range 0, one a unit longer a range above 0, one shorter no range.

    No target can cause a shorter path; a range of it would be an invention.
    """
    if not getattr(subject.stage("range").params, "includes_baseline", True):
        raise NotApplicable("the detector counts its paths without the baseline")
    stage = subject.stage("range", bias_m=0.0)
    first = 7.3
    taps = np.array([first, np.nextafter(first, 8), np.nextafter(first, 7), first - 1])
    block = subject.block_of(np.ones((1, TAPS), complex), first_path=np.array([first]))
    block = block.replace(detections=Detections(np.zeros(4, int), tap=taps))
    equal, longer, shorter, much_shorter = subject.through(stage, block).detections.range_m.tolist()
    if not (equal == 0.0 and longer > 0.0 and math.isnan(shorter) and math.isnan(much_shorter)):
        raise Violation(f"ranges {equal}, {longer}, {shorter}, {much_shorter}; expected 0, above 0, nan, nan")
    return Evidence(f"0, {longer:.2g} m, none, none", error_m=0.0)


@hard_case("survive")
def range_without_a_baseline(subject: StagesOnTrial) -> Evidence:
    """With transmitter and receiver in one place the range is half the path, within 2 units, and 0 for no path."""
    radar = dataclasses.replace(StagesOnTrial.radar, tx_position_m=(0.0, 0.0, 0.0))
    plainly = {"bias_m": 0.0, "speed_of_light": "exact", "includes_baseline": True}
    known = type(subject.stage("range").params).model_fields
    stage = subject.stage("range", radar, **{name: value for name, value in plainly.items() if name in known})
    taps = np.array([0.0, 1e-12, 1.0, 40.0])
    block = subject.block_of(np.ones((1, TAPS), complex), first_path=np.zeros(1))
    block = block.replace(detections=Detections(np.zeros(4, int), tap=taps))
    found = subject.through(stage, block).detections
    half_m = found["delay_s"] * 299_792_458.0 / 2
    error_ulp = float(np.max(np.abs(found.range_m - half_m) / np.spacing(half_m)))
    if not error_ulp <= 2:
        raise Violation(f"ranges {found.range_m.tolist()}, expected {half_m.tolist()}")
    return Evidence("half the path", error_ulp=error_ulp)
