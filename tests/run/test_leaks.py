"""What a detector was trained on is not scored with it."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

import uwbbench
from uwbbench.api import ConfigError, write_capture
from uwbbench.cli import app
from uwbbench.detect.pipeline import load_detector
from uwbbench.run.execute import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.leaks import refuse_trained_on, trained_on
from uwbbench.tools.gate import read_gate, run_gate
from uwbbench.tools.tune import read_tuning, tune

DETECTOR = "coupling-extra-trees"


def use(run: int, **more):
    """A capture of the scene that the shipped weights were learned on, at first of its first twelve rooms."""
    names = [f"coupling-outdoor/target-metal/{run}"]
    return {"use": "simulated", "params": {"scenes": ["coupling-outdoor"]}, "captures": names, **more}


def capture(run: int):
    return uwbbench.open_dataset("simulated", {"scenes": ["coupling-outdoor"]}).open(
        f"coupling-outdoor/target-metal/{run}"
    )


@pytest.fixture(scope="module")
def config():
    return load_detector(DETECTOR).config


def test_a_run_on_a_training_capture_is_refused_before_anything_runs(tmp_path):
    datasets = [use(20, name="others"), use(3)]
    experiment = read_experiment({"detectors": [DETECTOR, "cfar-ca"], "datasets": datasets, "latency": False})
    with pytest.raises(
        ConfigError,
        match=r"detector 'coupling-extra-trees' was trained on recordings that would be scored: "
        r"'simulated 2: coupling-outdoor/target-metal/3' \(there 'outdoor: coupling-outdoor/target-metal/3'\)",
    ):
        run_experiment(experiment, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_another_detector_may_run_on_what_a_detector_was_trained_on(tmp_path):
    datasets = [use(20, name="others"), use(3, detectors=["null"])]
    values = {"detectors": [DETECTOR, "null"], "datasets": datasets, "latency": False, "stability": False}
    run_experiment(read_experiment({**values, "scoring": "presence"}), tmp_path / "run", jobs=1)
    assert (tmp_path / "run" / "manifest.json").is_file()


def test_a_gate_on_a_training_capture_is_refused():
    accuracy = [{"metric": "f1", "scoring": "frame", "minimum": 0.1}]
    with pytest.raises(ConfigError, match="was trained on recordings"):
        run_gate(read_gate({"head": DETECTOR, "datasets": [use(3)], "accuracy": accuracy}))


@pytest.mark.parametrize(("tuned_on", "held_out"), [(3, 20), (20, 3)])
def test_a_tuning_on_a_training_capture_is_refused(tuned_on, held_out):
    grid = {"pipeline.filter.probability.params.minimum": [0.3, 0.5]}
    sides = {"tuning": [use(tuned_on)], "held_out": [use(held_out)]}
    with pytest.raises(ConfigError, match="was trained on recordings"):
        tune(read_tuning({"detector": DETECTOR, "grid": grid, **sides, "groups": ["overall"]}))


def test_a_score_on_a_training_capture_is_refused_under_any_file_name(tmp_path):
    write_capture(tmp_path / "innocent.h5", capture(3))
    words = ["score", str(tmp_path / "innocent.h5"), "--detector", DETECTOR, "--no-latency"]
    refused = CliRunner().invoke(app, words)
    assert refused.exit_code == 2
    assert "was trained on recordings that would be scored" in refused.stderr


def test_another_receiver_of_the_same_recording_is_refused(config):
    other = capture(3)
    other = replace(other, radar=replace(other.radar, receiver="side"), name="elsewhere/side")
    with pytest.raises(ConfigError, match="'mine'"):
        refuse_trained_on([config], [("mine", other)])


def test_equal_draws_are_refused_from_another_scene_too(config):
    other = capture(3)
    draws = other.recording.partition(" [")[2]
    with pytest.raises(ConfigError, match="'mine'"):
        refuse_trained_on([config], [("mine", replace(capture(20), recording=f"walker/7 [{draws}"))])


def test_equal_content_is_refused_whatever_the_recording_is_called(config):
    with pytest.raises(ConfigError, match="'mine'"):
        refuse_trained_on([config], [("mine", replace(capture(3), recording="monday"))])


@pytest.mark.parametrize("run", [13, 16])
def test_what_sizes_were_chosen_by_is_refused_too(config, run):
    with pytest.raises(ConfigError, match="'mine'"):
        refuse_trained_on([config], [("mine", capture(run))])


def test_rooms_that_were_not_seen_are_fine_with_any_robot(config):
    robot = uwbbench.open_dataset("simulated", {"scenes": ["coupling-outdoor"], "set": {"robot_seed": 2}})
    others = [capture(17), robot.open("coupling-outdoor/target-metal/17")]
    refuse_trained_on([config], [(one.name, one) for one in others])


def test_a_detector_that_has_learned_nothing_was_trained_on_nothing():
    assert not trained_on(load_detector("cfar-ca").config).names


def test_no_room_lies_on_two_sides_of_the_shipped_trainings():
    for name in ("extra-trees", "random-forest", "neighbours", "logistic"):
        file = Path("configs/training") / f"coupling-{name}.yaml"
        known = trained_on(load_detector(f"coupling-{name}").config).names.values()
        rooms = {(one.split(": ")[1].split("/")[0], int(one.rsplit("/", 1)[1])) for one in known}
        assert rooms == {(scene, run) for scene in ("coupling-outdoor", "coupling-indoor") for run in range(1, 17)}, (
            file
        )


def test_what_was_trained_on_is_named_in_the_weights_by_recording_and_hash(config):
    names = trained_on(config).names
    assert names[capture(3).sha256] == "outdoor: coupling-outdoor/target-metal/3"
    assert json.dumps(sorted(names))  # plain texts
