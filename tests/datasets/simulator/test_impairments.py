import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import Responses


def noisy(rng, scale):
    return Responses(*(scale * (rng.normal(size=(40, 50)) + 1j * rng.normal(size=(40, 50))) for _ in range(3)))


def each(responses):
    return (responses.preamble, responses.sts1, responses.sts2)


def test_clipping_limits_i_and_q_and_leaves_the_rest(make_view, make_term, rng):
    view = make_view([[0, 0]]).replace(direct_amplitude=0.5)
    before = noisy(rng, 0.5)
    after = make_term("clipping", level=1.2).apply(before, view, rng)
    for one, other in zip(each(before), each(after), strict=True):
        for was, part in ((one.real, other.real), (one.imag, other.imag)):
            assert np.max(np.abs(part)) == 0.6
            inside = np.abs(was) < 0.6
            assert 0.5 < inside.mean() < 1
            assert np.array_equal(part[inside], was[inside])
            assert np.all(np.sign(part) == np.sign(was))


def test_clipping_without_sts_leaves_sts_out(make_view, make_term, rng):
    after = make_term("clipping").apply(Responses(np.ones((1, 50), complex)), make_view([[0, 0]]), rng)
    assert after.sts1 is None
    assert after.sts2 is None


@pytest.mark.slow
@given(st.integers(2, 16), st.floats(0.1, 10.0), st.floats(1e-3, 1e3))
@settings(max_examples=40, deadline=None)
def test_quantised_samples_are_integers_of_the_word_length(make_view, make_term, bits, full_scale, direct):
    view = make_view([[0, 0]]).replace(direct_amplitude=direct)
    before = noisy(np.random.default_rng(bits), direct)
    after = make_term("quantisation", bits=bits, full_scale=full_scale).apply(before, view, None)
    step = full_scale * direct / 2 ** (bits - 1)
    for one, other in zip(each(before), each(after), strict=True):
        for was, part in ((one.real, other.real), (one.imag, other.imag)):
            counts = part / step
            assert counts == pytest.approx(np.round(counts), abs=1e-6)
            assert counts.min() >= -(2 ** (bits - 1)) - 1e-6
            assert counts.max() <= 2 ** (bits - 1) - 1 + 1e-6
            fits = np.abs(was) < full_scale * direct - step
            assert np.all(np.abs(part - was)[fits] <= step / 2 * (1 + 1e-9))


def test_quantisation_noise_has_the_power_of_the_textbook(make_view, make_term, rng):
    view = make_view([[0, 0]])
    before = noisy(rng, 0.2)
    after = make_term("quantisation", bits=10, full_scale=2.0).apply(before, view, rng)
    step = 2.0 / 2**9
    error = np.concatenate([(other - one).ravel() for one, other in zip(each(before), each(after), strict=True)])
    assert np.mean(np.abs(error) ** 2) == pytest.approx(step**2 / 6, rel=0.05)


def test_near_metal_saturates_in_a_scene(run_scene):
    plate = {"id": "p", "shape": "plate", "center_m": [0.301, 0], "yaw_deg": 180, "width_m": 1, "height_m": 1}
    terms = [{"use": "direct", "params": {"isolation_db": 20}}, {"use": "echo.plate"}]
    whole = run_scene(terms, objects=[plate]).preamble
    level = run_scene(terms[:1]).preamble.real.max()
    clipped = run_scene([*terms, {"use": "clipping"}], objects=[plate]).preamble
    assert np.max(np.abs(whole.real)) > 1.3 * level
    assert max(np.max(np.abs(clipped.real)), np.max(np.abs(clipped.imag))) <= 1.21 * level
