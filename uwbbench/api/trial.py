"""The stages of a detector, each tried alone on blocks that a hard case makes."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from uwbbench.api import registry
from uwbbench.api.arrays import FloatArray
from uwbbench.api.block import Block
from uwbbench.api.case import NotApplicable
from uwbbench.api.frames import Frames
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Stage
from uwbbench.api.weights import load_weights

RADAR = Radar(
    model="synthetic",
    center_frequency_hz=7987.2e6,
    bandwidth_hz=499.2e6,
    sample_interval_s=1 / (2 * 499.2e6),
    frame_rate_hz=48.0,
    taps=50,
    channel=9,
    tx_position_m=(0.0, -0.25, 0.0),
    noise_taps=4,
    array_spacing_m=17.8e-3,
    has_sts=True,
    has_first_path=True,
)
"""Radar of the hard cases."""


class StagesOnTrial:
    """The stages of a detector, as a hard case is given them.

    Parameters
    ----------
    uses : sequence of (str, mapping)
        Registered name of each stage, and its parameters on the channel of :data:`RADAR`.
    """

    radar: ClassVar[Radar] = RADAR

    def __init__(self, uses: Sequence[tuple[str, Mapping[str, Any]]]) -> None:
        self._uses = tuple(uses)

    def uses(self, name: str) -> bool:
        """Whether a stage has this name, or is of this family."""
        return any(_is(use, name) for use, _ in self._uses)

    def stage(self, name: str, radar: Radar = RADAR, **changes: Any) -> Stage[Any]:
        """The detector's first stage whose name is ``name``, or starts with it and a dot, opened.

        Parameters
        ----------
        name : str
            Registered name, or family such as ``cfar``.
        radar : Radar
        **changes
            Parameters to set otherwise than the detector does.

        Raises
        ------
        NotApplicable
            If the detector has no such stage.
        """
        for use, params in self._uses:
            if _is(use, name):
                stage = _made(use, {**params, **changes})
                load_weights(stage, radar)
                stage.open(radar)
                return stage
        raise NotApplicable(f"the detector has no stage '{name}'")

    def stages(self) -> Iterator[tuple[str, Stage[Any]]]:
        """Name and stage of each step, not opened."""
        return ((use, _made(use, params)) for use, params in self._uses)

    @staticmethod
    def through(stage: Stage[Any], block: Block) -> Block:
        """Block behind a stage, with every warning an error."""
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return stage.step(block)

    @staticmethod
    def block_of(samples: Any, **parts: Any) -> Block:
        """Block of frames with these samples (frames, taps), standing at the origin; ``parts`` go into the block."""
        samples = np.asarray(samples)
        frames = len(samples)
        return Block(
            Frames(
                first=0,
                preamble=samples,
                timestamp_s=np.arange(frames) / RADAR.frame_rate_hz,
                position_m=np.zeros((frames, 3)),
                yaw_rad=np.zeros(frames),
                valid=np.isfinite(samples).all(axis=1),
            ),
            **parts,
        )


def _is(use: str, name: str) -> bool:
    return use == name or use.startswith(f"{name}.")


def _made(use: str, params: Mapping[str, Any]) -> Stage[Any]:
    cls = registry.load_plugin("stages", use)
    stage: Stage[Any] = cls(cls.params_type().model_validate(params))
    return stage


def exact_ulps(found: FloatArray, exact: Sequence[Fraction]) -> float:
    """Largest distance of computed values from exact ones, in units in the last place of the exact ones.

    Parameters
    ----------
    found : (n,) array
    exact : sequence of n Fraction
    """
    return max(
        float(abs(Fraction(float(value)) - truth) / Fraction(float(np.spacing(abs(float(truth))))))
        for value, truth in zip(found, exact, strict=True)
    )
