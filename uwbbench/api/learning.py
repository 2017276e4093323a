"""What a stage that learns declares, and what it is given to learn from."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from uwbbench.api.block import Block
from uwbbench.api.errors import ConfigError
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Params
from uwbbench.api.truth import Trajectory, Truth

Weights = Mapping[str, NDArray[Any]]
"""What a stage has learned: named arrays of numbers, and nothing else."""

PINNED = re.compile(r"(?P<name>.+)@(?P<sha256>[0-9a-f]{64})")
"""Weights with the hash of their content: a name, or a path, before it."""


@dataclass(frozen=True)
class Example:
    """One capture to learn from, as it arrives at the stage that learns.

    Attributes
    ----------
    block : Block
        All frames, behind the steps before the stage; those steps may have held some back.
    truth : Truth
    trajectory : Trajectory
        Of the whole capture, by frame index.
    radar : Radar
    recording : str
        Recording that the capture belongs to; examples of one recording are not independent.
    """

    block: Block
    truth: Truth
    trajectory: Trajectory
    radar: Radar
    recording: str


@runtime_checkable
class Trainable(Protocol):
    """What a stage that learns has besides the methods of any stage; its parameters are :class:`LearnedParams`."""

    def fit(self, examples: Iterable[Example], *, seed: int, validation: Iterable[Example]) -> Weights:
        """Learn; the stage itself stays as it is, and need not be open.

        Parameters
        ----------
        examples : iterable of Example
            What is learned from.
        seed : int
            Of all that is drawn: the same seed on the same machine gives the same weights to the last bit.
        validation : iterable of Example
            Other captures, by which to choose or to stop early; may be empty.

        Raises
        ------
        ConfigError
            If nothing can be learned from the examples; the message says why.
        """

    def load(self, weights: Weights) -> None:
        """Take weights; called before ``open``.

        Raises
        ------
        ConfigError
            If they are not what :meth:`fit` gives: names, dtypes, shapes (:func:`expect_arrays`), and indices in them.
        """


@runtime_checkable
class Assessed(Protocol):
    """A stage that says how well it answers, in the measures that it learns by; no stage need do so."""

    def assess(self, examples: Iterable[Example]) -> Mapping[str, float]:
        """Figures by name over all examples together; called when the stage has its weights and is open."""


class LearnedParams(Params):
    """Parameters of a stage that learns.

    Class attributes
    ----------------
    after_training : frozenset of str
        Parameters that may be changed when the weights are there already, as learning does not look at them.
    """

    after_training: ClassVar[frozenset[str]] = frozenset({"weights"})

    weights: str | None = Field(
        description="What was learned: NAME@SHA256 of weights that come with the stage's package, or, in a detector's "
        "file, the path of a .safetensors file beside or below it; null before the training."
    )

    @field_validator("weights")
    @classmethod
    def _is_pinned(cls, value: str | None) -> str | None:
        if value is not None and PINNED.fullmatch(value) is None:
            raise ValueError(
                f"no weights '{value}': expected NAME@SHA256 of weights that come with the stage's package, or, in a "
                "detector's file, the path of a .safetensors file that 'uwbbench train' has written"
            )
        return value

    @property
    def learned_with(self) -> dict[str, Any]:
        """Parameters that learning looks at, as plain values."""
        values = self.model_dump(mode="json")
        return {name: value for name, value in values.items() if name not in self.after_training}


def expect_arrays(weights: Weights, expected: Mapping[str, tuple[str, tuple[int | str, ...]]]) -> dict[str, int]:
    """Check that weights are just these arrays, and hold finite numbers.

    Parameters
    ----------
    weights : mapping
    expected : mapping of str to (dtype, shape)
        By name of array. A length is a number, or the name of an axis, which is as long in all arrays.

    Returns
    -------
    dict of str to int
        Length of each named axis.

    Raises
    ------
    ConfigError
        Naming the first array that is missing, unknown, of another dtype or shape, or not finite.

    Examples
    --------
    >>> expect_arrays({"mean": np.zeros(3)}, {"mean": ("float64", ("features",))})
    {'features': 3}
    """
    for name in sorted(weights.keys() ^ expected.keys()):
        raise ConfigError(f"array '{name}' is {'missing' if name in expected else 'unknown here'}")
    lengths: dict[str, int] = {}
    for name, (dtype, shape) in expected.items():
        array = weights[name]
        wanted = tuple(lengths.get(one, one) if isinstance(one, str) else one for one in shape)
        fits = array.ndim == len(wanted) and all(
            isinstance(one, str) or one == found for one, found in zip(wanted, array.shape, strict=True)
        )
        if array.dtype != dtype or not fits:
            text = f"({', '.join(map(str, wanted))})"
            raise ConfigError(f"array '{name}' is {array.dtype} of shape {array.shape}, expected {dtype} of {text}")
        lengths |= {one: found for one, found in zip(wanted, array.shape, strict=True) if isinstance(one, str)}
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise ConfigError(f"array '{name}' holds values that are not finite")
    return lengths
