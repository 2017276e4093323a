"""Hard samples: nothing, too much, too little, not a number, and other number formats."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction

import numpy as np

from uwbbench.api.arrays import ComplexArray
from uwbbench.api.capture import Capture
from uwbbench.api.case import Evidence, NotApplicable, Violation, hard_case
from uwbbench.api.detections import Detections
from uwbbench.api.frames import magnitude
from uwbbench.api.trial import exact_ulps
from uwbbench.measure.robustness.compare import flipped_share, hit_share, in_frames, still_found, unchanged
from uwbbench.measure.robustness.scene import FRAMES, NOISE, NOISE_TAPS, altered, approach, chosen
from uwbbench.measure.robustness.subject import Subject

DAMAGED = np.array([0, 41, 97, 98, 99, 100, 101, FRAMES - 1])
"""The first frame, one alone, a run, and the last one."""
INTACT = np.setdiff1d(np.arange(FRAMES), DAMAGED)
EXACT_M = 1e-9


def _damaged(capture: Capture, value: complex) -> Capture:
    """Capture whose damaged frames hold one value throughout."""

    def damage(samples: ComplexArray) -> ComplexArray:
        samples[DAMAGED] = value
        return samples

    return altered(capture, damage)


def _nothing_there(detections: Detections) -> None:
    if np.isin(detections.frame, DAMAGED).any():
        raise Violation(f"{np.isin(detections.frame, DAMAGED).sum()} detections in frames that hold no echo")


def _nothing_but(subject: Subject, detections: Detections) -> Evidence:
    """The damaged frames yield nothing, and the intact ones what they yield on their own."""
    _nothing_there(detections)
    for name, stage in subject.stages():
        if stage.every_nth:
            raise NotApplicable(f"{name} works on every n-th frame of the capture, which are others without these")
    return unchanged(in_frames(detections, INTACT), subject.run(chosen(subject.capture, INTACT)), EXACT_M)


@hard_case("reject")
def zero_frames(subject: Subject) -> Evidence:
    """All-zero frames, alone and in a run, yield nothing; the others yield what they do without them.

    A frame of zeros is what a transceiver hands out when reception failed. Nothing may be divided by its maximum, and
    it may not enter a background.
    """
    return _nothing_but(subject, subject.run_altered(_damaged(subject.capture, 0.0)))


@hard_case("reject")
def zero_capture(subject: Subject) -> Evidence:
    """A capture of zeros alone yields nothing."""
    return _nothing(subject, 0.0)


@hard_case("reject")
def constant_frames(subject: Subject) -> Evidence:
    """Frames of one constant, alone and in a run, yield nothing; of other detections one in twenty may come or go.

    Min-max scaling of a constant is 0/0, and its direct path stands 0 dB above its noise. Unlike a frame of zeros it
    may count as a measurement: a running median of the noise takes it in, and a decision near a limit then changes.
    """
    detections = subject.run_altered(_damaged(subject.capture, 0.3 - 0.2j))
    _nothing_there(detections)
    return _hardly_flipped(in_frames(detections, INTACT), subject.run(chosen(subject.capture, INTACT)), 0.05)


@hard_case("reject")
def constant_capture(subject: Subject) -> Evidence:
    """A capture of one constant alone yields nothing."""
    return _nothing(subject, 0.3 - 0.2j)


def _nothing(subject: Subject, value: complex) -> Evidence:
    detections = subject.run_altered(altered(subject.capture, lambda samples: np.full_like(samples, value)))
    if len(detections):
        raise Violation(f"{len(detections)} detections where nothing is")
    return Evidence("no detections")


@hard_case("reject")
def rippled_constant_frames(subject: Subject) -> Evidence:
    """Constant frames with a ripple of one unit in the last place yield nothing.

    Scaled to the span from 0 to 1 the ripple would be a full-scale peak.
    """

    def rippled(samples: ComplexArray) -> ComplexArray:
        samples[:] = 0.3
        samples[:, 9::5] = np.nextafter(0.3, 1)
        return samples

    detections = subject.run_altered(altered(subject.capture, rippled))
    if len(detections):
        raise Violation(f"{len(detections)} detections of rounding errors")
    return Evidence("no detections")


@hard_case("survive")
def zero_noise_taps(subject: Subject) -> Evidence:
    """Leading taps that are exactly zero make no score infinite and nothing not a number.

    A ratio to no noise measures nothing. A detector that needs the ratio may drop the detection; one that takes its
    noise elsewhere goes on.
    """

    def silenced(samples: ComplexArray) -> ComplexArray:
        samples[:, :NOISE_TAPS] = 0
        return samples

    capture = altered(subject.capture, silenced, receiver=True)
    detections = subject.run_altered(capture)
    return Evidence(f"{len(detections)} detections, echo found in {hit_share(detections, capture):.0%} of frames")


@hard_case("survive")
def dc_offset(subject: Subject) -> Evidence:
    """With an offset of half the noise on every sample the echo is found as often, within a tenth of the frames."""
    capture = altered(subject.capture, lambda samples: samples + NOISE / 2 * (1 + 1j) / np.sqrt(2), receiver=True)
    detections = subject.run_altered(capture)
    return Evidence(still_found(detections, capture, hit_share(subject.usual, subject.capture), 0.10))


def _clipped(samples: ComplexArray, limit: float) -> ComplexArray:
    return np.asarray(np.clip(samples.real, -limit, limit) + 1j * np.clip(samples.imag, -limit, limit))


@hard_case("survive")
def clipped_samples(subject: Subject) -> Evidence:
    """With I and Q clipped at the height of the direct path the echo is found in all but a tenth of the usual frames.

    The limit of 0.9 cuts the crests of the frames whose phase puts them on one axis, and makes plateaus of them.
    """
    capture = altered(subject.capture, lambda samples: _clipped(samples, 0.9), receiver=True)
    detections = subject.run_altered(capture)
    return Evidence(still_found(detections, capture, hit_share(subject.usual, subject.capture), 0.10))


@hard_case("survive")
def hard_clipped_samples(subject: Subject) -> Evidence:
    """Samples clipped to three tenths of the direct path yield no infinity and no value that is not a number.

    So far into saturation the direct path is a plateau of no known delay, phase or gain, and finding the echo is not
    asked for.
    """
    capture = altered(subject.capture, lambda samples: _clipped(samples, 0.3), receiver=True)
    detections = subject.run_altered(capture)
    return Evidence(f"{len(detections)} detections, echo found in {hit_share(detections, capture):.0%} of frames")


@hard_case("reject")
def nan_samples(subject: Subject) -> Evidence:
    """Frames with one sample that is not a number yield nothing; the others yield what they do without them."""
    return _single_sample(subject, np.nan)


@hard_case("reject")
def infinite_samples(subject: Subject) -> Evidence:
    """Frames with one infinite sample yield nothing; the others yield what they do without them."""
    return _single_sample(subject, np.inf)


def _single_sample(subject: Subject, value: float) -> Evidence:
    preamble = np.array(subject.capture.preamble)
    preamble[DAMAGED, 3 + 5 * np.arange(len(DAMAGED))] = value
    return _nothing_but(subject, subject.run(dataclasses.replace(subject.capture, preamble=preamble)))


@hard_case("reject")
def nan_frames(subject: Subject) -> Evidence:
    """Frames that are not a number throughout, in all responses, yield nothing and leave no trace."""
    return _nothing_but(subject, subject.run(_damaged(subject.capture, complex(np.nan, -np.inf))))


@hard_case("reject")
def nan_capture(subject: Subject) -> Evidence:
    """A capture without one valid frame yields nothing, and processes nothing."""
    detections = subject.run(altered(subject.capture, lambda samples: np.full_like(samples, np.nan)))
    if len(detections) or len(detections.processed):
        raise Violation(f"{len(detections)} detections, {len(detections.processed)} frames processed")
    return Evidence("no detections, no frames processed")


@hard_case("survive")
def denormal_capture(subject: Subject) -> Evidence:
    """A capture at 1e-310, below the least normal number, yields no infinity and no value that is not a number.

    Samples hold a few digits there, so that nothing is asked of what is found.
    """
    detections = subject.run_altered(altered(subject.capture, lambda samples: samples * 1e-310, receiver=True))
    return Evidence(f"{len(detections)} detections")


@hard_case("survive")
def denormal_noise(subject: Subject) -> Evidence:
    """Leading taps at the least number there is yield no infinite score, and nothing that is not a number."""

    def quieted(samples: ComplexArray) -> ComplexArray:
        samples[:, :NOISE_TAPS] = 5e-324
        return samples

    detections = subject.run_altered(altered(subject.capture, quieted, receiver=True))
    return Evidence(f"{len(detections)} detections")


@hard_case("equal")
def denormals_kept(subject: Subject) -> Evidence:
    """After a run the process still computes with denormals: half of the least normal number is not zero.

    Code compiled with fast-math flushes them for the whole process, and breaks comparisons with NaN.
    """
    subject.run(subject.capture)
    half = np.array([np.finfo(float).tiny]) / 2
    if not half[0] > 0 or np.array([np.nan])[0] == np.nan:
        raise Violation("denormals are flushed to zero: something in this process was compiled with fast-math")
    return Evidence("denormals are numbers")


def _scaled(subject: Subject, factor: float) -> Evidence:
    detections = subject.run_altered(altered(subject.capture, lambda samples: samples * factor, receiver=True))
    return unchanged(detections, subject.usual, EXACT_M)


@hard_case("equal")
def amplitudes_times_1e_minus_150(subject: Subject) -> Evidence:
    """Samples times 1e-150 yield the same detections, within 1 nm: no power may underflow."""
    return _scaled(subject, 1e-150)


@hard_case("equal")
def amplitudes_times_1e150(subject: Subject) -> Evidence:
    """Samples times 1e150 yield the same detections, within 1 nm: no power may overflow."""
    return _scaled(subject, 1e150)


def _hardly_flipped(detections: Detections, expected: Detections, limit: float) -> Evidence:
    share = flipped_share(detections, expected)
    observed = f"{share:.2%} of the detections come or go"
    if share > limit:
        raise Violation(observed, flips=share)
    return Evidence(observed, flips=share)


@hard_case("equal")
def int16_range(subject: Subject) -> Evidence:
    """I/Q rounded to the range of 16-bit integers yields the same detections but for one in fifty."""

    def rounded(samples: ComplexArray) -> ComplexArray:
        steps = samples * (32767 / 1.5)
        return _clipped(np.rint(steps.real) + 1j * np.rint(steps.imag), 32767.0)

    return _hardly_flipped(subject.run_altered(altered(subject.capture, rounded, receiver=True)), subject.usual, 0.02)


def _stored(samples: ComplexArray) -> ComplexArray:
    return np.asarray(samples, np.complex64)


@hard_case("equal")
def single_precision(subject: Subject) -> Evidence:
    """Samples stored as complex64 yield the same detections as complex128, but for one in a hundred."""
    return _hardly_flipped(subject.run_altered(altered(subject.capture, _stored, receiver=True)), subject.usual, 0.01)


@hard_case("equal")
def one_ulp_noise(subject: Subject) -> Evidence:
    """Moving every stored number to one of its neighbours changes at most one detection in a hundred.

    Up or down at random, from a fixed seed, by one unit in the last place of complex64.
    """
    rng = np.random.default_rng(7)

    def moved(samples: ComplexArray) -> ComplexArray:
        parts = _stored(samples).view(np.float32)
        towards = rng.choice(np.array([-np.inf, np.inf], np.float32), parts.shape)
        return np.asarray(np.nextafter(parts, towards).view(np.complex64))

    stored = subject.run_altered(altered(subject.capture, _stored, receiver=True))
    return _hardly_flipped(subject.run(altered(subject.capture, moved, receiver=True)), stored, 0.01)


@hard_case("equal")
def magnitudes_of_integers(subject: Subject) -> Evidence:  # noqa: ARG001  (all detectors share the magnitude)
    """Magnitudes of integer I/Q pairs are those of exact arithmetic within half a unit, and equal for equal powers.

    The C library's hypot, behind ``np.abs``, gives unequal magnitudes for about a quarter of such pairs, so that
    plateaus come and go. Every detector takes its magnitudes from one function of the framework, which is what runs.
    """
    real, imaginary = np.meshgrid(np.arange(1, 160), np.arange(1, 160))
    pairs = (real + 1j * imaginary).astype(np.complex64).ravel()
    magnitudes = magnitude(pairs)
    power = (real * real + imaginary * imaginary).ravel()
    order = np.argsort(power, kind="stable")
    equal = np.diff(power[order]) == 0
    if np.any(np.diff(magnitudes[order])[equal] != 0):
        raise Violation("pairs of equal power have unequal magnitudes")
    squared = exact_ulps(magnitudes[:500], [_root(int(value)) for value in power[:500]])
    if squared > 0.5:
        raise Violation(f"magnitudes are {squared:.2g} units off")
    return Evidence(f"{int(equal.sum())} pairs of equal power; magnitudes within {squared:.2g} units")


def _root(value: int) -> Fraction:
    """Square root to 30 digits, by integer arithmetic."""
    return Fraction(math.isqrt(value * 10**60), 10**30)


@hard_case("survive")
def direct_path_thousandfold(subject: Subject) -> Evidence:
    """A direct path 60 dB above its usual height yields nothing infinite; the echo may be lost beside it.

    Min-max scaling ties every threshold to the direct path: at 1 000 times the target a prominence of 0.05 of the
    direct path hides the target, as the prominence filter's description says. And no detector can remove a direct
    path better than noise lets it be known.
    """
    capture = approach(direct=1000.0)
    detections = subject.run_altered(capture)
    return Evidence(f"{len(detections)} detections, echo found in {hit_share(detections, capture):.0%} of frames")
