import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from uwbbench.api import ConfigError, Detections


@pytest.fixture(scope="module")
def azimuth_of(make_stage, make_radar, make_block, run_stage):
    """Azimuths (n,) for phase differences (n,)."""

    def azimuths(alpha_rad, radar=None, **params):
        found = Detections(np.zeros(np.size(alpha_rad), int), pdoa_rad=np.atleast_1d(alpha_rad))
        block = make_block(np.ones((1, 50)), detections=found)
        return run_stage(make_stage("azimuth", **params), radar or make_radar(), block).detections["azimuth_rad"]

    return azimuths


def test_paper_gate_is_45_degrees(azimuth_of):
    assert azimuth_of(np.pi * np.sin(0.95 * np.pi / 4))[0] == pytest.approx(np.pi / 4)
    assert np.pi * np.sin(0.95 * np.pi / 4) == pytest.approx(2.1325, abs=5e-5)


@given(st.floats(-np.pi / 2, np.pi / 2))
@settings(max_examples=50)
def test_physical_formula_inverts_the_plane_wave(azimuth_of, make_radar, theta):
    radar = make_radar(array_spacing_m=0.0178)
    alpha = 2 * np.pi * 0.0178 / radar.wavelength_m * np.sin(theta)
    assert np.sin(azimuth_of(alpha, radar, formula="physical")[0]) == pytest.approx(np.sin(theta), abs=1e-12)


@pytest.mark.parametrize(("theta_deg", "read_deg"), [(20, 16.2), (30, 24.0), (45, 34.9)])
def test_paper_formula_reads_too_small_on_channel_5(azimuth_of, make_radar, theta_deg, read_deg):
    radar = make_radar(center_frequency_hz=6489.6e6)
    alpha = 2 * np.pi * 0.017883 / radar.wavelength_m * np.sin(np.deg2rad(theta_deg))
    assert np.rad2deg(azimuth_of(alpha, radar)[0]) == pytest.approx(read_deg, abs=0.1)


@given(st.floats(-np.pi / 4, np.pi / 4))
@settings(max_examples=50)
def test_factor_inside_or_outside_differs_by_less_than_a_degree_within_the_gate(azimuth_of, theta):
    alpha = np.pi * np.sin(0.95 * theta)
    assert abs(azimuth_of(alpha) - azimuth_of(alpha, formula="paper_inside"))[0] < np.deg2rad(1.0)


@pytest.mark.parametrize("formula", ["paper", "paper_inside", "physical"])
def test_arcsine_is_clipped_and_nan_stays_nan(azimuth_of, make_radar, formula):
    radar = make_radar(array_spacing_m=0.010)
    found = azimuth_of(np.array([-np.pi, np.pi, np.nan]), radar, formula=formula)
    limit = np.deg2rad(94.737) if formula == "paper" else np.pi / 2
    np.testing.assert_allclose(found, [-limit, limit, np.nan], rtol=1e-5)


@given(alpha=st.floats(-4, 4))
@settings(max_examples=50)
def test_table_is_interpolated_and_held_at_its_ends(azimuth_of, alpha):
    table = [(-120.0, -45.0), (0.0, 2.0), (110.0, 45.0)]
    found = np.rad2deg(azimuth_of(alpha, formula="table", table=table)[0])
    degrees = np.rad2deg(alpha)
    slope = 47 / 120 if degrees < 0 else 43 / 110
    expected = np.clip(2 + degrees * slope, -45.0, 45.0)
    assert found == pytest.approx(expected, abs=1e-9)


def test_bias_is_subtracted_in_the_domain_asked_for(azimuth_of):
    in_theta = azimuth_of(0.5, bias_deg=3.0)
    in_alpha = azimuth_of(0.5, bias_deg=3.0, bias_domain="alpha")
    assert in_theta[0] == pytest.approx(np.arcsin(0.5 / np.pi) / 0.95 - np.deg2rad(3))
    assert in_alpha[0] == pytest.approx(np.arcsin((0.5 - np.deg2rad(3)) / np.pi) / 0.95)


def test_sign_mirrors_before_the_bias(azimuth_of):
    assert azimuth_of(0.5, sign=-1, bias_deg=2.0)[0] == pytest.approx(azimuth_of(-0.5, bias_deg=2.0)[0])


def test_given_spacing_overrides_the_radars_own(azimuth_of, make_radar):
    own, other = make_radar(array_spacing_m=0.0178), make_radar(array_spacing_m=0.03)
    expected = azimuth_of(0.5, own, formula="physical")
    np.testing.assert_array_equal(azimuth_of(0.5, other, formula="physical", spacing_m=0.0178), expected)


def test_physical_formula_without_any_spacing_is_an_error(make_stage, make_radar):
    with pytest.raises(ConfigError, match="spacing_m"):
        make_stage("azimuth", formula="physical").open(make_radar())


@pytest.mark.parametrize(
    "params",
    [
        {"formula": "table"},
        {"table": [(0, 0), (1, 1)]},
        {"formula": "paper", "spacing_m": 0.0178},
        {"formula": "table", "table": []},
        {"formula": "table", "table": [(0, 0)]},
        {"formula": "table", "table": [(0, 0), (0, 1)]},
        {"formula": "table", "table": [(1, 0), (0, 1)]},
        {"formula": "table", "table": [(0, 0), (1, 2), (2, 1)]},
        {"formula": "table", "table": [(0, 1), (1, 1)]},
    ],
)
def test_useless_or_contradictory_settings_are_refused(make_stage, params):
    with pytest.raises(ValidationError):
        make_stage("azimuth", **params)
