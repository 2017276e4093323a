"""What classifiers of frames have in common: classes, examples, and one row a frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from uwbbench.api import (
    Block,
    ConfigError,
    Detections,
    Example,
    Fidelity,
    FloatArray,
    IntArray,
    LearnedParams,
    Stage,
    Weights,
    nearest,
    ports,
)
from uwbbench_detectors.classify.features import NAMES, features_of, reach_m

EMPTY = "empty"
"""Class of a frame in which no object is in reach; always the first one."""


class ClassifierParams(LearnedParams):
    """Classes, and weights."""

    classes: dict[str, list[str]] = Field(
        default={"metal": ["metal"], "person": ["person"]},
        min_length=1,
        description="Names or materials of objects by class; a frame with no object in reach is of the class 'empty'.",
    )

    @field_validator("classes")
    @classmethod
    def _apart(cls, value: dict[str, list[str]]) -> dict[str, list[str]]:
        if EMPTY in value:
            raise ValueError(f"'{EMPTY}' is the class of frames without an object; it lists none")
        listed = [one for names in value.values() for one in names]
        twice = {one for one in listed if listed.count(one) > 1}
        if twice:
            raise ValueError(f"'{sorted(twice)[0]}' is listed twice")
        return value

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of all classes."""
        return (EMPTY, *self.classes)


C = TypeVar("C", bound=ClassifierParams)


class Classifier(Stage[C]):
    """One row a frame: how probable it is that something is there, and of which class it is.

    ``probability`` is 1 - P(empty), and ``class_probability_NAME`` that of each class; there is no range. Frames
    without a direct path get no row. Each frame is classified for itself.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path")
    produces: ClassVar[frozenset[str]] = ports(
        "detections",
        "range_m",
        "probability",
        "class_probability_empty",
        "class_probability_metal",
        "class_probability_person",
    )
    fidelity: ClassVar[Fidelity] = "reconstruction"

    def learn(self, features: NDArray[np.float32], label: IntArray, seed: int) -> Weights:
        """Weights that tell the classes by features.

        Parameters
        ----------
        features : (frames, 93) float32 array
        label : (frames,) int array
            Number of each frame's class; every class is there.
        seed : int
        """
        raise NotImplementedError

    def probabilities(self, features: NDArray[np.float32]) -> FloatArray:
        """Probability (frames, classes) of each class, from features (frames, 93)."""
        raise NotImplementedError

    def fit(self, examples: Iterable[Example], *, seed: int, validation: Iterable[Example]) -> Weights:  # noqa: ARG002
        """Learn from all frames of the examples; nothing is chosen by the validation.

        Parameters
        ----------
        examples, validation : iterable of Example
        seed : int

        Raises
        ------
        ConfigError
            If an object belongs to no class, or a class has no frame.
        """
        features, label = self.labelled(examples)
        for number, name in enumerate(self.params.labels):
            if not (label == number).any():
                raise ConfigError(f"no frame of the class '{name}' is among the examples: nothing tells it from others")
        return self.learn(features, label, seed)

    def assess(self, examples: Iterable[Example]) -> dict[str, float]:
        """Accuracy over all classes, and balanced accuracy of presence: the mean of its two rates.

        Parameters
        ----------
        examples : iterable of Example
            A class of which there is no frame does not count.
        """
        features, label = self.labelled(examples)
        found = self.probabilities(features)
        present, answer = label > 0, found[:, 0] <= 0.5
        rates = [np.mean(answer[side] == present[side]) for side in (present, ~present) if side.any()]
        return {
            "accuracy": float(np.mean(found.argmax(axis=1) == label)),
            "presence": float(np.mean(rates)),
        }

    def labelled(self, examples: Iterable[Example]) -> tuple[NDArray[np.float32], IntArray]:
        """Features (frames, 93) of all frames that have any, and the number of their class.

        Parameters
        ----------
        examples : iterable of Example

        Raises
        ------
        ConfigError
            If an object belongs to no class.
        """
        features, label = [np.empty((0, len(NAMES)), np.float32)], [np.empty(0, np.int64)]
        for example in examples:
            found, there = features_of(example.block)
            features.append(found[there])
            label.append(self._classes_of(example)[example.block.frames.index[there]])
        return np.concatenate(features), np.concatenate(label)

    def _classes_of(self, example: Example) -> IntArray:
        """Class (frames of the capture,) of the nearest object ahead and in reach."""
        sight = example.truth.seen_from(example.radar, example.trajectory)
        classes = np.array([0 if one.structure else self._class_of(one) for one in example.truth.objects], np.int64)
        if not classes.any():
            return np.zeros(len(example.trajectory), np.int64)
        with np.errstate(invalid="ignore"):
            seen = (np.abs(sight.azimuth_rad) <= np.pi / 2) & (sight.range_m <= reach_m(example.radar)) & (classes > 0)
        range_m = np.where(seen, sight.range_m, np.inf)
        return np.where(seen.any(axis=1), classes[range_m.argmin(axis=1)], 0)

    def _class_of(self, obstacle: Any) -> int:
        listed = {one: number for number, names in enumerate(self.params.classes.values(), 1) for one in names}
        for mine in (obstacle.name, obstacle.material):
            if mine in listed:
                return listed[mine]
        raise ConfigError(
            f"object '{obstacle.name}' of material '{obstacle.material}' belongs to no class: list it in 'classes'."
            f"{nearest(obstacle.name, listed)}"
        )

    def step(self, block: Block) -> Block:
        """Block with a row for each frame."""
        features, there = features_of(block)
        found = self.probabilities(features[there])
        columns: dict[str, Any] = {
            f"class_probability_{name}": found[:, number] for number, name in enumerate(self.params.labels)
        }
        frame = block.frames.index[there]
        detections = Detections(frame, range_m=np.full(len(frame), np.nan), probability=1 - found[:, 0], **columns)
        return block.replace(detections=detections)
