"""Classifiers to compare trees with: the nearest known frames, and a linear model."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from uwbbench.api import ConfigError, Fidelity, FloatArray, IntArray, Weights, expect_arrays
from uwbbench_detectors.classify.classifier import C, Classifier, ClassifierParams
from uwbbench_detectors.classify.features import NAMES

_SCALING = {"mean": ("float64", (len(NAMES),)), "scale": ("float64", (len(NAMES),))}


class Scaled(Classifier[C]):
    """A classifier of features with mean 0 and standard deviation 1 over the frames that it learned from."""

    fidelity: ClassVar[Fidelity] = "baseline"

    def scaling(self, features: NDArray[np.float32]) -> Weights:
        """Mean and standard deviation (93,) of features (frames, 93); 1 where they never change."""
        spread = features.std(axis=0, dtype=np.float64)
        return {"mean": features.mean(axis=0, dtype=np.float64), "scale": np.where(spread > 0, spread, 1.0)}

    def scaled(self, features: NDArray[np.float32], by: Weights) -> FloatArray:
        """Features (frames, 93) after the scaling of some weights."""
        return np.asarray((features - by["mean"]) / by["scale"])

    def take(self, weights: Weights) -> None:
        """Keep weights whose arrays are as they should be."""
        if (weights["scale"] <= 0).any():
            raise ConfigError("array 'scale' holds values that are not above 0")
        self._weights = weights


class NeighboursParams(ClassifierParams):
    """How many neighbours are asked, of how many."""

    neighbours: int = Field(5, ge=1, le=1000, description="Nearest known frames, whose classes are counted.")
    known: int = Field(2000, ge=1, description="Frames that are kept, spread evenly over those learned from.")


class Neighbours(Scaled[NeighboursParams]):
    """Tell frames apart by the classes of the nearest known ones (Cover and Hart 1967): to compare others with.

    Weights
    -------
    mean (93,), scale (93,), known (known, 93), label (known,).
    """

    def learn(self, features: NDArray[np.float32], label: IntArray, seed: int) -> Weights:  # noqa: ARG002
        """Some of the frames.

        Parameters
        ----------
        features, label, seed
            As :meth:`Classifier.learn` has them.
        """
        count = min(self.params.known, len(features))
        rows = np.arange(count) * len(features) // count
        scaling = self.scaling(features)
        known = self.scaled(features, scaling)[rows].astype(np.float32)
        return {**scaling, "known": known, "label": label[rows].astype(np.int16)}

    def load(self, weights: Weights) -> None:
        """Take known frames.

        Raises
        ------
        ConfigError
            If arrays are not as expected, or a label is that of no class.
        """
        arrays = {**_SCALING, "known": ("float32", ("known", len(NAMES))), "label": ("int16", ("known",))}
        sizes = expect_arrays(weights, arrays)
        label = weights["label"]
        if sizes["known"] < self.params.neighbours:
            raise ConfigError(f"{sizes['known']} frames are fewer than {self.params.neighbours} neighbours")
        if label.min() < 0 or label.max() >= len(self.params.labels):
            raise ConfigError(f"array 'label' holds numbers that are not 0 to {len(self.params.labels) - 1}")
        self.take(weights)

    def probabilities(self, features: NDArray[np.float32]) -> FloatArray:
        """Shares (frames, classes) among the nearest."""
        from uwbbench_detectors.classify.loops import neighbour_probabilities

        w, classes = self._weights, len(self.params.labels)
        found: FloatArray = neighbour_probabilities(
            self.scaled(features, w), w["known"], w["label"], self.params.neighbours, classes
        )
        return found


class LogisticParams(ClassifierParams):
    """How strongly the model is held back."""

    regularisation: float = Field(1.0, gt=0, description="Weight of the squared slopes beside the log-likelihood.")


class Logistic(Scaled[LogisticParams]):
    """Tell frames apart by multinomial logistic regression: to compare others with.

    Weights
    -------
    mean (93,), scale (93,), slope (classes, 93), intercept (classes,).
    """

    def learn(self, features: NDArray[np.float32], label: IntArray, seed: int) -> Weights:  # noqa: ARG002
        """The model that scikit-learn fits.

        Parameters
        ----------
        features, label, seed
            As :meth:`Classifier.learn` has them.
        """
        from sklearn.linear_model import LogisticRegression

        scaling = self.scaling(features)
        model = LogisticRegression(C=1 / self.params.regularisation, class_weight="balanced", max_iter=1000)
        model.fit(self.scaled(features, scaling), label)
        slope, intercept = model.coef_, model.intercept_
        if len(intercept) == 1:  # of two classes only the second one's is given
            slope, intercept = np.concatenate([0 * slope, slope]), np.concatenate([0 * intercept, intercept])
        return {**scaling, "slope": np.ascontiguousarray(slope), "intercept": intercept}

    def load(self, weights: Weights) -> None:
        """Take slopes.

        Raises
        ------
        ConfigError
            If arrays are not as expected.
        """
        classes = len(self.params.labels)
        arrays = {**_SCALING, "slope": ("float64", (classes, len(NAMES))), "intercept": ("float64", (classes,))}
        expect_arrays(weights, arrays)
        self.take(weights)

    def probabilities(self, features: NDArray[np.float32]) -> FloatArray:
        """Softmax (frames, classes) of the linear model."""
        from uwbbench_detectors.classify.loops import linear_probabilities

        w = self._weights
        found: FloatArray = linear_probabilities(self.scaled(features, w), w["slope"], w["intercept"])
        return found
