"""Training: what is learned from, what is refused, and that the same seed gives the same bytes."""

import json
from typing import Any

import numpy as np
import pytest

from uwbbench.api import ConfigError
from uwbbench.api.arrays import locked
from uwbbench.api.weights import load_weights
from uwbbench.detect.pipeline import detector_from_yaml, load_detector
from uwbbench.tools.train import publish, read_training, train
from uwbbench.tools.train.execute import _captures, _prepared
from uwbbench_detectors.classify.trees import Trees, TreesParams

QUICK = {"trajectory.speed_m_s": 4.0}


def use(*runs: int, label: str | None = None, robot: int = 1, targets: str = "*", scene: str = "coupling-outdoor"):
    """Captures of the coupling scene: 31 frames each."""
    return {
        "use": "simulated",
        **({} if label is None else {"name": label}),
        "params": {"scenes": [scene], "set": {**QUICK, "robot_seed": robot}},
        "captures": [f"{scene}/target-{targets}/{run}" for run in runs],
    }


def file(**changes: Any) -> dict[str, Any]:
    """A training of a small forest."""
    data = {
        "name": "small",
        "detector": "coupling-extra-trees",
        "set": {"pipeline.classify.trees.params.trees": 8, "pipeline.classify.trees.params.min_samples_leaf": 3},
        "training": [use(1, 2)],
        "split": {"by": "room", "variants": "/target-[^/]+"},
        "seed": 5,
    }
    return {**data, **changes}


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes():
    first, again = (train(read_training(file())) for _ in range(2))
    assert first.content == again.content


@pytest.mark.slow
def test_what_was_trained_is_written_with_a_summary_and_runs(tmp_path):
    trained = train(read_training(file(held_out=[use(3, label="others"), use(3, label="robot 2", robot=2)])))
    path = tmp_path / "mine.safetensors"
    summary = json.loads(publish(trained, path).read_text())
    assert [one["on"] for one in summary["scores"]] == ["training: simulated", "held out: others", "held out: robot 2"]
    assert summary["source"] == "simulated"
    assert str(tmp_path) not in json.dumps(summary)
    found = summary["scores"][0]
    assert found["accuracy"] > 0.8
    assert found["frames"] == 6 * 32
    detector = tmp_path / "mine.yaml"
    values = "{trees: 8, min_samples_leaf: 3, weights: mine.safetensors}"
    detector.write_text(
        f"schema: 1\nextends: coupling-extra-trees\nname: mine\nset:\n  pipeline.classify.trees.params: {values}\n"
        "  pipeline.filter.probability.params.minimum: 0\n"
    )
    training = read_training(file())
    (_, one, _), *_ = _captures(training, lambda _: None)
    rows = load_detector(detector).run(one.capture)
    assert len(rows)
    assert np.allclose(sum(rows[f"class_probability_{name}"] for name in ("empty", "metal", "person")), 1)


@pytest.mark.slow
def test_each_fold_is_tried_on_rooms_that_its_weights_have_not_seen():
    split = {"by": "room", "variants": "/target-[^/]+", "folds": 2}
    trained = train(read_training(file(split=split)))
    assert [one.on for one in trained.scores][1:] == ["fold 1 of 2, by room", "fold 2 of 2, by room"]
    assert [(one.captures, one.units) for one in trained.scores][1:] == [(3, 1), (3, 1)]


@pytest.fixture(scope="module")
def rooms() -> tuple[Any, Any, Any]:
    """Features of all frames of four places behind the steps before the trees, with their class and place."""
    captures = {**use(1, 2, 3, 4), "params": {"scenes": ["coupling-outdoor"]}}
    training = read_training(file(training=[captures]))
    opened = _captures(training, lambda _: None)
    stage = Trees(TreesParams(weights=None))
    parts = []
    for place in range(len(opened)):
        one = _prepared(training, opened, place, lambda _: None)
        features, label = stage.labelled([one.example])
        parts.append((features, label, np.full(len(label), int(one.unit.rsplit("/", 1)[1]))))
    features, label, room = (np.concatenate(values) for values in zip(*parts, strict=True))
    return features, label, room


def accuracy(features: Any, label: Any, side: Any, true: Any) -> float:
    """Share of right answers on each side after learning from all others, over all frames together."""
    stage = Trees(TreesParams(weights=None, trees=20))
    right = []
    for one in np.unique(side):
        weights = stage.learn(features[side != one], label[side != one], 1)
        stage.load({name: locked(values) for name, values in weights.items()})
        right.append(stage.probabilities(features[side == one]).argmax(axis=1) == true[side == one])
    return float(np.concatenate(right).mean())


@pytest.mark.slow
def test_shuffled_labels_are_learned_at_chance(rooms):
    """Of 1 506 frames 3 standard deviations of chance are 0.036; neighbouring frames are alike, hence twice that."""
    features, label, room = rooms
    shuffled = np.random.default_rng(2).permutation(label)
    assert abs(accuracy(features, shuffled, room, label) - 1 / 3) < 0.075


@pytest.mark.slow
def test_a_split_by_frames_would_promise_more_than_places_that_were_not_seen_give(rooms):
    features, label, room = rooms
    by_room = accuracy(features, label, room, label)
    by_frames = accuracy(features, label, np.arange(len(label)) % 4, label)
    assert by_frames > by_room + 0.02 > 0.85


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"held_out": [use(2)]},
            r"'simulated: coupling-outdoor/target-None/2' \(held out\) shares its recording or room",
        ),
        (
            {"held_out": [use(2, targets="metal")], "training": [use(1, 2, targets="person")]},
            "shares its recording or room",
        ),
        ({"validation": [use(1)]}, r"\(validation\) shares its recording or room with .* \(training\)"),
        ({"held_out": [use(1, robot=2)]}, "shares its recording or room"),
        ({"training": [use(1)]}, "all training captures are of one room"),
        (
            {"split": {"by": "room", "variants": "/target-[^/]+", "folds": 3}},
            "3 folds, but training captures of 2 rooms",
        ),
        ({"training": [use(1, 2, targets="None")]}, "step 'classify.trees': no frame of the class 'metal'"),
        (
            {"set": {"pipeline.classify.trees.params.classes": {"metal": ["metal"]}}},
            "object 'person' of material 'person' belongs to no class: list it in 'classes'",
        ),
    ],
)
def test_what_would_prove_nothing_is_refused(changes, message):
    with pytest.raises(ConfigError, match=message):
        train(read_training(file(**changes)))


def test_what_an_experiment_scores_is_not_learned_from(tmp_path):
    experiment = tmp_path / "mine.yaml"
    scored = json.dumps({"schema": 1, "name": "mine", "detectors": ["cfar-ca"], "datasets": [use(2, targets="metal")]})
    experiment.write_text(scored)
    with pytest.raises(ConfigError, match="experiment 'mine' scores 'simulated: coupling-outdoor/target-metal/2'"):
        train(read_training(file(), experiment=str(experiment)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"split": {"by": "frame"}}, "split.by: Input should be 'recording', 'scene' or 'room', found 'frame'"),
        ({"split": {"by": "room"}}, "'variants' says which scenes are of one room"),
        ({"split": {"by": "room", "variants": "("}}, "variants is no regular expression"),
        ({"step": "align"}, r"detector 'coupling-extra-trees' has no step 'align' that learns. Known: classify.trees"),
        ({"detector": "cfar-ca", "set": {}}, "steps of detector 'cfar-ca' that learn: none"),
        ({"seeds": 3}, "unknown key 'seeds'. Did you mean 'seed'?"),
    ],
)
def test_a_training_file_that_is_wrong_is_refused_with_its_key(changes, message):
    with pytest.raises(ConfigError, match=message):
        read_training(file(**changes))


def test_the_shipped_training_files_are_fine():
    for name in ("extra-trees", "random-forest", "neighbours", "logistic"):
        training = read_training(f"coupling-{name}")
        assert training.detector.name == f"coupling-{name}"


def test_shipped_weights_fit_their_detectors_and_are_small(approach):
    size = 0
    for name in ("extra-trees", "random-forest", "neighbours", "logistic"):
        detector = load_detector(f"coupling-{name}")
        stage = next(one for one in detector.open(approach).stages if hasattr(one, "labelled"))
        load_weights(stage, approach.radar)
        size += sum(values.nbytes for values in stage._weights.values())
    assert size < 1.2e6


def test_weights_of_one_kind_of_tree_are_not_those_of_another(approach):
    reference = load_detector("coupling-extra-trees").config.steps[2].params["weights"]
    steps = f"[{{use: align}}, {{use: classify.trees, params: {{kind: random_forest, weights: {reference}}}}}]"
    with pytest.raises(ConfigError, match="was learned with kind 'extra_trees', and kind is 'random_forest' here"):
        detector_from_yaml(f"schema: 1\nname: x\npipeline: {steps}").open(approach)
