"""Hard segments: windows beside a direct path that drowns sums, frames without noise, samples tiny and huge."""

from __future__ import annotations

import numpy as np

from uwbbench.api import ComplexArray, Detections, Evidence, StagesOnTrial, Violation, hard_case

TAPS = StagesOnTrial.radar.taps
CREST, ECHO = 7, 24


def _noise_with_echo() -> ComplexArray:
    rng = np.random.default_rng(29)
    noise: ComplexArray = (rng.normal(size=(40, TAPS)) + 1j * rng.normal(size=(40, TAPS))) / np.sqrt(2)
    noise[:, ECHO] += 100.0
    return noise


def _segments(subject: StagesOnTrial, samples: ComplexArray) -> Detections:
    block = subject.block_of(samples, first_path=np.full(len(samples), float(CREST)))
    return subject.through(subject.stage("segment.entropy"), block).detections


def _same(found: Detections, expected: Detections) -> float:
    """Largest difference of scores in dB, of segments at the same taps."""
    for name in ("frame", "tap", "start_tap", "stop_tap"):
        if not np.array_equal(found[name], expected[name]):
            raise Violation(f"{len(found)} segments, expected {len(expected)}; their '{name}' differ")
    if not len(expected):
        raise Violation("no segment where an echo of 40 dB stands")
    error_db = float(np.max(np.abs(found["score_db"] - expected["score_db"])))
    if not error_db <= 1e-9:
        raise Violation(f"scores differ by {error_db:.2g} dB")
    return error_db


@hard_case("equal")
def segments_behind_a_direct_path_240_db_above_the_floor(subject: StagesOnTrial) -> Evidence:
    """Segments whose windows do not reach a direct path 120 or 240 dB above the noise are as if it were not there.

    Scores agree within 1e-9 dB. A running sum over the windows would keep none of the noise's digits.
    """
    noise = _noise_with_echo()
    quiet = _beyond(_segments(subject, noise))
    errors = []
    for level_db in (120.0, 240.0):
        loud = noise.copy()
        loud[:, CREST] = 10 ** (level_db / 20)
        errors.append(_same(_beyond(_segments(subject, loud)), quiet))
    return Evidence(f"scores within {max(errors):.1g} dB")


def _beyond(found: Detections) -> Detections:
    return found.take(found["start_tap"] > CREST + (ECHO - CREST) / 2)


@hard_case("equal")
def segments_of_tiny_and_huge_samples(subject: StagesOnTrial) -> Evidence:
    """Samples of 1e-150 and 1e150 have the segments that samples of 1 have: no square under- or overflows."""
    samples = _noise_with_echo()
    usual = _segments(subject, samples)
    errors = [_same(_segments(subject, samples * factor), usual) for factor in (1e-150, 1e150)]
    return Evidence(f"scores within {max(errors):.1g} dB")


@hard_case("reject")
def segments_of_a_frame_without_noise(subject: StagesOnTrial) -> Evidence:
    """A frame whose samples are all equal, or zero but for one, has no noise, no threshold and no segment."""
    frames = np.full((2, TAPS), 0.7, complex)
    frames[1] = 0
    frames[1, ECHO] = 1
    found = _segments(subject, frames)
    if len(found):
        raise Violation(f"{len(found)} segments")
    return Evidence("nothing found")
