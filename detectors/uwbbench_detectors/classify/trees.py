"""Ensembles of trees."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from uwbbench.api import ConfigError, FloatArray, IntArray, Weights, expect_arrays
from uwbbench_detectors.classify.classifier import Classifier, ClassifierParams
from uwbbench_detectors.classify.features import NAMES


class TreesParams(ClassifierParams):
    """How trees are grown."""

    kind: Literal["extra_trees", "random_forest"] = Field(
        "extra_trees",
        description="extra_trees: thresholds are drawn, the best of some features is taken (Geurts et al. 2006); "
        "random_forest: the best threshold, on frames drawn with replacement (Breiman 2001).",
    )
    trees: int = Field(300, ge=1, le=10_000, description="Trees that are grown.")
    min_samples_leaf: int = Field(3, ge=1, description="Fewest frames in a leaf.")


class Trees(Classifier[TreesParams]):
    """Tell frames apart by an ensemble of trees, after Sattiraju et al. (arXiv 1811.12228).

    The source classifies responses of a P440 with ensembles of trees before two trains couple. Which features, classes
    and sizes it takes could not be read; those here are chosen. Grown by scikit-learn, with the root of the number of
    features tried at each node and classes weighted to count alike; what is loaded are plain arrays, walked by compiled
    code. A threshold is kept as the largest float32 below it, which no float32 feature can tell from it.

    Weights
    -------
    roots (trees,), feature, threshold, children (nodes, 2), leaves (leaves, classes); a negative node n is the leaf
    -1 - n, and a child always stands behind its node, so that no path can run in a circle.
    """

    def learn(self, features: NDArray[np.float32], label: IntArray, seed: int) -> Weights:
        """Arrays of the trees that scikit-learn grows.

        Parameters
        ----------
        features, label, seed
            As :meth:`Classifier.learn` has them.
        """
        return arrays_of(self.grown(features, label, seed))

    def grown(self, features: NDArray[np.float32], label: IntArray, seed: int) -> Any:
        """scikit-learn's classifier, fitted.

        Parameters
        ----------
        features, label, seed
            As :meth:`Classifier.learn` has them.
        """
        from sklearn.ensemble import ExtraTreesClassifier, RandomForestClassifier

        p = self.params
        kind = ExtraTreesClassifier if p.kind == "extra_trees" else RandomForestClassifier
        grower = kind(
            p.trees,
            min_samples_leaf=p.min_samples_leaf,
            max_features="sqrt",
            class_weight="balanced",
            random_state=seed,
        )
        return grower.fit(features, label)

    def load(self, weights: Weights) -> None:
        """Take trees.

        Raises
        ------
        ConfigError
            If arrays are not as expected, or an index in them leads nowhere or back.
        """
        sizes = expect_arrays(
            weights,
            {
                "roots": ("int32", ("trees",)),
                "feature": ("int16", ("nodes",)),
                "threshold": ("float32", ("nodes",)),
                "children": ("int32", ("nodes", 2)),
                "leaves": ("float32", ("leaves", len(self.params.labels))),
            },
        )
        if not sizes["trees"]:
            raise ConfigError("there is no tree")
        _check_range("feature", weights["feature"], 0, len(NAMES))
        for name in ("roots", "children"):
            _check_range(name, weights[name], -sizes["leaves"], sizes["nodes"])
        children = weights["children"]
        back = (children >= 0) & (children <= np.arange(len(children))[:, None])
        if back.any():
            node = int(np.flatnonzero(back.any(axis=1))[0])
            raise ConfigError(f"array 'children': node {node} has a child that does not stand behind it")
        self._weights = weights

    def probabilities(self, features: NDArray[np.float32]) -> FloatArray:
        """Mean of all trees (frames, classes)."""
        from uwbbench_detectors.classify.loops import forest_probabilities

        w = self._weights
        found: FloatArray = forest_probabilities(
            features, w["roots"], w["feature"], w["threshold"], w["children"], w["leaves"]
        )
        return found


def _check_range(name: str, values: NDArray[Any], start: int, stop: int) -> None:
    outside = values[(values < start) | (values >= stop)]
    if outside.size:
        raise ConfigError(f"array '{name}' holds {outside.flat[0]}, expected {start} to {stop - 1}")


def arrays_of(grown: Any) -> Weights:
    """Trees of a scikit-learn ensemble as arrays, leaves apart from nodes.

    Parameters
    ----------
    grown : sklearn ForestClassifier
        Fitted.
    """
    parts: dict[str, list[NDArray[Any]]] = {
        name: [] for name in ("roots", "feature", "threshold", "children", "leaves")
    }
    nodes = leaves = 0
    for one in grown.estimators_:
        tree = one.tree_
        is_leaf = tree.children_left < 0
        place = np.where(is_leaf, -1 - leaves - (np.cumsum(is_leaf) - 1), nodes + np.cumsum(~is_leaf) - 1)
        children = np.stack([tree.children_left, tree.children_right], axis=1)[~is_leaf]
        shares = tree.value[is_leaf, 0]
        parts["roots"].append(place[:1].astype(np.int32))
        parts["feature"].append(tree.feature[~is_leaf].astype(np.int16))
        parts["threshold"].append(_float32_below(tree.threshold[~is_leaf]))
        parts["children"].append(place[children].astype(np.int32))
        parts["leaves"].append((shares / shares.sum(axis=1, keepdims=True)).astype(np.float32))
        nodes, leaves = nodes + int((~is_leaf).sum()), leaves + int(is_leaf.sum())
    return {name: np.concatenate(arrays) for name, arrays in parts.items()}


def _float32_below(values: FloatArray) -> NDArray[np.float32]:
    """Largest float32 that is no larger than each value: a float32 is at most the one if it is at most the other."""
    near = values.astype(np.float32)
    return np.where(near.astype(np.float64) > values, np.nextafter(near, np.float32(-np.inf)), near)
