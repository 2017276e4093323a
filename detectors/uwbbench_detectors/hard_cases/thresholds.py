"""Hard thresholds: values exactly on a limit, and a direct path that drowns every sum it enters."""

from __future__ import annotations

import math

import numpy as np

from uwbbench.api import Detections, Evidence, FloatArray, NotApplicable, StagesOnTrial, Violation, hard_case

TAPS = StagesOnTrial.radar.taps


def _least_detected(subject: StagesOnTrial, noise: float) -> tuple[float, float]:
    """Smallest amplitude of one cell that is detected over noise of equal cells, by bisection; and its score."""
    tap = TAPS // 2

    def score_db(amplitude: float) -> float | None:
        frame = np.full((1, TAPS), noise, complex)
        frame[0, tap] = amplitude
        found = subject.through(subject.stage("cfar", cells="all"), subject.block_of(frame)).detections
        hits = found["tap"] == tap
        return float(found["score_db"][hits][0]) if hits.any() else None

    low, high = noise, noise * 1e6
    if score_db(low) is not None or score_db(high) is None:
        raise Violation("noise is detected, or a cell 120 dB above it is not")
    while np.nextafter(low, high) < high:
        middle = math.sqrt(low) * math.sqrt(high) if high > 2 * low else low + (high - low) / 2
        low, high = (low, middle) if score_db(middle) is not None else (middle, high)
    at = score_db(high)
    assert at is not None  # noqa: S101  (high is detected all along)
    around = [high]
    for _ in range(4):
        around.append(float(np.nextafter(around[-1], np.inf)))
    if any(score_db(amplitude) is None for amplitude in around):
        raise Violation("a cell just above the threshold is detected, and a larger one is not")
    return high, at


@hard_case("equal")
def noise_on_the_cfar_threshold(subject: StagesOnTrial) -> Evidence:
    """The decision of a CFAR changes once, between two neighbouring numbers, at the same score for noise of any size.

    The threshold is found by bisection to the last place, over noise of amplitude 1 and 1e-9; the score there, cell
    over noise, is the factor of the false-alarm rate and may not depend on the size, within 1e-12 dB.
    """
    _, one = _least_detected(subject, 1.0)
    _, other = _least_detected(subject, 1e-9)
    if not abs(one - other) <= 1e-12:
        raise Violation(f"threshold at {one} dB over noise of 1, at {other} dB over noise of 1e-9")
    return Evidence(f"threshold at {one:.3f} dB", error_ulp=abs(one - other) / float(np.spacing(one)))


@hard_case("reject")
def noise_level_everywhere(subject: StagesOnTrial) -> Evidence:
    """A frame whose cells all have one power holds nothing over the threshold of a CFAR, whatever their phases."""
    frame = 0.7 * np.exp(1j * np.pi / 2 * np.arange(TAPS))[None]
    found = subject.through(subject.stage("cfar"), subject.block_of(frame)).detections
    if len(found):
        raise Violation(f"{len(found)} cells over the threshold")
    return Evidence("nothing detected")


_LIMITS = (
    ("filter.prominence", "prominence", "minimum", 1),
    ("filter.width", "width_taps", "minimum", 1),
    ("filter.snr", "score_db", "minimum_db", 1),
    ("filter.pdoa", "pdoa_rad", "maximum_rad", -1),
)


@hard_case("equal")
def values_on_a_filter_limit(subject: StagesOnTrial) -> Evidence:
    """A value on a filter's limit is kept, its neighbour beyond is dropped, and what is not a number is dropped.

    ``if value < limit: reject`` would let pass what is not a number.
    """
    told = []
    for name, column, limit, inside in _LIMITS:
        if not subject.uses(name):
            continue
        stage = subject.stage(name)
        value = float(getattr(stage.params, limit))
        values = [value, np.nextafter(value, -inside * np.inf), np.nan]
        kept = _kept(subject, name, column, values)
        if kept != [True, False, False]:
            raise Violation(f"{name}: at the limit, beyond it and nan: kept {kept}")
        told.append(name)
    if not told:
        raise NotApplicable("the detector has none of these filters")
    return Evidence(", ".join(told), error_ulp=0.0)


def _kept(subject: StagesOnTrial, name: str, column: str, values: list[float]) -> list[bool]:
    places = Detections(np.zeros(len(values), int), tap=np.arange(len(values)))
    found = places.with_columns(**{column: np.array(values)})
    block = subject.block_of(np.ones((1, TAPS), complex), detections=found)
    left = subject.through(subject.stage(name), block).detections["tap"]
    return [bool(np.isin(place, left)) for place in range(len(values))]


@hard_case("reject")
def score_against_no_noise(subject: StagesOnTrial) -> Evidence:
    """Over a noise floor of zero nothing has a score, and the filter on scores keeps nothing.

    The ratio is infinite for the weakest ripple, and 0/0 for none.
    """
    values = Detections(np.zeros(3, int), tap=np.arange(3.0), amplitude=np.array([0.0, 1e-300, 1.0]))
    block = subject.block_of(
        np.ones((1, TAPS), complex), first_path=np.zeros(1), noise_rms=np.zeros(1), detections=values
    )
    scored = subject.through(subject.stage("score.snr", amplitude="raw"), block)
    left = subject.through(subject.stage("filter.snr"), scored).detections
    if len(left):
        raise Violation(f"{len(left)} of 3 detections kept, with scores {left['score_db'].tolist()}")
    return Evidence("3 detections dropped")


DROWNING_DB = (120.0, 240.0)


@hard_case("equal")
def direct_path_120_db_above_the_floor(subject: StagesOnTrial) -> Evidence:
    """Cells whose training cells do not reach a direct path 120 dB above the noise are judged as if it were not there.

    Taps and scores must be equal to the last bit, at 240 dB too. Running or prefix sums add the direct path in and take
    it away again, which leaves none of the noise's digits: a relative error of 1.
    """
    rng = np.random.default_rng(19)
    noise = (rng.normal(size=(40, TAPS)) + 1j * rng.normal(size=(40, TAPS))) / np.sqrt(2)
    noise[:, 38] += 30.0
    stage = subject.stage("cfar")
    reach = sum(stage.params.window_for(subject.radar))
    crest = 7
    quiet = subject.through(stage, subject.block_of(noise)).detections
    for level_db in DROWNING_DB:
        loud = noise.copy()
        loud[:, crest] = 10 ** (level_db / 20)
        found = subject.through(subject.stage("cfar"), subject.block_of(loud)).detections
        _same_beyond(found, quiet, crest + reach)
    return Evidence("taps and scores equal to the last bit", error_ulp=0.0)


def _same_beyond(found: Detections, expected: Detections, tap: int) -> None:
    one, other = found.take(found["tap"] > tap), expected.take(expected["tap"] > tap)
    if not np.array_equal(one["tap"], other["tap"]) or not np.array_equal(one["score_db"], other["score_db"]):
        raise Violation(f"{len(one)} detections behind tap {tap}, expected {len(other)} with the same scores")
    if not len(other):
        raise Violation(f"nothing is detected behind tap {tap}, where an echo of 30 dB stands")


@hard_case("equal")
def training_cells_summed(subject: StagesOnTrial) -> Evidence:
    """Scores of a CFAR over amplitudes that span 160 dB agree with exact sums of the training cells to 1e-12 dB.

    Every frame holds one cell to test and training cells of very different size; the reference sums with
    ``math.fsum``. Only for cell averaging, whose estimate is a plain mean.
    """
    stage = subject.stage("cfar.ca", cells="all")
    half, guard = stage.params.window_for(subject.radar)
    rng = np.random.default_rng(23)
    tap = TAPS // 2 + 2
    amplitude = 10 ** rng.uniform(-8, 0, (50, TAPS))
    amplitude[:, tap] = 1e3
    found = subject.through(stage, subject.block_of(amplitude.astype(complex))).detections
    tested = found.take(found["tap"] == tap)
    if len(tested) != len(amplitude):
        raise Violation(f"{len(tested)} of {len(amplitude)} cells detected that tower over their training cells")
    exact_db = np.array([_averaged_db(row**2, tap, half, guard) for row in amplitude])
    error_db = float(np.max(np.abs(tested["score_db"] - exact_db)))
    if not error_db <= 1e-12:
        raise Violation(f"scores are up to {error_db:.2g} dB off")
    return Evidence(f"50 cells, within {error_db:.1g} dB", error_ulp=error_db / float(np.spacing(exact_db.min())))


def _averaged_db(power: FloatArray, tap: int, half: int, guard: int) -> float:
    left, right = power[tap - guard - half : tap - guard], power[tap + guard + 1 : tap + guard + 1 + half]
    mean = math.fsum([*left.tolist(), *right.tolist()]) / (2 * half)
    return 10 * (math.log10(power[tap]) - math.log10(mean))
