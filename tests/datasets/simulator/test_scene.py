"""Scene files: variants, names, and what is wrong with a wrong one."""

from pathlib import Path

import numpy as np
import pytest

import uwbbench
from uwbbench.api import CaptureError, ConfigError, PluginError, leaks
from uwbbench.api.locate import shipped
from uwbbench.api.registry import load_plugin
from uwbbench_datasets.simulator.dataset import Simulated, SimulatedParams
from uwbbench_datasets.simulator.scene import read_scenes

SCENE = """\
schema: 1
trajectory: {kind: straight, start_m: [0, 0], end_m: [0.2, 0], speed_m_s: 0.3}
objects:
  - {id: plate, shape: plate, center_m: [2.0, 0.1], width_m: 0.25, height_m: 0.28}
terms:
  - {use: direct}
  - {use: noise}
"""


@pytest.fixture
def write(tmp_path: Path):
    def made(text: str = SCENE, extra: str = "", name: str = "room.yaml") -> Path:
        path = tmp_path / name
        path.write_text(text + extra)
        return path

    return made


def test_every_combination_of_what_varies_is_a_variant_with_a_readable_name(write) -> None:
    path = write(extra="vary:\n  radar.channel: [5, 9]\n  objects.plate.material: [metal, concrete]\n")
    scenes = read_scenes(path)
    assert [scene.name for scene in scenes] == [
        "room/channel-5_material-metal",
        "room/channel-5_material-concrete",
        "room/channel-9_material-metal",
        "room/channel-9_material-concrete",
    ]
    assert [scene.model.objects[0].material for scene in scenes] == ["metal", "concrete"] * 2
    assert [scene.radar("front").channel for scene in scenes] == [5, 5, 9, 9]


def test_setting_what_varies_fixes_it(write) -> None:
    path = write(extra="vary: {radar.channel: [5, 9]}\n")
    (scene,) = read_scenes(path, {"radar.channel": 5})
    assert (scene.name, scene.model.radar.channel) == ("room", 5)


def test_paths_that_end_alike_keep_more_of_their_names(write) -> None:
    second = SCENE.replace("terms:", "  - {id: wall, shape: wall, center_m: [4, 0], width_m: 5}\nterms:")
    path = write(second, "vary:\n  objects.plate.material: [metal]\n  objects.wall.material: [concrete]\n")
    assert read_scenes(path)[0].name == "room/plate.material-metal_wall.material-concrete"


def test_terms_and_objects_are_addressed_by_name(write) -> None:
    changes = {"terms.noise.params.snr_db": 30.0, "objects.plate.width_m": 0.5}
    (scene,) = read_scenes(write(), changes)
    assert scene.terms[1][2].snr_db == 30.0  # type: ignore[attr-defined]
    assert scene.model.objects[0].width_m == 0.5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("noise}", "noize}", r"room.yaml:7: terms\[1\].use: no term named 'noize' is installed. Did you mean 'noise'"),
        ("{use: noise}", "{use: noise, params: {snr: 3}}", r"unknown key 'snr'. Did you mean 'snr_db'"),
        ("{use: noise}", "{use: direct}", "term 'direct' appears twice; name one of them with 'as'"),
        ("kind: straight", "kind: strait", "trajectory"),
        ("shape: plate", "shape: box", "a box needs depth_m"),
        ("width_m: 0.25", "radius_m: 0.25", "a plate has no radius_m"),
        ("schema: 1", "schema: 2", "schema"),
        ("schema: 1", "schema: 1\nradar: {chanel: 5}", "unknown key 'chanel'. Did you mean 'channel'"),
        ("schema: 1", "schema: 1\nradar: {crest_tap: 60}", "crest_tap must lie behind the noise_taps"),
        ("schema: 1", "schema: 1\nreceivers: {front: {tx_position_m: [0, 0]}}", "a direct path needs a distance"),
        ("schema: 1", "schema: 1\nfidelity: {force: [walls]}", "names 'walls', which is no term of the scene"),
        ("schema: 1", "schema: 1\nvary: {radar.channel: [5, 7]}", "channel"),
        ("schema: 1", "schema: 1\nvary: {objects.door.material: [metal]}", "no item 'door.material'"),
    ],
)
def test_a_wrong_scene_is_told_where_and_why(write, old, new, message) -> None:
    with pytest.raises((ConfigError, PluginError), match=message):
        read_scenes(write(SCENE.replace(old, new)))


def test_a_term_may_be_used_twice_under_two_names(write) -> None:
    text = SCENE.replace("{use: noise}", "{use: noise}\n  - {use: noise, as: hiss, params: {snr_db: 20}}")
    (scene,) = read_scenes(write(text))
    assert [use.name for use, _, _ in scene.terms] == ["direct", "noise", "hiss"]


@pytest.mark.parametrize("name", sorted(shipped("scenes")))
def test_shipped_scenes_can_be_read(name: str) -> None:
    scenes = read_scenes(shipped("scenes")[name])
    assert len({scene.name for scene in scenes}) == len(scenes)


def dataset(folder: Path, **params: object) -> Simulated:
    return Simulated(SimulatedParams.model_validate(params), [folder])


def test_the_dataset_names_scene_variant_run_and_receiver(write, tmp_path: Path) -> None:
    write(extra="runs: 2\nvary: {radar.channel: [5, 9]}\n")
    assert dataset(tmp_path, scenes=["room.yaml"]).names() == [
        "room/channel-5/1",
        "room/channel-5/2",
        "room/channel-9/1",
        "room/channel-9/2",
    ]
    assert dataset(tmp_path, scenes=["room.yaml"], runs=1, set={"radar.channel": 9}).names() == ["room/1"]
    two = {"receivers": {"front": {}, "side": {"mount_yaw_deg": 90, "mount_position_m": [0, 0.1]}}}
    names = dataset(tmp_path, scenes=["room.yaml"], runs=1, set={"radar.channel": 9, **two}).names()
    assert names == ["room/1/front", "room/1/side"]


def test_the_dataset_opens_what_it_names(write, tmp_path: Path) -> None:
    write(extra="runs: 2\n")
    made = dataset(tmp_path, scenes=["room.yaml"])
    first, second = (made.open(name) for name in made.names())
    assert (first.name, first.source) == ("room/1", "simulated")
    assert not np.array_equal(first.preamble, second.preamble)
    with pytest.raises(CaptureError, match=r"no simulated capture 'room/3'\. Did you mean"):
        made.open("room/3")


def test_two_scenes_of_one_name_are_refused(write, tmp_path: Path) -> None:
    write()
    write(extra="name: room\n", name="other.yaml")
    with pytest.raises(ConfigError, match="two scenes are named 'room'"):
        dataset(tmp_path, scenes=["room.yaml", "other.yaml"]).names()


def test_the_dataset_is_registered() -> None:
    assert load_plugin("datasets", "simulated") is Simulated


DRAWN = "draw:\n  objects.plate.center_m.1: [-0.3, 0.3]\n"


def middle_m(capture) -> float:
    return float(capture.truth.objects[0].outline_m[:, 1].mean())


def test_each_run_draws_its_own_values_within_the_ends_and_the_same_ones_again(write) -> None:
    dataset = Simulated(SimulatedParams(scenes=[str(write(extra=DRAWN))], runs=5, seed=4), [])
    places = [middle_m(dataset.open(name)) for name in dataset.names()]
    assert len(set(places)) == 5
    assert all(-0.3 <= place <= 0.3 for place in places)
    again = Simulated(SimulatedParams(scenes=[str(write(extra=DRAWN))], runs=5, seed=4), [])
    assert again.open("room/3").sha256 == dataset.open("room/3").sha256


def test_runs_that_draw_places_are_scenes_of_their_own_and_others_are_not(write) -> None:
    for text, scenes in ((DRAWN, {"room/1", "room/2"}), ("", {"room"})):
        dataset = Simulated(SimulatedParams(scenes=[str(write(extra=text))], runs=2), [])
        assert {dataset.scene(name) for name in dataset.names()} == scenes


def test_a_drawn_value_that_leads_nowhere_is_named_before_anything_is_simulated(write) -> None:
    with pytest.raises(ConfigError, match="no item 'plat"):
        read_scenes(write(extra="draw:\n  objects.plat.center_m.1: [-0.3, 0.3]\n"))


def test_the_seed_of_the_dataset_gives_every_scene_and_variant_other_draws(write) -> None:
    path = str(write(extra="vary:\n  objects.plate.material: [metal, plywood]\n" + DRAWN))

    def places(seed: int | None) -> list[float]:
        dataset = Simulated(SimulatedParams(scenes=[path], seed=seed), [])
        return [middle_m(dataset.open(name)) for name in dataset.names()]

    first, second = places(None)
    assert first == second  # the seed of the scene: the same for both variants
    assert len({*places(1), *places(2)}) == 4


PLACES = """
schema: 1
seed: 3
runs: 2
trajectory: {kind: straight, start_m: [0, 0], end_m: [0.2, 0], speed_m_s: 1}
objects: [{id: target, shape: point, center_m: [2, 0]}, {id: left, shape: wall, center_m: [1, 2], width_m: 4}]
vary: {objects.target: [null, {id: box, shape: point, center_m: [2, 0]}]}
draw: {objects.left.center_m.1: [1, 3]}
terms: [{use: direct}, {use: noise}]
"""


def captures_of_places(tmp_path, draw_seed: str, **params):
    path = tmp_path / "places.yaml"
    path.write_text(f"{PLACES}draw_seed: {draw_seed}\n")
    dataset = uwbbench.open_dataset("simulated", {"scenes": [str(path)], **params})
    return [dataset.open(name) for name in dataset.names()]


@pytest.mark.parametrize("params", [{}, {"seed": 9}])
def test_variants_with_a_draw_seed_share_their_places_and_no_noise(tmp_path, params):
    nothing, _, box, other = captures_of_places(tmp_path, "5", **params)
    walls = [one.truth.objects[-1].outline_m.tolist() for one in (nothing, box, other)]
    assert walls[0] == walls[1] != walls[2]
    assert nothing.name == "places/target-None/1"
    assert [item.name for item in box.truth.objects] == ["box", "left"]
    assert [item.name for item in nothing.truth.objects] == ["left"]
    assert not leaks(nothing.recording, box.recording)
    assert not np.any(nothing.preamble[:, :2] == box.preamble[:, :2])


def test_without_a_draw_seed_variants_share_their_draws_and_leak(tmp_path):
    nothing, _, box, _ = captures_of_places(tmp_path, "null")
    assert leaks(nothing.recording, box.recording)
