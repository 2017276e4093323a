"""A detector under examination: run on captures with every warning an error, or taken apart into its stages."""

from __future__ import annotations

import warnings
from functools import cached_property
from typing import Any

import numpy as np

from uwbbench.api import registry
from uwbbench.api.block import Block
from uwbbench.api.capture import Capture
from uwbbench.api.detections import Detections
from uwbbench.api.frames import Frames
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Stage
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.robustness.case import NotApplicable, Violation
from uwbbench.measure.robustness.scene import RADAR, approach

NEAR_M = 0.20
"""Largest range error of a detection that has found the echo."""


class Subject:
    """One detector, and what it makes of the undisturbed capture.

    Parameters
    ----------
    pipeline : Pipeline
    """

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline

    @cached_property
    def capture(self) -> Capture:
        """The undisturbed capture."""
        return approach()

    @cached_property
    def usual(self) -> Detections:
        """What the detector finds there."""
        return self.run(self.capture)

    @cached_property
    def looks_at_samples(self) -> bool:
        """Whether any stage consumes frames; references, such as an oracle, need not."""
        return any("frames" in registry.load_plugin("stages", step.use).consumes for step in self.pipeline.config.steps)

    def run(self, capture: Capture) -> Detections:
        """Detections on a whole capture.

        Raises
        ------
        Violation
            If a detection belongs to an invalid frame, has an amplitude that is no number, or an infinite value.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = self.pipeline.run(capture)
        if not np.isin(found.frame, found.processed).all():
            raise Violation("detections belong to frames that are invalid, or not of this capture")
        for name, values in found.columns.items():
            if np.isinf(values).any():
                raise Violation(f"{np.isinf(values).sum()} of {len(values)} detections have an infinite {name}")
        if "amplitude" in found and np.isnan(found["amplitude"]).any():
            raise Violation("detections have an amplitude that is no number")
        return found

    def run_altered(self, capture: Capture) -> Detections:
        """Detections of a detector that looks at samples.

        Raises
        ------
        NotApplicable
            If it does not look at them.
        """
        if not self.looks_at_samples:
            raise NotApplicable("the detector does not look at samples")
        return self.run(capture)

    def uses(self, name: str) -> bool:
        """Whether a stage has this name, or is of this family."""
        return any(_is(step.use, name) for step in self.pipeline.config.steps)

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
        for step in self.pipeline.config.steps:
            if _is(step.use, name):
                cls = registry.load_plugin("stages", step.use)
                params, _ = step.params_for(radar.channel)
                stage: Stage[Any] = cls(cls.params_type().model_validate({**params, **changes}))
                stage.open(radar)
                return stage
        raise NotApplicable(f"the detector has no stage '{name}'")


def _is(use: str, name: str) -> bool:
    return use == name or use.startswith(f"{name}.")


def through(stage: Stage[Any], block: Block) -> Block:
    """Block behind a stage, with every warning an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return stage.step(block)


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
