"""Values of a scene that depend on its channel."""

from pathlib import Path
from typing import Any

import pytest

from uwbbench.api import ConfigError
from uwbbench_datasets.simulator.scene import Scene, read_scenes

SCENE = """\
schema: 1
trajectory: {kind: static, duration_s: 1}
objects:
  - {id: post, shape: point, center_m: [2, 0], material: {by_channel: {5: metal, 9: glass}}}
terms:
  - {use: direct}
  - use: noise
    params:
      snr_db: {by_channel: {"5": 40, other: 45}}
vary: {radar.channel: [5, 9]}
"""


@pytest.fixture
def scenes(tmp_path: Path):
    def read(text: str = SCENE, changes: dict[str, Any] | None = None) -> list[Scene]:
        path = tmp_path / "room.yaml"
        path.write_text(text)
        return read_scenes(path, changes)

    return read


def snr_db(scene: Scene) -> float:
    return float(scene.terms[1][2].snr_db)  # type: ignore[attr-defined]


def test_each_variant_takes_the_values_of_its_channel(scenes) -> None:
    found = scenes()
    assert [snr_db(scene) for scene in found] == [40, 45]
    assert [scene.model.objects[0].material for scene in found] == ["metal", "glass"]


def test_a_scene_that_names_no_channel_takes_the_values_of_the_usual_one(scenes) -> None:
    (found,) = scenes(SCENE.replace("vary: {radar.channel: [5, 9]}\n", ""))
    assert (snr_db(found), found.model.radar.channel) == (45, 9)


def test_one_channels_value_can_be_set_and_varied(scenes) -> None:
    at = "terms.noise.params.snr_db"
    assert [snr_db(scene) for scene in scenes(changes={f"{at}.by_channel.5": 30})] == [30, 45]
    table = {"by_channel": {5: 1, 9: 2}}
    found = scenes(changes={"vary": {at: [table, 3], "radar.channel": [5, 9]}})
    assert [snr_db(scene) for scene in found] == [1, 2, 3, 3]


def test_a_value_set_for_a_channel_replaces_the_one_of_the_same_number(scenes) -> None:
    (found,) = scenes(changes={"objects.post.material.by_channel.5": "wood", "radar.channel": 5})
    assert found.model.objects[0].material == "wood"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            '"5": 40, other: 45',
            '"5": 40',
            r"room.yaml:9: terms\[1\].params.snr_db: by_channel has values for 5, not fo",
        ),
        ('"5": 40, other: 45', "five: 40", r"room.yaml:9: .*by_channel expects channel numbers and 'other' as keys"),
        ('{"5": 40, other: 45}', "{}", "by_channel expects channel numbers"),
        ('{"5": 40, other: 45}', "40", "by_channel expects channel numbers"),
        ('{by_channel: {"5": 40, other: 45}}', "{by_channel: {5: 40, 9: 3}, more: 1}", "by_channel expects channel"),
        ('"5": 40, other: 45', "5: 40, 9: loud", r"room.yaml:9: terms\[1\].params.snr_db: .*found 'loud'"),
        ("[5, 9]", "[7]", "has values for 5, 9, not for channel 7"),
    ],
)
def test_a_wrong_table_is_named_with_its_line(scenes, old: str, new: str, message: str) -> None:
    assert old in SCENE
    with pytest.raises(ConfigError, match=message):
        scenes(SCENE.replace(old, new))
