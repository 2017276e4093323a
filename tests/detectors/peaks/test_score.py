"""The SNR score, and what becomes of it without noise."""

import numpy as np
import pytest

from uwbbench.api import ConfigError, Detections

TS = 1 / (2 * 499.2e6)
FLAT = np.ones((1, 50))


@pytest.fixture
def score(make_radar, make_block, make_stage, run_stage):
    def score(height, noise, tap=20.0, first_path=5.0, samples=FLAT, profile=None, **params):
        block = make_block(
            samples,
            noise_rms=np.array([noise]),
            first_path=np.array([first_path]),
            detections=Detections([0], tap=[tap], amplitude=[height]),
            profile=profile,
            profile_start=0 if profile is None else samples.shape[1] - profile.shape[1],
        )
        stage = make_stage("score.snr", **params)
        result = run_stage(stage, make_radar(sample_interval_s=TS), block)
        return result.detections["score_db"], stage.notes

    return score


def test_the_score_is_the_ratio_in_db_plus_the_gain_for_the_delay(score):
    value, notes = score(10.0, 0.1)
    assert value == pytest.approx([40 + 0.20 * 15 * TS * 1e9], rel=1e-14)
    assert notes == []


def test_a_delay_in_samples_differs_by_their_spacing(score):
    in_samples, _ = score(10.0, 0.1, delay_unit="samples")
    assert in_samples == pytest.approx([40 + 0.20 * 15], rel=1e-14)


def test_detections_before_the_first_path_lose(score):
    value, _ = score(10.0, 0.1, tap=0.0, delay_unit="samples", gain_db_per_ns=1.0)
    assert value == pytest.approx([35], rel=1e-14)


@pytest.mark.parametrize(
    ("height", "noise"), [(1.0, 0.0), (1.0, np.nan), (1.0, np.inf), (0.0, 1.0), (0.0, 0.0), (np.nan, 1.0)]
)
def test_without_noise_or_amplitude_there_is_no_score_and_a_note(score, height, noise):
    value, notes = score(height, noise)
    assert np.isnan(value).all()
    assert len(notes) == 1
    assert "no score" in notes[0]


def test_very_small_and_large_magnitudes_do_not_overflow(score):
    assert score(1e300, 1e-300, first_path=20.0)[0] == pytest.approx([12000])
    assert score(1e-300, 1e300, first_path=20.0)[0] == pytest.approx([-12000])


def test_the_first_path_of_the_wrong_frame_is_not_used(make_radar, make_block, make_stage, run_stage):
    found = Detections([8, 7], tap=[20.0, 20.0], amplitude=[1.0, 1.0])
    block = make_block(
        np.ones((2, 50)), first=7, noise_rms=np.array([1.0, 0.1]), first_path=np.array([20.0, 10.0]), detections=found
    )
    stage = make_stage("score.snr", delay_unit="samples", gain_db_per_ns=1.0)
    assert run_stage(stage, make_radar(), block).detections["score_db"] == pytest.approx([30.0, 0.0])


@pytest.mark.parametrize("echo_db", [15, 30])
def test_normalised_amplitudes_lift_the_scores_of_echoes_by_about_one_db(
    make_radar, make_block, make_stage, run_stage, echo_db
):
    rng = np.random.default_rng(3)
    samples = (rng.normal(size=(2000, 50)) + 1j * rng.normal(size=(2000, 50))) / np.sqrt(2)
    samples[:, 20] = 10 ** (echo_db / 20)
    radar = make_radar()
    block = make_block(samples, first_path=np.zeros(2000))
    for name in ("noise_floor", "profile.minmax", "peaks", "select.strongest"):
        block = run_stage(make_stage(name), radar, block)
    raw, normalised = (
        run_stage(make_stage("score.snr", amplitude=kind), radar, block).detections["score_db"]
        for kind in ("raw", "normalised")
    )
    lift_db = (normalised - raw)[np.isfinite(normalised)]  # four taps may be quieter than the quietest of the others
    assert len(lift_db) > 1990
    assert 0.9 < np.median(lift_db) < 1.2


def test_normalised_is_raw_where_the_profile_is_the_amplitude(score):
    samples = np.random.default_rng(4).uniform(1, 2, size=(1, 50))
    normalised, _ = score(1.5, 0.1, samples=samples, profile=samples[:, 4:], amplitude="normalised")
    raw, _ = score(1.5, 0.1, samples=samples)
    assert normalised == pytest.approx(raw, rel=1e-12)


def test_a_constant_profile_gives_no_score(score):
    value, _ = score(1.0, 0.1, profile=np.zeros((1, 46)), amplitude="normalised")
    assert np.isnan(value).all()


def test_normalised_without_a_profile_names_what_is_missing(score):
    with pytest.raises(ConfigError, match="needs a profile"):
        score(1.0, 0.1, amplitude="normalised")
