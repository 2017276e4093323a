"""Features of a frame behind its direct path."""

from itertools import pairwise

import numpy as np
import pytest

from uwbbench.api.trial import StagesOnTrial
from uwbbench_detectors.classify.features import BANDS, NAMES, TAPS, features_of

CREST = 5


def frames(count: int = 6, taps: int = 50) -> np.ndarray:
    rng = np.random.default_rng(4)
    samples = rng.normal(size=(count, taps)) + 1j * rng.normal(size=(count, taps))
    samples[:, CREST] = 7.0 - 3.0j
    return samples


def found_in(samples: np.ndarray, crest: float = CREST):
    block = StagesOnTrial.block_of(samples, first_path=np.full(len(samples), float(crest)))
    return features_of(block)


def by_numpy(row: np.ndarray) -> dict[str, float]:
    """Features as numpy says them, one at a time."""
    amplitude = np.zeros(TAPS)
    behind = np.abs(row[CREST : CREST + TAPS])
    amplitude[: len(behind)] = behind / behind[0]
    energy, tap = amplitude**2, np.arange(TAPS)
    share, tail = energy / energy.sum(), amplitude[3:]
    mean = (share * tap).sum()
    shape = {
        "mean excess delay": mean,
        "delay spread": np.sqrt((share * (tap - mean) ** 2).sum()),
        "entropy": -(share * np.log(share + 1e-12)).sum(),
        "largest amplitude of the tail": tail.max(),
        "tap of that": tail.argmax(),
        "median amplitude of the tail": np.median(tail),
    }
    bands = {f"energy of taps {start} to {stop - 1}": energy[start:stop].sum() for start, stop in pairwise(BANDS)}
    amplitudes = {f"amplitude {k}": amplitude[k] for k in range(1, TAPS)}
    logs = {f"log amplitude {k}": np.log10(amplitude[k] + 1e-6) for k in range(1, TAPS)}
    return amplitudes | logs | shape | bands


@pytest.mark.parametrize("taps", [50, 30])
def test_each_feature_is_what_numpy_makes_of_the_frame(taps):
    samples = frames(taps=taps)
    found, there = found_in(samples)
    assert there.all()
    expected = [by_numpy(row) for row in samples]
    assert tuple(expected[0]) == NAMES
    np.testing.assert_allclose(found, [list(one.values()) for one in expected], rtol=1e-6, atol=1e-12)


def test_features_do_not_hang_on_gain_phase_and_noise_before_the_direct_path():
    samples = frames()
    turned = samples * 3e-5 * np.exp(1j)
    turned[:, :CREST] = 0
    np.testing.assert_allclose(found_in(turned)[0], found_in(samples)[0], rtol=2e-6)


def test_features_of_a_frame_do_not_hang_on_the_frames_around_it():
    samples = frames(40)
    together = found_in(samples)[0]
    alone = np.concatenate([found_in(row[None])[0] for row in samples])
    assert np.array_equal(together, alone)


@pytest.mark.parametrize("crest", [CREST, np.nan, -3.0, 50.0])
def test_a_frame_without_a_direct_path_has_no_features(crest):
    samples = frames()
    samples[2, CREST] = 0
    samples[4] = np.nan
    there = found_in(samples, crest)[1]
    assert there.tolist() == [crest == CREST and place not in (2, 4) for place in range(6)]


def test_the_faintest_samples_have_the_same_features():
    np.testing.assert_allclose(found_in(frames() * 1e-200)[0], found_in(frames())[0], rtol=2e-6)
