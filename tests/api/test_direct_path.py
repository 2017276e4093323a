"""A robot's direct path inside what it rings, located by a pulse that is known or by that of moving echoes."""

import numpy as np
import pytest

from tests.api.ringing_robot import INTERVAL_S, frames_of, gauss, radar_of, tailed
from uwbbench.api import ConfigError, DirectPath, Located, doubt, stated_pulse
from uwbbench.api.direct_path import between, locate

CLOSE_S = 0.08e-9
"""1.2 cm of range, two of the standard deviations that the fits state here."""


def learned(samples, scale=1.0):
    """Direct path learned from all frames, then compared with each; and the crests of the frames."""
    direct = DirectPath(radar_of())
    found = [direct.aligned(frame * scale) for frame in samples]
    for _, frame in found:
        direct.learn(frame)
    for _, frame in found:
        direct.listen(frame)
    return direct, np.array([crest for crest, _ in found])


@pytest.fixture(scope="module", params=[gauss, tailed], ids=["gauss", "tailed"])
def drive(request):
    samples, off = frames_of(request.param)
    direct, crests = learned(samples)
    return request.param, direct, float(np.median(7 + off - crests)) * INTERVAL_S


def test_a_response_is_interpolated_between_its_taps():
    tap = np.arange(40.0)
    tone = np.exp(2j * np.pi * 0.2 * tap)
    at = np.array([12.25, 18.5, 20.0])
    np.testing.assert_allclose(between(tone, at), np.exp(2j * np.pi * 0.2 * at), atol=2e-3)
    assert between(tone, np.array([-20.0, 60.0])) == pytest.approx(0)


def test_ringing_moves_the_crest_by_centimetres(drive):
    _, _, true_s = drive
    assert abs(true_s) > 0.1e-9


def test_moving_echoes_locate_the_direct_path_whatever_the_pulse(drive):
    pulse, direct, true_s = drive
    located = direct.by_echoes()
    assert located.delay_s == pytest.approx(true_s, abs=CLOSE_S)
    assert doubt(located) == ""
    time_s, height = direct.echo_pulse
    np.testing.assert_allclose(height, pulse(time_s), atol=0.02)


def test_the_right_pulse_locates_the_direct_path_without_echoes():
    samples, off = frames_of(echo=0.0)
    direct, crests = learned(samples)
    located = direct.by_pulse(stated_pulse("gauss", 3.2e-9))
    assert direct.by_echoes() is None
    assert located.delay_s == pytest.approx(float(np.median(7 + off - crests)) * INTERVAL_S, abs=CLOSE_S)
    assert doubt(located) == ""


def test_echoes_show_the_tail_of_a_pulse_that_ringing_explains_as_well():
    direct, _ = learned(frames_of(tailed)[0])
    stated = direct.by_pulse(stated_pulse("gauss", 3.2e-9))
    assert doubt(stated) == ""
    assert "another pulse" in doubt(stated, direct.by_echoes())


@pytest.mark.parametrize("pulse", [("raised_cosine", 2e-9), ("gauss", 2.0e-9), ("gauss", 4.5e-9)])
def test_a_pulse_of_another_width_is_seen_on_the_direct_path_alone(pulse):
    direct, _ = learned(frames_of(echo=0.0)[0])
    assert doubt(direct.by_pulse(stated_pulse(*pulse)))


@pytest.mark.parametrize("scale", [1e-20, 1e20])
def test_what_is_learned_has_no_scale(scale):
    samples, _ = frames_of(frames=60)
    (one, crests), (other, scaled) = learned(samples), learned(samples, scale)
    np.testing.assert_allclose(scaled, crests, atol=1e-9)
    assert other.by_echoes().delay_s == pytest.approx(one.by_echoes().delay_s, abs=1e-15)
    assert other.noise == pytest.approx(one.noise)


def test_the_scatter_of_the_crest_is_measured():
    samples, off = frames_of(echo=0.0, noise=3e-3)
    direct, crests = learned(samples)
    assert direct.crest_sd_s == pytest.approx(float(np.std(crests - off)) * INTERVAL_S, rel=0.25)


@pytest.mark.parametrize("frame", [np.zeros(50), np.full(50, np.nan), np.full(50, 1.0 + 1j), np.eye(50)[20]])
def test_a_frame_without_a_direct_path_is_left_out(frame):
    assert DirectPath(radar_of()).aligned(frame.astype(complex)) is None


def test_a_radar_that_counts_from_transmission_has_no_such_zero():
    with pytest.raises(ConfigError, match="count from transmission"):
        DirectPath(radar_of(first_tap_delay_s=0.0))


def test_without_ringing_the_direct_path_lies_at_the_crest():
    time_s = (np.arange(50) - 7) * INTERVAL_S
    located = locate(gauss(time_s).astype(complex), 7, INTERVAL_S, stated_pulse("gauss", 3.2e-9), 1e-6)
    assert abs(located.delay_s) < 0.04e-9
    assert doubt(Located(0.0, 0.2e-9, 0.5)).startswith("it is unsure by 3.0 cm")
