"""The terms that every frame is made of, against closed forms, direct integration and the published shape."""

from pathlib import Path

import numpy as np
import pytest

from tests.fixtures.chance import SIGMAS
from uwbbench.api import Capture, magnitude
from uwbbench.detect.pipeline import detector_from_yaml
from uwbbench_datasets.simulator.engine import simulate
from uwbbench_datasets.simulator.pulses import GaussianPulse, RaisedCosinePulse
from uwbbench_datasets.simulator.scene import read_scenes
from uwbbench_datasets.simulator.shapes import Face
from uwbbench_datasets.simulator.terms.echo import face_echo

WAVELENGTH_M = 299_792_458.0 / 7987.2e6
SCENE = """\
schema: 1
trajectory: {kind: static, duration_s: 40.0}
terms: [{use: direct}]
"""


@pytest.fixture
def capture(tmp_path: Path):
    def made(*terms: dict, **changes: object) -> Capture:
        path = tmp_path / "scene.yaml"
        path.write_text(SCENE)
        scene = read_scenes(path, {"terms": [{"use": "direct"}, *terms], **changes})[0]
        return simulate(scene).captures[0]

    return made


# Pulses


def test_the_raised_cosine_is_that_of_its_formula_and_has_no_pole() -> None:
    pulse = RaisedCosinePulse(2e-9, 0.5)
    turns = np.linspace(-6.03, 6.01, 501)
    expected = np.sinc(turns) * np.cos(np.pi * 0.5 * turns) / (1 - turns**2)
    assert np.allclose(pulse(turns * 2e-9), expected, atol=1e-12)
    assert pulse(np.array([2e-9, -2e-9])) == pytest.approx(np.pi / 4 * np.sinc(1.0), abs=1e-15)
    assert pulse(np.array([0.0]))[0] == 1.0


@pytest.mark.parametrize(("pulse", "width_ns"), [(RaisedCosinePulse(), 2.29), (GaussianPulse(3.2e-9), 3.2)])
def test_pulses_have_their_width_at_half_height(pulse, width_ns: float) -> None:
    time_s = np.linspace(-4e-9, 4e-9, 80_001)
    assert np.sum(pulse(time_s) >= 0.5) * 1e-4 == pytest.approx(width_ns, abs=0.01)


def test_the_gaussian_spectrum_is_500_mhz_wide_at_the_mask() -> None:
    time_s = (np.arange(4096) - 2048) * 0.05e-9
    power = np.abs(
        np.fft.fft(GaussianPulse(3.2e-9)(time_s))
    )  # the response is an autocorrelation: its transform is the PSD
    at = np.interp([0.0, 250e6], np.fft.fftfreq(4096, 0.05e-9)[:2048], power[:2048])
    assert 10 * np.log10(at[1] / at[0]) == pytest.approx(-10, abs=0.3)


# Plates


def facing(range_m: np.ndarray, half_m: float, yaw: float = 0.0, offset_m: float = 0.0) -> np.ndarray:
    """Amplitudes of a square face at several ranges, seen from one antenna."""
    normal, across = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    face = Face(np.zeros(3), normal, across, 2 * half_m, 2 * half_m)
    antenna = np.stack([range_m, np.full_like(range_m, offset_m), np.zeros_like(range_m)], axis=1)
    return face_echo(face, antenna, antenna, WAVELENGTH_M)[1]


def test_a_small_plate_follows_the_radar_equation() -> None:
    range_m, half_m = np.linspace(2, 6, 9), 0.01
    sigma = 4 * np.pi * (2 * half_m) ** 4 / WAVELENGTH_M**2
    expected = WAVELENGTH_M * np.sqrt(sigma) / ((4 * np.pi) ** 1.5 * range_m**2)
    assert np.allclose(facing(range_m, half_m), expected, rtol=0.01)


def test_a_large_plate_is_a_mirror() -> None:
    range_m = np.linspace(0.5, 3, 2001)
    relative = facing(range_m, 2.0) / (WAVELENGTH_M / (8 * np.pi * range_m))
    assert np.mean(relative) == pytest.approx(1, abs=0.05)


def test_a_tilted_plate_far_away_follows_the_sinc() -> None:
    tilt = np.radians(np.array([0.0, 1.0, 2.0, 3.0]))
    found = np.array([facing(np.array([200.0]), 0.125, angle)[0] for angle in tilt])
    assert np.allclose(found / found[0], np.abs(np.sinc(2 * 0.25 * np.sin(tilt) / WAVELENGTH_M)), atol=0.01)


@pytest.mark.parametrize(("range_m", "offset_m"), [(0.8, 0.0), (1.5, 0.05), (3.0, 0.1), (3.0, 0.25)])
def test_a_plate_agrees_with_the_integral_of_physical_optics(range_m: float, offset_m: float) -> None:
    across = (np.arange(400) + 0.5) / 400 * 0.25 - 0.125
    y, z = np.meshgrid(across, across)
    flown = np.sqrt(range_m**2 + (y - offset_m) ** 2 + z**2)
    wave = np.exp(-4j * np.pi / WAVELENGTH_M * flown) / flown**2
    integral = abs(np.sum(wave)) * (across[1] - across[0]) ** 2 / (4 * np.pi)
    assert facing(np.array([range_m]), 0.125, 0.0, offset_m)[0] == pytest.approx(integral, rel=0.05)


def test_nothing_comes_back_from_behind_and_a_turned_plate_does_not_vanish() -> None:
    face = Face(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), 0.25, 0.25)
    antenna = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.7, 0.72, 0.0]])
    amplitude = face_echo(face, antenna, antenna, WAVELENGTH_M, diffuse=10 ** (-15 / 20))[1]
    assert amplitude[0] == 0
    assert 0.05 < amplitude[2] / amplitude[1] < 10 ** (-15 / 20)


# What the receiver adds


@pytest.mark.parametrize("kind", ["white", "rc"])
def test_noise_has_its_level_and_its_spectrum(capture, kind: str) -> None:
    made = capture({"use": "noise", "params": {"kind": kind, "snr_db": 30.0, "sts_loss_db": 5.0}})
    crest = np.abs(made.preamble[:, 7]).mean()
    noise = made.preamble[:, 25:]
    level = np.sqrt(np.mean(magnitude(noise) ** 2))
    # Correlated over taps, its power is as sure as that of 1 / 1.75 independent samples: to 0.6 %, or 0.026 dB. The
    # modulus of a mean product of independent ones exceeds 0.03 in exp(-0.03^2 * samples / 1.75) of the draws, 2e-11.
    assert noise.size > 48_000
    assert 20 * np.log10(crest / level) == pytest.approx(30, abs=0.2)
    sts = np.sqrt(np.mean(magnitude(made.sts1[:, 25:]) ** 2))
    assert 20 * np.log10(sts / level) == pytest.approx(5, abs=0.25)
    for lag in (1, 2, 3):
        found = np.mean(noise[:, lag:] * np.conj(noise[:, :-lag])) / level**2
        pulse = RaisedCosinePulse()(np.array([lag * made.radar.sample_interval_s]))[0]
        assert abs(found - (pulse if kind == "rc" else 0.0)) < 0.03
    assert abs(np.mean(noise * made.sts1[:, 25:].conj())) < 0.03 * level * sts


def test_ringing_decays_and_stays_the_same_through_a_run(capture) -> None:
    none = {"use": "ringing", "params": {"drift": 0.0}}
    made, bare = capture(none), capture()
    added = made.preamble[:] - bare.preamble[:]
    assert np.array_equal(added, np.broadcast_to(added[:1], added.shape))
    assert np.abs(added[0, 25:]).max() < 1e-6 * np.abs(added[0]).max()
    drifting = capture({"use": "ringing", "params": {"drift": 0.02}}).preamble[:] - bare.preamble[:]
    change = np.abs(drifting - added).max() / np.abs(added).max()
    assert 0.001 < change < 0.05


def test_the_mean_power_of_ringing_is_its_profile(capture) -> None:
    params = {"returns": 1, "start_ns": 2.0, "drift": 0.0}
    short = {"trajectory.duration_s": 0.01, "radar.sts": False}
    bare = capture(**short).preamble[0]
    power = []
    for seed in range(300):
        made = capture({"use": "ringing", "params": params}, seed=seed, **short)
        power.append(np.abs(made.preamble[0] - bare).max() ** 2)
    direct = np.abs(bare).max() ** 2
    expected = 10**-0.9 * np.exp(-2 / 1.5)
    # Exponential powers spread by their mean; the crest between two taps loses up to 8 %.
    assert np.mean(power) / direct == pytest.approx(expected, rel=SIGMAS / np.sqrt(300) + 0.08)


def test_the_grid_moves_and_the_first_path_is_reported_in_64ths(capture) -> None:
    made = capture({"use": "grid"}, **{"radar.pulse": {"shape": "gauss", "fwhm_ns": 3.2}})
    reported = made.first_path_index
    assert np.array_equal(reported * 64, np.round(reported * 64))
    assert not np.array_equal(reported, made.first_path_index_sts1)
    left, right = (np.log(np.abs(made.preamble[:, tap])) for tap in (6, 8))
    curvature = -4 * np.log(2) * (made.radar.sample_interval_s / 3.2e-9) ** 2
    crest = 7 + (left - right) / (4 * curvature)  # the logarithm of a Gaussian is a parabola
    assert -0.5 <= (crest - 7).min() < -0.45
    assert 0.45 < (crest - 7).max() <= 0.5
    assert np.std(reported - crest) == pytest.approx(0.1, rel=SIGMAS / np.sqrt(2 * len(crest)))


def test_gain_and_phase_are_common_to_a_frame(capture) -> None:
    made, plain = capture({"use": "frame_gain"}), capture()
    factor = made.preamble[:, 7] / plain.preamble[:, 7]
    assert np.allclose(made.sts2[:], factor[:, None] * plain.sts2[:], rtol=1e-5, atol=1e-9)
    assert np.std(20 * np.log10(np.abs(factor))) == pytest.approx(0.5, rel=SIGMAS / np.sqrt(2 * len(factor)))
    assert abs(np.mean(factor / np.abs(factor))) < SIGMAS / np.sqrt(len(factor))
    locked = capture({"use": "frame_gain", "params": {"phase": "locked"}}).preamble[:, 7] / plain.preamble[:, 7]
    assert np.allclose(np.angle(locked), 0, atol=1e-6)


def test_the_direct_path_is_free_space_less_isolation(capture) -> None:
    strongest = np.abs(capture().preamble[0]).max()
    assert strongest == pytest.approx(WAVELENGTH_M / (4 * np.pi * 0.25) * 10 ** (-6 / 20), rel=1e-6)


# Altogether

PEAKS = """\
schema: 1
name: peaks
pipeline:
  - {use: noise_floor}
  - {use: profile.minmax}
  - {use: first_path.reported}
  - {use: peaks}
  - {use: filter.prominence, params: {minimum: 0.0}}
  - {use: filter.width, params: {minimum: 0.0}}
  - {use: score.snr, params: {gain_db_per_ns: 0.20}}
  - {use: range, params: {geometry: exact}}
"""


@pytest.mark.parametrize(
    ("range_m", "prominence", "width_taps", "score_db"), [(1, 0.63, 2.8, 41), (2, 0.36, 3.1, 35), (3, 0.19, 3.2, 31)]
)
def test_a_metal_plate_looks_as_the_model_predicts(
    tmp_path: Path, range_m: float, prominence: float, width_taps: float, score_db: float
) -> None:
    (tmp_path / "scene.yaml").write_text(f"""\
schema: 1
trajectory: {{kind: static, duration_s: 0.2}}
objects:
  - {{id: plate, shape: plate, center_m: [{range_m}, -0.125], width_m: 0.25, height_m: 0.28}}
terms: [{{use: direct}}, {{use: ringing}}, {{use: echo.plate}}, {{use: grid}}, {{use: frame_gain}}, {{use: noise}}]
""")
    (scene,) = read_scenes(tmp_path / "scene.yaml")
    detector = detector_from_yaml(PEAKS)
    found = []
    for run in range(1, 26):  # each with its own ringing
        rows = detector.run(simulate(scene, run).captures[0])
        near = np.abs(rows["range_m"] - range_m) < 0.2
        found.append(np.stack([rows[name][near] for name in ("prominence", "width_taps", "score_db")], axis=1))
    median = np.median(np.concatenate(found), axis=0)
    assert median == pytest.approx([prominence, width_taps, score_db], rel=0.3)
