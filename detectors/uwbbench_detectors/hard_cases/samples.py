"""Hard samples: noise whose square vanishes."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import Evidence, StagesOnTrial, Violation, hard_case


@hard_case("equal")
def vanishing_noise(subject: StagesOnTrial) -> Evidence:
    """Noise of amplitude 5e-23 in single precision, whose square is zero there, is measured to 4 units.

    All samples are equal, so that their root mean square is the magnitude of one of them, and so is their median,
    which counts for 1 / sqrt(ln 2) of it. In single precision the squares vanish, the noise would be zero and every
    score infinite.
    """
    stage = subject.stage("noise_floor")
    quiet = np.complex64(3e-23 + 4e-23j)
    expected = math.hypot(float(quiet.real), float(quiet.imag))
    if stage.params.method == "median":
        expected /= math.sqrt(math.log(2))
    level = float(
        subject.through(stage, subject.block_of(np.full((1, subject.radar.taps), quiet))).part("noise_rms")[0]
    )
    error_ulp = abs(level - expected) / math.ulp(expected)
    if not error_ulp <= 4:
        raise Violation(f"noise of {level:.3g}, expected {expected:.3g}")
    return Evidence(f"noise of {level:.3g}", error_ulp=error_ulp)
