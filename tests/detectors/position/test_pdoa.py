import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import ConfigError, Detections

TAPS = 20
SPACING_M = 17.8e-3


def block_of(make_block, sts1, sts2, taps, first_path=5.0, **frames):
    """A block with one detection a frame at ``taps``."""
    found = Detections(np.arange(len(taps)), tap=taps)
    level = np.full(len(sts1), first_path)
    return make_block(np.ones((len(sts1), TAPS)), sts1=sts1, sts2=sts2, first_path=level, detections=found, **frames)


def two_antennas(rng, frames=1):
    shape = (2, frames, TAPS)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def reported(preamble, sts1, sts2):
    return {"first_path_index": preamble, "first_path_index_sts1": sts1, "first_path_index_sts2": sts2}


@given(st.floats(-3.1, 3.1), st.floats(-3.1, 3.1))
@settings(max_examples=50)
def test_difference_is_phase_of_sts2_minus_phase_of_sts1(make_block, make_stage, run_stage, make_radar, one, two):
    sts1 = np.full((1, TAPS), 2.0 * np.exp(1j * one))
    sts2 = np.full((1, TAPS), 0.5 * np.exp(1j * two))
    found = run_stage(make_stage("pdoa"), make_radar(TAPS), block_of(make_block, sts1, sts2, [6.0])).detections
    assert np.exp(1j * found["pdoa_rad"][0]) == pytest.approx(np.exp(1j * (two - one)))
    assert -np.pi <= found["pdoa_rad"][0] <= np.pi


@pytest.mark.parametrize(("wrap", "expected"), [("half_open", -np.pi), ("closed_above", np.pi)])
def test_half_a_turn_falls_on_the_closed_end_of_the_interval(
    make_block, make_stage, run_stage, make_radar, wrap, expected
):
    one = np.ones((2, TAPS), complex)
    turned = np.stack([np.full(TAPS, -1 + 0j), np.full(TAPS, complex(-1, -0.0))])
    block = block_of(make_block, one, turned, [6.0, 6.0])
    found = run_stage(make_stage("pdoa", wrap=wrap), make_radar(TAPS), block).detections
    assert found["pdoa_rad"].tolist() == [expected, expected]


def test_aligned_sample_counts_from_each_responses_own_first_path_and_rounds(
    make_block, make_stage, run_stage, make_radar
):
    sts1, sts2 = two_antennas(np.random.default_rng(1))
    paths = reported(np.array([5.2]), np.array([3.0]), np.array([8.9]))
    block = block_of(make_block, sts1, sts2, [9.0], **paths)  # 3.8 taps behind the first path: 6.8 and 12.7
    found = run_stage(make_stage("pdoa"), make_radar(TAPS), block).detections
    assert found["pdoa_rad"][0] == pytest.approx(np.angle(sts2[0, 13] * np.conj(sts1[0, 7])))


def test_fractional_sample_interpolates_between_neighbours(make_block, make_stage, run_stage, make_radar):
    sts1, sts2 = two_antennas(np.random.default_rng(2))
    paths = reported(np.array([5.0]), np.array([5.25]), np.array([7.5]))
    block = block_of(make_block, sts1, sts2, [9.0], **paths)
    found = run_stage(make_stage("pdoa", sample="fractional"), make_radar(TAPS), block).detections
    at = [np.interp(tap, np.arange(TAPS), response[0]) for tap, response in ((9.25, sts1), (11.5, sts2))]
    assert found["pdoa_rad"][0] == pytest.approx(np.angle(at[1] * np.conj(at[0])))


def test_same_tap_ignores_reported_first_paths(make_block, make_stage, run_stage, make_radar):
    sts1, sts2 = two_antennas(np.random.default_rng(3))
    paths = reported(np.array([5.0]), np.array([2.0]), np.array([9.0]))
    block = block_of(make_block, sts1, sts2, [9.4], **paths)
    found = run_stage(make_stage("pdoa", sample="same_tap"), make_radar(TAPS), block).detections
    assert found["pdoa_rad"][0] == pytest.approx(np.angle(sts2[0, 9] * np.conj(sts1[0, 9])))


def test_without_reported_first_paths_the_same_tap_is_read_and_the_results_say_so(
    make_block, make_stage, run_stage, make_radar
):
    sts1, sts2 = two_antennas(np.random.default_rng(4))
    stage = make_stage("pdoa")
    found = run_stage(stage, make_radar(TAPS), block_of(make_block, sts1, sts2, [9.0])).detections
    assert found["pdoa_rad"][0] == pytest.approx(np.angle(sts2[0, 9] * np.conj(sts1[0, 9])))
    assert any("first path" in note for note in stage.notes)


@pytest.mark.parametrize("sample", ["aligned", "fractional"])
@pytest.mark.parametrize(("tap", "inside"), [(17.0, True), (17.6, False), (2.0, True), (1.4, False)])
def test_samples_outside_the_window_have_no_difference(
    make_block, make_stage, run_stage, make_radar, sample, tap, inside
):
    sts1, sts2 = two_antennas(np.random.default_rng(5))
    paths = reported(np.array([5.0]), np.array([7.0]), np.array([3.0]))  # STS1 reads 2 taps on, STS2 2 taps back
    block = block_of(make_block, sts1, sts2, [tap], **paths)
    found = run_stage(make_stage("pdoa", sample=sample), make_radar(TAPS), block).detections
    assert np.isfinite(found["pdoa_rad"][0]) == inside


@pytest.mark.parametrize("phase", ["atan2", "arctan"])
def test_a_sample_of_zero_has_no_phase(make_block, make_stage, run_stage, make_radar, phase):
    block = block_of(make_block, np.zeros((1, TAPS), complex), np.ones((1, TAPS), complex), [6.0])
    found = run_stage(make_stage("pdoa", phase=phase), make_radar(TAPS), block).detections
    assert np.isnan(found["pdoa_rad"][0])


@pytest.mark.parametrize("alpha", [0.3, 1.0, 2.13])
def test_literal_arctan_errs_by_pi_as_often_as_theory_says(make_block, make_stage, run_stage, make_radar, alpha):
    frames = 4000
    phase = np.linspace(-np.pi, np.pi, frames, endpoint=False)
    sts1 = np.repeat(np.exp(1j * phase)[:, None], TAPS, axis=1)
    block = block_of(make_block, sts1, sts1 * np.exp(1j * alpha), np.full(frames, 6.0))
    found = run_stage(make_stage("pdoa", phase="arctan"), make_radar(TAPS), block).detections["pdoa_rad"]
    wrong = np.abs(found - alpha) > 1e-6
    assert np.allclose(np.cos(2 * (found - alpha)), 1)
    assert wrong.mean() == pytest.approx(alpha / np.pi, abs=2 / frames)


def test_direct_reference_cancels_a_common_phase_and_restores_the_direct_paths_geometry(
    make_block, make_stage, run_stage, make_radar
):
    radar = make_radar(TAPS, array_spacing_m=SPACING_M, tx_position_m=(-0.1, -0.2, 0.1))
    slope = 2 * np.pi * SPACING_M / radar.wavelength_m
    expected_direct = slope * (-0.2 / np.sqrt(0.06))
    true = 0.7
    sts1 = np.ones((5, TAPS), complex)
    sts2 = np.ones((5, TAPS), complex)
    sts2[:, 5] *= np.exp(1j * expected_direct)
    sts2[:, 9] *= np.exp(1j * true)
    offset = np.linspace(-3, 3, 5)
    block = block_of(make_block, sts1, sts2 * np.exp(1j * offset)[:, None], np.full(5, 9.0))
    found = run_stage(make_stage("pdoa", reference="direct"), radar, block).detections
    np.testing.assert_allclose(found["pdoa_rad"], true, atol=1e-12)


def test_responses_relative_to_their_direct_paths_get_its_geometry_back(make_block, make_stage, run_stage, make_radar):
    """Dividing both responses by their direct paths takes off what 'direct' measures there."""
    rng = np.random.default_rng(7)
    sts1, sts2 = two_antennas(rng, 3)
    radar = make_radar(TAPS, array_spacing_m=SPACING_M, tx_position_m=(-0.2, 0.15, 0.0))
    aligned = [samples / samples[:, 5:6] for samples in (sts1, sts2)]
    found = [
        run_stage(make_stage("pdoa", sample="same_tap", reference=reference), radar, block).detections["pdoa_rad"]
        for reference, block in (
            ("direct", block_of(make_block, sts1, sts2, [6.0, 9.0, 12.0])),
            ("aligned", block_of(make_block, *aligned, [6.0, 9.0, 12.0])),
        )
    ]
    assert np.exp(1j * found[0]) == pytest.approx(np.exp(1j * found[1]))


@pytest.mark.parametrize(
    ("known", "missing"),
    [({"tx_position_m": (0.0, -0.2, 0.0)}, "antenna spacing"), ({"array_spacing_m": SPACING_M}, "baseline")],
)
def test_direct_reference_without_its_geometry_is_an_error(make_stage, make_radar, known, missing):
    with pytest.raises(ConfigError, match=missing):
        make_stage("pdoa", reference="direct").open(make_radar(TAPS, **known))


@given(cuts=st.lists(st.integers(0, 30), max_size=6))
@settings(max_examples=20)
def test_blocks_do_not_matter(make_block, run_cut, make_radar, cuts):
    rng = np.random.default_rng(7)
    sts1, sts2 = two_antennas(rng, 30)
    paths = reported(rng.uniform(4, 6, 30), rng.uniform(4, 6, 30), rng.uniform(4, 6, 30))
    block = block_of(make_block, sts1, sts2, rng.uniform(0, TAPS - 1, 30), **paths)
    run_cut("pdoa", {"sample": "fractional"}, make_radar(TAPS), block, cuts)
