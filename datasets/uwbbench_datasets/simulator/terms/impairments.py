"""What the receiver's number format does to the responses."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import ComplexArray, Params, Responses, Term, View


class ClippingParams(Params):
    """Where samples saturate."""

    level: float = Field(1.2, gt=0, description="Largest I or Q, in amplitudes of the direct path.")


class Clipping(Term[ClippingParams]):
    """Saturation: I and Q each stop at a level, as registers do."""

    of_robot: ClassVar = True

    def apply(self, responses: Responses, view: View, rng: np.random.Generator) -> Responses:
        """Clip every response.

        Parameters
        ----------
        responses : Responses
            Arrays (frames, taps).
        view : View
            Gives the amplitude of the direct path, the unit of the level.
        rng : Generator
            Not drawn from.
        """
        limit = self.params.level * view.direct_amplitude

        def clipped(one: ComplexArray) -> ComplexArray:
            return np.clip(one.real, -limit, limit) + 1j * np.clip(one.imag, -limit, limit)

        return responses.map(clipped)


class QuantisationParams(Params):
    """How finely samples are stored."""

    bits: int = Field(10, ge=2, le=24, description="Bits of I and of Q, with the sign.")
    full_scale: float = Field(2.0, gt=0, description="Largest I or Q that fits, in amplitudes of the direct path.")


class Quantisation(Term[QuantisationParams]):
    """Rounding of I and Q to integers, half to even; what does not fit stops at the last step."""

    of_robot: ClassVar = True

    def _step(self, view: View) -> float:
        return float(self.params.full_scale * view.direct_amplitude / 2 ** (self.params.bits - 1))

    def apply(self, responses: Responses, view: View, rng: np.random.Generator) -> Responses:
        """Round every response to the steps of two's complement numbers.

        Parameters
        ----------
        responses : Responses
            Arrays (frames, taps).
        view : View
            Gives the amplitude of the direct path, the unit of the full scale.
        rng : Generator
            Not drawn from.
        """
        step, last = self._step(view), 2 ** (self.params.bits - 1)

        def rounded(one: ComplexArray) -> ComplexArray:
            real, imaginary = (np.clip(np.round(part / step), -last, last - 1) for part in (one.real, one.imag))
            return np.asarray(step * (real + 1j * imaginary))

        return responses.map(rounded)
