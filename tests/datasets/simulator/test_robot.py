"""Robots: what belongs to one is the same wherever it drives, and nothing else is."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from uwbbench.api import Capture, ConfigError, PluginError
from uwbbench.api.locate import shipped
from uwbbench_datasets.simulator.engine import simulate
from uwbbench_datasets.simulator.robot import read_robot
from uwbbench_datasets.simulator.scene import Scene, read_scenes

ROBOT = """\
schema: 1
name: rover
radar: {sample_interval_ns: 1.0016, taps: 50}
seed: 7
channels:
  5:
    pulse: {fwhm_ns: 2.5}
    terms:
      direct: {isolation_db: 3.0}
      ringing: {level_db: -6.0}
  9:
    terms: {ringing: {level_db: -20.0}}
"""
SCENE = """\
schema: 1
trajectory: {kind: static, duration_s: 0.2}
terms: [{use: direct}, {use: ringing, params: {drift: 0}}]
"""


@pytest.fixture
def scenes(tmp_path: Path):
    """Scenes beside the file of a robot."""

    def read(changes: dict[str, Any] | None = None, robot: str = ROBOT, scene: str = SCENE) -> list[Scene]:
        (tmp_path / "rover.yaml").write_text(robot)
        path = tmp_path / "room.yaml"
        path.write_text(scene)
        return read_scenes(path, {"robot": "rover.yaml", **(changes or {})})

    return read


def frames(scene: Scene, run: int = 1) -> np.ndarray:
    return simulate(scene, run).captures[0].preamble


def test_the_ringing_of_a_robot_is_the_same_in_all_runs_and_scenes(scenes) -> None:
    first = frames(*scenes())
    other_scene = {"seed": 99, "trajectory": {"kind": "static", "duration_s": 0.4}, "name": "other"}
    assert np.array_equal(first, frames(*scenes(), run=2))
    assert np.array_equal(first, frames(*scenes(other_scene))[: len(first)])


def test_without_a_robot_each_run_and_seed_draws_its_ringing(scenes) -> None:
    without = [frames(*scenes({"robot": None})), frames(*scenes({"robot": None}), run=2)]
    without.append(frames(*scenes({"robot": None, "seed": 2})))
    assert len({one.tobytes() for one in without}) == 3


def test_noise_of_a_robot_is_drawn_anew_in_each_run(scenes) -> None:
    scene = SCENE.replace("}]", "}, {use: noise}, {use: grid}, {use: frame_gain}]")
    (found,) = scenes(scene=scene)
    one, two = simulate(found).captures[0], simulate(found, 2).captures[0]
    assert not np.array_equal(one.preamble, two.preamble)
    assert not np.array_equal(one.first_path_index, two.first_path_index)


def test_a_seed_alone_makes_a_robot_too(scenes) -> None:
    seeds = [scenes({"robot": None, "robot_seed": seed})[0] for seed in (1, 2, 1)]
    one, two, again = (frames(scene, run) for run, scene in enumerate(seeds, 1))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, two)


def test_robots_can_be_swept(scenes) -> None:
    found = scenes({"vary": {"robot_seed": [7, 8]}})
    assert [scene.name for scene in found] == ["room/robot_seed-7", "room/robot_seed-8"]
    same, other = (frames(scene) for scene in found)
    assert np.array_equal(same, frames(*scenes()))  # 7 is the seed in the file
    assert not np.array_equal(same, other)


def test_receivers_of_one_robot_ring_each_in_their_way(scenes) -> None:
    two = {"receivers": {"front": {}, "side": {"mount_yaw_deg": 90}}}
    front, side = simulate(*scenes(two)).captures
    assert not np.array_equal(front.preamble, side.preamble)
    assert np.array_equal(front.preamble, frames(*scenes()))


def test_a_robot_gives_the_parameters_of_the_scenes_channel(scenes) -> None:
    five, nine = (scenes({"radar.channel": channel})[0] for channel in (5, 9))
    assert [params.model_dump()["level_db"] for _, _, params in (five.terms[1], nine.terms[1])] == [-6.0, -20.0]
    assert five.terms[0][2].isolation_db == 3.0  # type: ignore[attr-defined]
    assert five.terms[1][2].drift == 0  # type: ignore[attr-defined]  # what only the scene says
    assert (five.model.radar.pulse.fwhm_ns, nine.model.radar.pulse.fwhm_ns) == (2.5, 3.2)


def test_an_error_of_the_array_is_the_robots(scenes) -> None:
    scene = SCENE.replace("[{use: direct}", "[{use: array, params: {offset_sd_deg: 20}}, {use: direct}")

    def between(run: int, seed: int) -> float:
        capture: Capture = simulate(scenes({"robot": None, "robot_seed": seed}, scene=scene)[0], run).captures[0]
        assert capture.sts1 is not None and capture.sts2 is not None  # noqa: PT018
        return float(np.angle(np.sum(capture.sts2 * np.conj(capture.sts1))))

    assert between(1, 5) == between(2, 5) != between(1, 6)


def test_ringing_can_be_given_by_its_returns(make_view, make_term, rng) -> None:
    view = make_view([[0, 0]])
    known = [{"delay_ns": 2.0, "level_db": -20.0, "phase_deg": 90.0}, {"delay_ns": 5.0, "level_db": -40.0}]
    term = make_term("ringing", taps=known, drift=0.0)
    term.prepare(view, rng)
    paths = term.paths(view, rng)
    assert paths.delay_s == pytest.approx(np.array([[2e-9, 5e-9]]))
    assert paths.amplitude == pytest.approx(np.array([[0.1j, 0.01]]))
    assert term.bound(view) == pytest.approx(0.11)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("  9:", "  8:", r"room.yaml: robot: robot 'rover' \(.*rover.yaml\) has no channel 9; it has 5, 8"),
        ("1.0016", "0.5", "robot of another radar: it samples every 0.5 ns, a scene's every 1.0016 ns"),
        ("taps: 50", "taps: 1016", "robot of another radar: its frames have 1016 taps, the scene's 50"),
        ("ringing: {level_db: -20.0}", "noize: {}", r"rover.yaml:12: channels\[9\].terms.noize: no term named 'noize'"),
        ("level_db: -20.0", "level: -20.0", r"rover.yaml:12: .*unknown key 'level'. Did you mean 'level_db'"),
        ("{level_db: -20.0}", "{decay_ns: -1}", "rover.yaml:12: .*decay_ns.*greater than 0"),
        ("ringing: {level_db: -20.0}", "grid: {}", "'grid' is no part of a robot; it belongs to the scene"),
        (
            "ringing: {level_db: -20.0}",
            "array: {}",
            r"describes the term 'array', which the scene lacks: add {use: array}",
        ),
        ("level_db: -20.0", "drift: 0.1", r"terms\[1\].params.drift: robot 'rover' .* says what this is"),
        ("seed: 7", "", "rover.yaml: key 'seed' is missing"),
        ("  9:\n    terms", "  9:\n    pulse: {shape: sinc}\n    terms", r"channels.*pulse.shape"),
    ],
)
def test_a_robot_that_does_not_fit_is_refused(scenes, old: str, new: str, message: str) -> None:
    assert old in ROBOT
    with pytest.raises((ConfigError, PluginError), match=message):
        scenes(robot=ROBOT.replace(old, new))


def test_a_pulse_is_the_scenes_or_the_robots(scenes) -> None:
    with pytest.raises(ConfigError, match=r"radar.pulse: robot 'rover' .* says what this is; leave it out"):
        scenes({"radar": {"channel": 5, "pulse": {"fwhm_ns": 3.0}}})


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("../rover.yaml", "room.yaml: robot: the robot's file '../rover.yaml' must lie in the scene's folder"),
        ("lost.yaml", "lost.yaml: cannot be read"),
        ("rover-that-nobody-ships", "no robot named 'rover-that-nobody-ships'"),
    ],
)
def test_a_robot_that_cannot_be_found_is_named(scenes, name: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        scenes({"robot": name})


def test_captures_say_which_robot_made_them(scenes) -> None:
    assert "Robot rover, seed 7." in simulate(*scenes()).captures[0].description
    assert (
        "Robot without a file, seed 3." in simulate(*scenes({"robot": None, "robot_seed": 3})).captures[0].description
    )
    assert "Robot" not in simulate(*scenes({"robot": None})).captures[0].description


@pytest.mark.parametrize("name", sorted(shipped("robots")))
def test_shipped_robots_can_be_read(name: str) -> None:
    robot = read_robot(name, Path(), "here")
    assert robot.model.name == name
    assert set(robot.model.channels) == {5, 9}
