"""Weights files: written, pinned by their content, and refused where they do not fit."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from uwbbench.api import (
    Block,
    ConfigError,
    Detections,
    LearnedParams,
    Params,
    Stage,
    Weights,
    expect_arrays,
    ports,
    registry,
)
from uwbbench.api.weights import About, LearnedFrom, StepBefore, contents, sampling_of
from uwbbench.detect.pipeline import detector_from_yaml, load_detector


class LevelParams(LearnedParams):
    """What is learned and what may be changed afterwards."""

    after_training = LearnedParams.after_training | {"factor"}
    power: float = 1.0
    factor: float = 1.0


class Level(Stage[LevelParams]):
    """One row a frame, whose amplitude is what was learned."""

    consumes = ports("frames")
    produces = ports("detections", "amplitude")

    def fit(self, examples: Any, *, seed: int, validation: Any) -> Weights:
        level = np.mean([np.abs(one.block.frames.preamble).mean() for one in examples])
        return {"level": np.array([level])}

    def load(self, weights: Weights) -> None:
        expect_arrays(weights, {"level": ("float64", (1,))})
        self.level = float(weights["level"][0])

    def step(self, block: Block) -> Block:
        frames = block.frames.index
        return block.replace(detections=Detections(frames, amplitude=np.full(len(frames), self.level)))


class Other(Stage[Params]):
    """Another stage."""


@pytest.fixture(scope="module", autouse=True)
def stages():
    registry.register("stages", "test.level", Level)
    registry.register("stages", "test.other", Other)
    yield
    for name in ("test.level", "test.other"):
        del registry._registered["stages", name]
    registry.entries.cache_clear()
    registry.load_plugin.cache_clear()


def about(approach, **changes: Any) -> About:
    facts: dict[str, Any] = {
        "plugin": "test.level",
        "params": {"power": 1.0},
        "before": (),
        "source": "",
        "radars": (sampling_of(approach.radar),),
        "captures": (LearnedFrom(role="training", dataset="d", capture="c", sha256="0" * 64, recording="c"),),
        "seed": 0,
        "versions": {},
    }
    return About(**{**facts, **changes})


def written(path: Path, facts: About, **arrays: Any) -> str:
    """Write weights; the hash of the file."""
    content = contents(arrays or {"level": np.array([2.5])}, facts)
    path.write_bytes(content)
    return hashlib.sha256(content).hexdigest()


def detector(folder: Path, params: str = "weights: mine.safetensors", before: str = "") -> Path:
    path = folder / "mine.yaml"
    path.write_text(f"schema: 1\nname: mine\npipeline:\n{before}  - {{use: test.level, params: {{{params}}}}}\n")
    return path


def test_a_stage_is_given_what_it_learned(tmp_path, approach):
    written(tmp_path / "mine.safetensors", about(approach))
    found = load_detector(detector(tmp_path)).run(approach)
    assert (found["amplitude"] == 2.5).all()
    assert len(found) == len(approach)


def test_the_same_weights_give_the_same_bytes(approach):
    arrays = {"b": np.arange(3.0), "a": np.ones(2, np.int16)}
    assert contents(arrays, about(approach)) == contents(dict(reversed(arrays.items())), about(approach))


def test_the_identity_of_a_detector_follows_the_content_of_its_weights_and_not_their_place(tmp_path, approach):
    (tmp_path / "elsewhere").mkdir()
    identities = []
    for folder, level in ((tmp_path, 1.0), (tmp_path / "elsewhere", 1.0), (tmp_path, 2.0)):
        written(folder / "mine.safetensors", about(approach), level=np.array([level]))
        identities.append(load_detector(detector(folder)).identity)
    assert identities[0] == identities[1] != identities[2]
    assert str(tmp_path) not in json.dumps(load_detector(detector(tmp_path)).config.to_dict())


def test_an_extending_detector_finds_the_weights_of_the_one_that_it_extends(tmp_path, approach):
    written(tmp_path / "mine.safetensors", about(approach))
    detector(tmp_path)
    (tmp_path / "below").mkdir()
    child = tmp_path / "below" / "child.yaml"
    child.write_text("schema: 1\nextends: ../mine.yaml\nname: child\nset: {pipeline.test.level.params.factor: 2}\n")
    assert (load_detector(child).run(approach)["amplitude"] == 2.5).all()


def test_weights_that_were_changed_after_they_were_pinned_are_refused(tmp_path, approach):
    path = tmp_path / "mine.safetensors"
    sha256 = written(path, about(approach))
    pipeline = load_detector(detector(tmp_path, f"weights: {path}@{sha256}"))
    changed = bytearray(path.read_bytes())
    changed[-1] ^= 1
    path.write_bytes(changed)
    with pytest.raises(ConfigError, match=rf"mine\.safetensors: its content has the hash .* not {sha256[:12]}"):
        pipeline.open(approach)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda content: content[:-3], "is no safetensors file, or a damaged one"),
        (lambda content: b"", "is no safetensors file, or a damaged one"),
        (lambda content: b"\x80\x04K\x01.", "is no safetensors file, or a damaged one"),  # a pickle
        (lambda content: content.replace(b"uwbbench-weights", b"uwbbench_weights"), "was not written by"),
        (lambda content: content.replace(b'"uwbbench"', b'"somebody"'), "was not written by 'uwbbench train'"),
    ],
)
def test_what_is_no_weights_file_is_refused_with_its_name(tmp_path, approach, change, message):
    path = tmp_path / "mine.safetensors"
    written(path, about(approach))
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(ConfigError, match=rf"step 'test\.level'.*mine\.safetensors: {message}"):
        load_detector(detector(tmp_path)).open(approach)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plugin": "test.other"}, "these are weights of the stage 'test.other'"),
        ({"plugin": "gone"}, "no stage named 'gone'"),
        ({"params": {"power": 2.0}}, "was learned with power 2.0, and power is 1.0 here"),
        (
            {"before": (StepBefore(use="align", params={}),)},
            "was learned behind the steps align, and stands behind none",
        ),
    ],
)
def test_weights_of_something_else_are_refused(tmp_path, approach, changes, message):
    written(tmp_path / "mine.safetensors", about(approach, **changes))
    with pytest.raises(ConfigError, match=message):
        load_detector(detector(tmp_path)).open(approach)


def test_weights_learned_behind_other_values_of_a_step_are_refused(tmp_path, approach):
    before = load_detector(detector(tmp_path, "weights: null", "  - {use: align, params: {to_tap: 5}}\n"))
    steps = tuple(StepBefore(**one) for one in before.steps_before("test.level", 9))
    written(tmp_path / "mine.safetensors", about(approach, before=steps))
    with pytest.raises(ConfigError, match=r"was learned behind 'align' with to_tap 5\.0, and to_tap is 6\.0 here"):
        load_detector(detector(tmp_path, before="  - {use: align, params: {to_tap: 6}}\n")).open(approach)


def test_weights_of_another_radar_are_refused(tmp_path, approach):
    other = {**sampling_of(approach.radar), "sample_interval_s": 61e-12}
    written(tmp_path / "mine.safetensors", about(approach, radars=(other,)))
    with pytest.raises(ConfigError, match=r"was learned from radars with .* sample_interval_s 6.1e-11, .*this one has"):
        load_detector(detector(tmp_path)).open(approach)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.array([np.nan]), "array 'level' holds values that are not finite"),
        (np.array([1.0, 2.0]), r"array 'level' is float64 of shape \(2,\), expected float64 of \(1\)"),
        (np.array([1], np.int32), "array 'level' is int32 of shape"),
    ],
)
def test_arrays_that_a_stage_does_not_expect_are_refused(tmp_path, approach, array, message):
    written(tmp_path / "mine.safetensors", about(approach), level=array)
    with pytest.raises(ConfigError, match=rf"mine\.safetensors: {message}"):
        load_detector(detector(tmp_path)).open(approach)


def test_lengths_of_one_axis_must_agree():
    with pytest.raises(ConfigError, match=r"array 'b' is float64 of shape \(4,\), expected float64 of \(3\)"):
        expect_arrays({"a": np.zeros(3), "b": np.zeros(4)}, {"a": ("float64", ("n",)), "b": ("float64", ("n",))})


def test_missing_and_unknown_arrays_are_named():
    with pytest.raises(ConfigError, match="array 'a' is missing"):
        expect_arrays({}, {"a": ("float64", ())})
    with pytest.raises(ConfigError, match="array 'b' is unknown here"):
        expect_arrays({"b": np.zeros(1)}, {})


@pytest.mark.parametrize("name", ["../mine.safetensors", "/etc/mine.safetensors"])
def test_a_path_that_leads_out_of_the_detectors_folder_is_refused(tmp_path, name):
    with pytest.raises(ConfigError, match="must lie beside the file that names them"):
        load_detector(detector(tmp_path, f"weights: {name}"))


def test_weights_that_are_not_there_are_refused_with_file_line_and_key(tmp_path):
    with pytest.raises(
        ConfigError, match=r"mine\.yaml:4: pipeline\[0\]\.params\.weights: no weights 'mine\.safetensors'"
    ):
        load_detector(detector(tmp_path))


def test_a_detector_that_has_not_been_trained_says_so(approach):
    pipeline = detector_from_yaml("schema: 1\nname: x\npipeline: [{use: test.level, params: {weights: null}}]")
    with pytest.raises(ConfigError, match=r"step 'test.level': has no weights: train them with 'uwbbench train'"):
        pipeline.open(approach)


def test_what_learning_does_not_look_at_may_be_changed_afterwards(tmp_path, approach):
    written(tmp_path / "mine.safetensors", about(approach))
    assert len(load_detector(detector(tmp_path, "weights: mine.safetensors, factor: 3")).run(approach))
