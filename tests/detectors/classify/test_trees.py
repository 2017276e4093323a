"""Trees as arrays: what scikit-learn says, and nothing that is broken."""

import numpy as np
import pytest

from uwbbench.api import ConfigError
from uwbbench.api.arrays import locked
from uwbbench_detectors.classify.comparison import Logistic, LogisticParams, Neighbours, NeighboursParams
from uwbbench_detectors.classify.features import NAMES
from uwbbench_detectors.classify.trees import Trees, TreesParams

CLASSES = 3


def tree(**changes: np.ndarray) -> dict[str, np.ndarray]:
    """One tree: two nodes, three leaves."""
    arrays = {
        "roots": np.array([0], np.int32),
        "feature": np.array([4, 92], np.int16),
        "threshold": np.array([0.5, 2.0], np.float32),
        "children": np.array([[1, -3], [-1, -2]], np.int32),
        "leaves": np.eye(3, dtype=np.float32),
    }
    return {**arrays, **changes}


def trees(**params) -> Trees:
    return Trees(TreesParams(weights=None, **params))


def learned(rng: np.random.Generator, frames: int = 400):
    """Features whose classes overlap, and the class of each."""
    label = rng.integers(0, CLASSES, frames)
    return (rng.normal(size=(frames, len(NAMES))) + 0.3 * label[:, None]).astype(np.float32), label


def test_a_frame_goes_down_to_its_leaf():
    stage = trees()
    stage.load({name: locked(values) for name, values in tree().items()})
    features = np.zeros((3, len(NAMES)), np.float32)
    features[1, 92] = 3  # the second leaf
    features[2, 4] = 1  # the third
    assert stage.probabilities(features).tolist() == np.eye(3).tolist()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"children": np.array([[2, -3], [-1, -2]], np.int32)}, "array 'children' holds 2, expected -3 to 1"),
        ({"children": np.array([[1, -4], [-1, -2]], np.int32)}, "array 'children' holds -4, expected -3 to 1"),
        ({"children": np.array([[1, -3], [0, -2]], np.int32)}, "node 1 has a child that does not stand behind it"),
        ({"children": np.array([[0, -3], [-1, -2]], np.int32)}, "node 0 has a child that does not stand behind it"),
        ({"roots": np.array([2], np.int32)}, "array 'roots' holds 2"),
        ({"roots": np.array([], np.int32)}, "there is no tree"),
        ({"feature": np.array([4, 93], np.int16)}, "array 'feature' holds 93, expected 0 to 92"),
        ({"feature": np.array([-1, 3], np.int16)}, "array 'feature' holds -1"),
        ({"threshold": np.array([np.nan, 2.0], np.float32)}, "array 'threshold' holds values that are not finite"),
        ({"threshold": np.array([1.0], np.float32)}, "array 'threshold' is float32 of shape"),
        ({"leaves": np.eye(3, 4, dtype=np.float32)}, "array 'leaves' is float32 of shape"),
    ],
)
def test_trees_that_lead_nowhere_or_in_circles_are_refused(changes, message):
    with pytest.raises(ConfigError, match=message):
        trees().load(tree(**changes))


@pytest.mark.parametrize("kind", ["extra_trees", "random_forest"])
@pytest.mark.slow
def test_probabilities_are_those_of_scikit_learn(kind):
    rng = np.random.default_rng(8)
    features, label = learned(rng)
    stage = trees(kind=kind, trees=8)
    stage.load({name: locked(values) for name, values in stage.learn(features, label, 3).items()})
    others, _ = learned(rng)
    expected = stage.grown(features, label, 3).predict_proba(others)
    np.testing.assert_allclose(stage.probabilities(others), expected, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_values_on_a_threshold_go_where_scikit_learn_sends_them():
    rng = np.random.default_rng(9)
    features, label = learned(rng)
    stage = trees(kind="random_forest", trees=5)
    weights = stage.learn(features, label, 3)
    stage.load({name: locked(values) for name, values in weights.items()})
    others = np.repeat(features[:1], len(weights["feature"]), axis=0)
    others[np.arange(len(others)), weights["feature"]] = weights["threshold"]
    expected = stage.grown(features, label, 3).predict_proba(others)
    np.testing.assert_allclose(stage.probabilities(others), expected, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_neighbours_are_those_of_scikit_learn():
    from sklearn.neighbors import KNeighborsClassifier

    rng = np.random.default_rng(10)
    features, label = learned(rng)
    stage = Neighbours(NeighboursParams(weights=None, known=150))
    weights = stage.learn(features, label, 0)
    assert weights["known"].shape == (150, len(NAMES))
    stage.load({name: locked(values) for name, values in weights.items()})
    others, _ = learned(rng)
    model = KNeighborsClassifier(5).fit(weights["known"], weights["label"])
    expected = model.predict_proba((others - weights["mean"]) / weights["scale"])
    np.testing.assert_allclose(stage.probabilities(others), expected, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_the_linear_model_is_that_of_scikit_learn():
    from sklearn.linear_model import LogisticRegression

    rng = np.random.default_rng(11)
    features, label = learned(rng)
    stage = Logistic(LogisticParams(weights=None))
    weights = stage.learn(features, label, 0)
    stage.load({name: locked(values) for name, values in weights.items()})
    model = LogisticRegression(class_weight="balanced", max_iter=1000)
    model.fit((features - weights["mean"]) / weights["scale"], label)
    others, _ = learned(rng)
    expected = model.predict_proba((others - weights["mean"]) / weights["scale"])
    np.testing.assert_allclose(stage.probabilities(others), expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"label": np.full(6, 3, np.int16)}, "array 'label' holds numbers that are not 0 to 2"),
        ({"scale": np.zeros(93)}, "array 'scale' holds values that are not above 0"),
        ({"known": np.zeros((4, 93), np.float32), "label": np.zeros(4, np.int16)}, "4 frames are fewer than 5"),
    ],
)
def test_known_frames_that_cannot_be_asked_are_refused(changes, message):
    arrays = {
        "mean": np.zeros(93),
        "scale": np.ones(93),
        "known": np.zeros((6, 93), np.float32),
        "label": np.zeros(6, np.int16),
    }
    with pytest.raises(ConfigError, match=message):
        Neighbours(NeighboursParams(weights=None)).load({**arrays, **changes})
