"""Adding up a scene: against a direct sum, and the same whatever the threads, processes and other terms."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import CaptureError, Paths, Term, View
from uwbbench.api.registry import load_plugin
from uwbbench_datasets.simulator.engine import add_paths, simulate
from uwbbench_datasets.simulator.pulses import GaussianPulse, RaisedCosinePulse
from uwbbench_datasets.simulator.scene import Scene, read_scenes

SCENE = """\
schema: 1
trajectory: {kind: straight, start_m: [0, 0], end_m: [1.0, 0], speed_m_s: 0.3}
objects:
  - {id: plate, shape: plate, center_m: [2.0, 0.1], width_m: 0.25, height_m: 0.28}
terms: [{use: direct}, {use: ringing}, {use: echo.plate}, {use: grid}, {use: frame_gain}, {use: noise}]
"""


@pytest.fixture
def scene(tmp_path: Path):
    def make(**changes: object) -> Scene:
        path = tmp_path / "scene.yaml"
        path.write_text(SCENE)
        return read_scenes(path, changes)[0]

    return make


def a_view(taps: int, crest_tap: np.ndarray, pulse) -> View:
    """A view of which only what synthesis needs matters."""
    adapter = load_plugin("datasets", "approach")
    radar = adapter(adapter.params_type()(), ()).open("approach-ch9-metal-1").radar
    frames = len(crest_tap)
    zeros = np.zeros((frames, 3))
    return View(
        radar=type(radar)(**{**radar.to_dict(), "taps": taps}),
        first=0,
        timestamp_s=np.arange(frames) / 48.0,
        receiver_m=zeros,
        transmitter_m=zeros,
        boresight_rad=np.zeros(frames),
        objects=(),
        visibility=np.ones((frames, 0)),
        crest_tap=crest_tap,
        direct_amplitude=1.0,
        receive_gain=np.ones_like,
        array_phase=lambda azimuth_rad: 2.5 * np.sin(azimuth_rad),
        pulse=pulse,
    )


def summed(paths: Paths, view: View) -> np.ndarray:
    """The same sum, one path of one frame at a time, on all taps."""
    interval, taps = view.radar.sample_interval_s, view.radar.taps
    out = np.zeros((2, len(view), taps), complex)
    shape = (len(view), paths.delay_s.shape[1])
    delay, amplitude, azimuth = (
        np.broadcast_to(part, shape) for part in (paths.delay_s, paths.amplitude, paths.azimuth_rad)
    )
    for frame in range(shape[0]):
        for path in range(shape[1]):
            time_s = (np.arange(taps) - view.crest_tap[frame]) * interval - delay[frame, path]
            for antenna in range(2):
                turned = amplitude[frame, path] * np.exp(1j * antenna * view.array_phase(azimuth[frame, path]))
                out[antenna, frame] += turned * view.pulse(time_s)
    return out


@settings(max_examples=40, deadline=None)
@given(
    taps=st.integers(8, 120),
    count=st.integers(1, 6),
    frames=st.integers(1, 5),
    spread_ns=st.sampled_from([0.0, 3.0, 40.0, 400.0]),
    pulse=st.sampled_from([GaussianPulse(3.2e-9), GaussianPulse(0.9e-9), RaisedCosinePulse()]),
    seed=st.integers(0, 2**16),
)
def test_pulses_add_up_as_in_a_plain_loop(taps, count, frames, spread_ns, pulse, seed) -> None:
    rng = np.random.default_rng(seed)
    view = a_view(taps, 4 + rng.uniform(-0.5, 0.5, frames), pulse)
    delay_s = rng.uniform(-5e-9, spread_ns * 1e-9, (frames, count))  # partly before the first tap, partly past the last
    amplitude = rng.normal(size=(1, count)) + 1j * rng.normal(size=(1, count))
    paths = Paths(delay_s, amplitude, rng.uniform(-2, 2, (frames, count)))
    found = np.zeros((2, frames, taps), complex)
    add_paths(found, paths, view)
    assert np.allclose(found, summed(paths, view), rtol=0, atol=1e-11)


def test_a_term_without_paths_adds_nothing() -> None:
    view = a_view(50, np.full(3, 7.0), GaussianPulse(3.2e-9))
    found = np.zeros((2, 3, 50), complex)
    add_paths(found, Paths(np.zeros((3, 0)), np.zeros((3, 0), complex), np.zeros((3, 0))), view)
    assert not found.any()


def test_a_path_that_is_not_finite_is_named() -> None:
    view = a_view(50, np.full(3, 7.0), GaussianPulse(3.2e-9))
    paths = Paths(np.full((1, 1), np.nan), np.ones((1, 1), complex), np.zeros((1, 1)))
    with pytest.raises(CaptureError, match="term 'mine' gives a path whose delay or amplitude is not finite"):
        add_paths(np.zeros((2, 3, 50), complex), paths, view, "mine")


def test_the_number_of_threads_changes_no_bit(scene) -> None:
    slow = scene(**{"trajectory.speed_m_s": 0.02})  # several blocks
    one, three = simulate(slow).captures[0], simulate(slow, threads=3).captures[0]
    assert len(one) > 2048
    assert one.sha256 == three.sha256


def test_another_process_gives_the_same_bits(scene, tmp_path: Path) -> None:
    here = simulate(scene()).captures[0].sha256
    script = (
        "import sys; from pathlib import Path\n"
        "from uwbbench_datasets.simulator.engine import simulate\n"
        "from uwbbench_datasets.simulator.scene import read_scenes\n"
        "print(simulate(read_scenes(Path(sys.argv[1]))[0]).captures[0].sha256)\n"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "scene.yaml")]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == here


def test_runs_and_seeds_differ(scene) -> None:
    contents = {simulate(scene(), run).captures[0].sha256 for run in (1, 2)}
    assert len(contents | {simulate(scene(seed=2)).captures[0].sha256}) == 3


def test_removing_a_term_changes_nothing_that_the_others_draw(scene) -> None:
    rest = [{"use": use} for use in ("direct", "echo.plate", "grid", "frame_gain", "noise")]
    locked = {"terms.ringing.params.level_db": -400.0, "fidelity.mode": "all"}
    with_silent = simulate(scene(**locked)).captures[0]
    without = simulate(scene(terms=rest)).captures[0]
    assert np.allclose(with_silent.preamble, without.preamble, rtol=0, atol=1e-15)
    assert np.array_equal(with_silent.first_path_index, without.first_path_index)


def test_receivers_share_the_run_and_differ_in_noise(scene) -> None:
    receivers = {"front": {}, "left": {"mount_yaw_deg": 90.0, "tx_position_m": [0.25, 0.0]}}
    front, left = simulate(scene(receivers=receivers)).captures
    assert (front.name, left.name) == ("scene/1/front", "scene/1/left")
    assert front.receivers == left.receivers == ("front", "left")
    assert np.array_equal(front.trajectory.position_m, left.trajectory.position_m)
    assert not np.array_equal(front.preamble[:, :4], left.preamble[:, :4])
    assert np.array_equal(front.preamble, simulate(scene()).captures[0].preamble)


def test_without_sts_the_preamble_stays_the_same(scene) -> None:
    bare = simulate(scene(**{"radar.sts": False})).captures[0]
    assert bare.sts1 is None
    assert bare.first_path_index_sts1 is None
    quiet = {"terms": [{"use": "direct"}, {"use": "echo.plate"}]}
    assert np.array_equal(
        simulate(scene(**quiet)).captures[0].preamble,
        simulate(scene(**quiet, **{"radar.sts": False})).captures[0].preamble,
    )


def test_the_second_antenna_sees_the_phase_of_its_spacing(scene) -> None:
    still = {"kind": "static", "duration_s": 0.1}
    target = [{"id": "target", "shape": "point", "center_m": [1.5, 1.0]}]
    capture = simulate(scene(trajectory=still, objects=target, terms=[{"use": "echo.point"}])).captures[0]
    crest = int(np.argmax(np.abs(capture.sts1[0])))
    found = np.angle(capture.sts2[0, crest] * np.conj(capture.sts1[0, crest]))
    expected = 2 * np.pi * 17.8e-3 / capture.radar.wavelength_m * np.sin(np.arctan2(1.0, 1.5))
    assert np.exp(1j * found) == pytest.approx(np.exp(1j * expected), abs=1e-5)


def test_a_simulated_capture_says_so_and_has_exact_truth(scene) -> None:
    capture = simulate(scene()).captures[0]
    assert capture.source == "simulated"
    assert "Simulated" in capture.description
    sight = capture.truth.seen_from(capture.radar, capture.trajectory)
    x = capture.trajectory.position_m[:, 0]
    assert np.allclose(sight.range_m[:, 0], 1.999 - x)  # the near face of a plate 2 mm deep


def test_hooks_that_a_term_does_not_have_cost_nothing(scene) -> None:
    costs = {one.name: one for one in simulate(scene()).contributions["front"]}
    assert costs["direct"].pulses == len(simulate(scene()).captures[0])
    assert costs["noise"].pulses == 0
    assert Term.paths is load_plugin("terms", "noise").paths


def test_captures_of_earlier_versions_come_out_again(run_scene) -> None:
    """Samples written down before scenes could name a robot: another order of draws gives others altogether."""
    box = {"id": "box", "shape": "box", "center_m": [1.5, 0.8], "yaw_deg": 180, "material": "plywood"}
    objects = [
        {"id": "plate", "shape": "plate", "center_m": [2.0, 0.1], "yaw_deg": 180, "width_m": 0.25, "height_m": 0.28},
        {**box, "width_m": 0.3, "depth_m": 0.3, "height_m": 0.3},
        {"id": "post", "shape": "point", "center_m": [1.2, -0.5]},
        {"id": "wall", "shape": "wall", "center_m": [3.0, 0.0], "yaw_deg": 180, "width_m": 4.0, "material": "concrete"},
    ]
    uses = "direct antenna array ringing echo.plate echo.point echo.wall clutter.wall ghost.wall grid frame_gain noise"
    capture = run_scene(
        [{"use": use} for use in [*uses.split(), "odometry"]],
        receivers={"front": {"mount_position_m": [0.0, 0.125], "tx_position_m": [0.0, -0.125]}},
        trajectory={"kind": "straight", "start_m": [0, 0], "end_m": [0.3, 0], "speed_m_s": 0.3},
        objects=objects,
    )
    frame, tap = np.array([0, 17, 48]), np.array([8, 20, 27])
    preamble = np.array([7643.8311 + 1007.8108j, 812.0195 + 335.7795j, -17.1987 + 63.6537j]) * 1e-6
    second = np.array([-1856.4109 - 3944.3066j, 1004.8751 + 156.1976j, -36.4260 + 46.3488j]) * 1e-6
    assert capture.sts2 is not None
    assert capture.preamble[frame, tap] == pytest.approx(preamble, rel=0, abs=1e-9)
    assert capture.sts2[frame, tap] == pytest.approx(second, rel=0, abs=1e-9)
    assert capture.first_path_index is not None
    assert capture.first_path_index[frame].tolist() == [6.953125, 6.921875, 6.78125]
    assert capture.odometry_position_m is not None
    assert capture.odometry_position_m[48, :2] == pytest.approx([0.29130326, -0.00069911], abs=1e-8)
