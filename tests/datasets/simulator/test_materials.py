import math

import mpmath
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import ConfigError
from uwbbench_datasets.simulator.materials import MATERIALS, SHAPE_LOSS_DB, permittivity, reflection

CHANNEL_5_HZ, CHANNEL_9_HZ = 6489.6e6, 7987.2e6
TO_40_GHZ = sorted(name for name, row in MATERIALS.items() if row.valid_hz[1] >= 40e9)


def exact_reflection(material, frequency_hz, thickness_m=None):
    """The same formulas with 50 digits, the slab as the sum of its internal bounces rather than in closed form."""
    with mpmath.workdps(50):
        row = MATERIALS[material]
        f = mpmath.mpf(frequency_hz)
        permittivity_f_m = mpmath.mpf("8.8541878128e-12")
        loss = row.c * (f / 10**9) ** row.d / (2 * mpmath.pi * f * permittivity_f_m)
        index = mpmath.sqrt(mpmath.mpc(row.a * (f / 10**9) ** row.b, -loss))
        face = (1 - index) / (1 + index)
        if thickness_m is None:
            return complex(face)
        once = mpmath.exp(-1j * 2 * mpmath.pi * f * thickness_m * index / mpmath.mpf(299792458))
        into, out = 1 + face, 1 - face
        bounces = mpmath.nsum(lambda n: into * once * -face * (face * face * once * once) ** n * once * out, [0, 200])
        return complex(face + bounces)


@pytest.mark.parametrize(
    ("material", "channel_5", "channel_9"),
    [
        ("concrete", 5.24 - 0.55j, 5.24 - 0.53j),
        ("plywood", 2.71 - 0.91j, 2.71 - 0.74j),
        ("wood", 1.99 - 0.10j, 1.99 - 0.10j),
        ("chipboard", 2.58 - 0.26j, 2.58 - 0.25j),
    ],
)
def test_permittivity_is_that_of_the_recommendation(material, channel_5, channel_9):
    assert permittivity(material, CHANNEL_5_HZ) == pytest.approx(channel_5, abs=0.006)
    assert permittivity(material, CHANNEL_9_HZ) == pytest.approx(channel_9, abs=0.006)


@pytest.mark.parametrize(
    ("material", "thickness_m", "channel_5", "channel_9"),
    [
        ("metal", None, 1.0, 1.0),
        ("metal", 1e-3, 1.0, 1.0),
        ("concrete", None, 0.394, 0.394),
        ("concrete", 0.05, 0.33, 0.36),
        ("concrete", 0.03, 0.26, 0.46),
        ("plywood", None, 0.269, 0.261),
        ("plywood", 0.012, 0.22, 0.17),
        ("plywood", 0.018, 0.29, 0.32),
        ("wood", 0.018, 0.10, 0.27),
        ("chipboard", 0.018, 0.28, 0.37),
        ("plasterboard", 0.0125, 0.16, 0.15),
        ("glass", 0.006, 0.68, 0.51),
    ],
)
def test_magnitudes_at_both_channels(material, thickness_m, channel_5, channel_9):
    digits = 6e-4 if thickness_m is None else 6e-3  # as many as the published values have
    assert abs(reflection(material, CHANNEL_5_HZ, thickness_m)) == pytest.approx(channel_5, abs=digits)
    assert abs(reflection(material, CHANNEL_9_HZ, thickness_m)) == pytest.approx(channel_9, abs=digits)


@given(
    st.sampled_from(TO_40_GHZ),
    st.floats(1e9, 40e9),
    st.one_of(st.none(), st.floats(1e-3, 0.1)),
)
@settings(max_examples=40, deadline=None)
def test_reflection_equals_fifty_digit_arithmetic(material, frequency_hz, thickness_m):
    expected = exact_reflection(material, frequency_hz, thickness_m)
    # The phase through a slab holds up to some 2000 rad, each worth one unit in the last place of it.
    assert reflection(material, frequency_hz, thickness_m) == pytest.approx(expected, rel=1e-11, abs=1e-12)


@given(st.sampled_from(TO_40_GHZ), st.floats(1e9, 40e9), st.one_of(st.none(), st.floats(1e-6, 10.0)))
@settings(max_examples=100)
def test_nothing_reflects_more_than_it_receives(material, frequency_hz, thickness_m):
    assert abs(reflection(material, frequency_hz, thickness_m)) <= 1 + 1e-12


@pytest.mark.parametrize("material", ["concrete", "plywood", "metal"])
def test_thick_lossy_slab_is_a_half_space(material):
    assert reflection(material, CHANNEL_9_HZ, 5.0) == pytest.approx(reflection(material, CHANNEL_9_HZ), rel=1e-6)


def test_vanishing_slab_reflects_nothing():
    assert abs(reflection("glass", CHANNEL_9_HZ, 1e-9)) < 1e-5


def test_fitted_losses_bring_boxes_of_concrete_and_plywood_within_a_decibel():
    def level_db(name, loss_db):
        return 20 * math.log10(abs(reflection(name, CHANNEL_9_HZ))) - loss_db

    apart = level_db("concrete", 0.0) - level_db("plywood", 0.0)
    fitted = level_db("concrete", SHAPE_LOSS_DB["concrete"]) - level_db("plywood", SHAPE_LOSS_DB["plywood"])
    assert apart == pytest.approx(3.6, abs=0.05)
    assert fitted == pytest.approx(0.6, abs=0.05)
    assert "metal" not in SHAPE_LOSS_DB


def test_unknown_material_names_the_nearest():
    with pytest.raises(ConfigError, match=r"no material 'concret'\. Did you mean 'concrete'"):
        reflection("concret", CHANNEL_9_HZ)


def test_frequency_outside_the_table_is_refused():
    with pytest.raises(ConfigError, match=r"material 'plywood' is known from 1 to 40 GHz, not at 60 GHz"):
        reflection("plywood", 60e9)


@pytest.mark.parametrize("thickness_m", [0.0, -1.0, float("nan")])
def test_slab_without_thickness_is_refused(thickness_m):
    with pytest.raises(ConfigError, match="thicker than 0 m"):
        reflection("glass", CHANNEL_9_HZ, thickness_m)


@pytest.mark.parametrize("frequency_ghz", [3.1, 4.3, 6.4896, 7.9872, 10.5])
def test_a_person_reflects_like_dry_skin(frequency_ghz):
    turning = 2j * math.pi * frequency_ghz * 1e9
    skin = 4 + 32 / (1 + turning * 7.234e-12) + 1100 / (1 + (turning * 32.48e-9) ** 0.8)
    skin += 0.0002 / (turning * 8.8541878128e-12)
    expected = (1 - skin**0.5) / (1 + skin**0.5)
    assert reflection("person", frequency_ghz * 1e9) == pytest.approx(expected, abs=0.005)
