"""The robot's own response as a template that is renewed only while the robot moves."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, FloatArray, Radar, Stage, ports
from uwbbench_detectors.integrate.motion import MotionParams, places_m, plain


class RobotTemplateParams(MotionParams):
    """How the template is kept."""

    memory: int = Field(
        200, ge=1, description="Looks that the template remembers; with the way between two of them, that is 0.8 m."
    )
    step_m: float = Field(
        0.004,
        ge=0,
        description="Way between two looks that renew the template. A tenth of a wavelength: fewer would weigh slow "
        "stretches of the way more.",
    )


class RobotTemplate(Stage[RobotTemplateParams]):
    """Subtracts what the robot sees of itself: the mean of the aligned frames along its way.

    Direct path, ringing and the robot's body are the same in every aligned frame; an echo's phase turns by
    ``4 pi / lambda`` a metre of range rate, so that in the mean over a way of s metres it is left by a factor of
    ``lambda / (4 pi s)`` at most, -40 dB after 0.3 m at 8 GHz. The mean is therefore taken over the way, not over
    time: ``T += (a - T) / min(looks, memory)`` once the robot has moved by ``step_m``. A robot that stands sees its
    surroundings unchanged for as long as it likes, and they do not become a part of it; an average over time, such as
    ``clutter.exponential``, would take them in within its memory, and leave their negative behind when the robot goes
    on. All frames at the first place count as one look, and nothing is left of them: a robot that has never moved
    cannot tell itself from its surroundings.

    Each response has a template of its own. Frames must be aligned; those that are all zero are passed over.

    What keeps its range while the robot moves, such as a wall alongside, is taken for the robot after the way of the
    memory.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("frames")

    def open(self, radar: Radar) -> None:
        """Start without templates."""
        super().open(radar)
        from uwbbench_detectors.clutter import robot_loops as loops
        from uwbbench_detectors.first_path import template_loops

        self._residuals = loops.residuals
        self.at: FloatArray = np.zeros(loops.SETTINGS)
        self.at[loops.MEMORY], self.at[loops.STEP_M] = self.params.memory, self.params.step_m
        responses = 3 if radar.has_sts else 1
        self.templates = np.zeros((responses, 2, radar.taps), np.float32)
        self.carried: FloatArray = np.zeros((responses, loops.CARRIED))
        self.carried[:, [template_loops.X_M, template_loops.Y_M]] = np.nan

    def step(self, block: Block) -> Block:
        """Block whose frames hold no robot."""
        frames = block.frames
        place_m, _ = places_m(self, frames)
        valid = plain(frames.valid, np.bool_)
        parts = {}
        for place, name in enumerate(("preamble", "sts1", "sts2")):
            samples = getattr(frames, name)
            if samples is not None:
                samples = plain(samples, np.complex64)
                state = self.templates[place], self.carried[place]
                parts[name] = plain(self._residuals(samples, valid, place_m, *state, self.at), np.complex64)
        return block.replace(frames=dataclasses.replace(frames, **parts))
