import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

AZIMUTH = np.linspace(-np.pi / 2, np.pi / 2, 181)


@given(st.floats(0, 6), st.floats(0, 30), st.floats(-np.pi, np.pi))
@settings(max_examples=40, deadline=None)
def test_patch_falls_as_cosine_to_the_back_level(make_view, make_term, exponent, front_back_db, azimuth):
    term = make_term("antenna", exponent=exponent, front_back_db=front_back_db, transmit_gain_dbi=0.0)
    gain = term.prepare(make_view([[0, 0]]), None).receive_gain
    ahead = np.cos(azimuth) ** exponent if np.cos(azimuth) > 0 else 0.0 if exponent else 1.0
    power_db = 20 * np.log10(gain(np.array([azimuth]))[0])
    assert power_db == pytest.approx(10 * np.log10(max(ahead, 10 ** (-front_back_db / 10))), abs=1e-9)


def test_transmitter_lifts_echoes_and_the_direct_path_alike(make_view, make_term, rng):
    seen = make_term("antenna", transmit_gain_dbi=6.0).prepare(make_view([[0, 0]]), rng)
    assert seen.receive_gain(np.zeros(1)) == pytest.approx([10 ** (6 / 20)])
    assert seen.direct_amplitude == pytest.approx(10 ** (6 / 20))


def test_usual_pattern_is_six_decibels_down_at_sixty_degrees_and_fifteen_behind(make_view, make_term, rng):
    gain = make_term("antenna").prepare(make_view([[0, 0]]), rng).receive_gain
    front, side, back = 20 * np.log10(gain(np.radians([0.0, 60.0, 180.0])))
    assert front - side == pytest.approx(6.02, abs=0.01)
    assert front - back == pytest.approx(15.0)


def test_array_without_error_is_two_ideal_antennas(make_view, make_term, rng):
    view = make_view([[0, 0]])
    term = make_term("array", coupling=1.0, asymmetry_deg=0.0, ripple_deg=0.0)
    phase = term.prepare(view, rng).array_phase(AZIMUTH)
    assert phase == pytest.approx(2 * np.pi * 17.8e-3 / view.radar.wavelength_m * np.sin(AZIMUTH))


def test_usual_array_error_is_smooth_asymmetric_and_some_degrees(make_view, make_term, rng):
    view = make_view([[0, 0]])
    seen = make_term("array").prepare(view, rng)
    slope = 2 * np.pi * 17.8e-3 / view.radar.wavelength_m
    phase = seen.array_phase(AZIMUTH)
    reading = np.arcsin(np.clip(phase / slope, -1, 1))  # of somebody who knows nothing of the error
    middle = np.abs(AZIMUTH) < np.radians(45)
    error = np.degrees(reading - AZIMUTH)[middle]
    assert 1.0 < np.sqrt(np.mean(error**2)) < 6.0
    assert np.max(np.abs(error + error[::-1])) > 1.0  # left and right differ
    assert np.max(np.abs(np.diff(phase))) < 0.1
    assert np.all(np.diff(phase[middle]) > 0)  # still one azimuth for each phase


def test_phase_between_the_responses_of_a_scene_is_that_of_the_array(run_scene, make_view, make_term, rng):
    post = {"id": "a", "shape": "point", "center_m": [2.0, 1.0]}
    params = {"offset_deg": 10.0}
    terms = [{"use": "array", "params": params}, {"use": "echo.point"}]
    frames = run_scene(terms, objects=[post]).frames()
    expected = make_term("array", **params).prepare(make_view([[0, 0]]), rng).array_phase(np.arctan2(1.0, 2.0))
    crest = np.argmax(np.abs(frames.sts1[0]))
    found = np.angle(frames.sts2[:, crest] * np.conj(frames.sts1[:, crest]))
    assert np.exp(1j * found) == pytest.approx(np.exp(1j * np.full(len(frames), expected)), abs=1e-5)
