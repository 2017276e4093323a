"""Phase and gain of the receiver."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from uwbbench.api import Params, Responses, Term, View


class FrameGainParams(Params):
    """How frames differ as a whole."""

    phase: Literal["random", "locked"] = Field("random", description="locked: the carriers keep their phase.")
    jitter_db: float = Field(0.5, ge=0, description="Standard deviation of the gain.")


class FrameGain(Term[FrameGainParams]):
    """Random phase and gain of each frame, common to its responses: free-running oscillators and gain control.

    What stands behind this term in the scene, such as noise, keeps its level.
    """

    of_robot: ClassVar = True

    def apply(self, responses: Responses, view: View, rng: np.random.Generator) -> Responses:
        """Scale and turn each frame.

        Parameters
        ----------
        responses : Responses
            Sum of all paths, arrays (frames, taps).
        view : View
            The same frames; gives their number alone.
        rng : Generator
            Draws the gain and, if it is random, the phase of each frame.
        """
        factor = 10 ** (self.params.jitter_db * rng.standard_normal((len(view), 1)) / 20) + 0j
        if self.params.phase == "random":
            factor = factor * np.exp(2j * np.pi * rng.uniform(size=(len(view), 1)))
        return responses.map(lambda one: one * factor)
