"""A detector under examination: run on captures with every warning an error, or taken apart into its stages."""

from __future__ import annotations

import warnings
from functools import cached_property

import numpy as np

from uwbbench.api.capture import Capture
from uwbbench.api.case import NotApplicable, Violation
from uwbbench.api.detections import Detections
from uwbbench.api.trial import RADAR, StagesOnTrial
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.robustness.scene import approach

NEAR_M = 0.20
"""Largest range error of a detection that has found the echo."""


class Subject(StagesOnTrial):
    """One detector, and what it makes of the undisturbed capture.

    Parameters
    ----------
    pipeline : Pipeline
    """

    def __init__(self, pipeline: Pipeline) -> None:
        super().__init__([(step.use, step.params_for(RADAR.channel)[0]) for step in pipeline.config.steps])
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
        return any("frames" in stage.consumes for _, stage in self.stages())

    def run(self, capture: Capture) -> Detections:
        """Detections on a whole capture.

        Raises
        ------
        Violation
            If a detection belongs to an invalid frame, has an amplitude that is no number, or an infinite value.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            detections = self.pipeline.run(capture)
        if not np.isin(detections.frame, detections.processed).all():
            raise Violation("detections belong to frames that are invalid, or not of this capture")
        for name, values in detections.columns.items():
            if np.isinf(values).any():
                raise Violation(f"{np.isinf(values).sum()} of {len(values)} detections have an infinite {name}")
        amplitude = detections["amplitude"] if "amplitude" in detections else np.zeros(0)
        if "track" in detections:  # a track without a detection is coasting, and has none
            amplitude = amplitude[detections["track"] < 0]
        if np.isnan(amplitude).any():
            raise Violation("detections have an amplitude that is no number")
        return detections

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
