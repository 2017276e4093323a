"""Energy averaged along the taps."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Block, ConfigError, Params, Radar, Stage, ports


class EnergySmoothingParams(Params):
    """How long the average is."""

    taps: int | None = Field(None, ge=1, le=255, description="Taps of the average, an odd number.")
    pulses: float | None = Field(
        None,
        gt=0,
        le=64,
        description="Taps of the average in pulse lengths (1 / bandwidth), so that one value fits radars of any "
        "sampling; rounded down to an odd number of taps, at least one. 0.8 where neither is given: 9 taps of 61 ps at "
        "1.7 GHz, none at 1 ns and 500 MHz.",
    )

    @model_validator(mode="after")
    def _one_unit(self) -> Self:
        if self.taps is not None and self.pulses is not None:
            raise ValueError("give taps or pulses, not both")
        if self.taps is not None and self.taps % 2 == 0:
            raise ValueError(f"taps of an average around a tap must be odd, found {self.taps}")
        return self

    def taps_for(self, radar: Radar) -> int:
        """Taps of the average for a radar."""
        if self.taps is not None:
            return self.taps
        pulse_taps = 1 / (radar.bandwidth_hz * radar.sample_interval_s)
        pulses = 0.8 if self.pulses is None else self.pulses
        return 2 * int((pulses * pulse_taps - 1) / 2 + 1e-9) + 1 if pulses * pulse_taps > 1 else 1


class EnergySmoothing(Stage[EnergySmoothingParams]):
    """Samples replaced by the root of the mean energy around them.

    ``y_n = sqrt(mean |x_m|^2)`` over the taps at most half the average away, as many as there are at the ends of the
    frame. A body returns several pulses whose sum has dips; a radar that samples each pulse many times sees them as
    several echoes. The phase is lost: what compares frames coherently, such as clutter removal, belongs before it.

    Radars that sample a pulse many times are smoothed so before the cell of the walking person is sought, as the
    publicly known low-rank detectors do (after Sabushimike et al., Sensors 16(9):1409, 2016); the length is a choice
    made here.

    Raises
    ------
    ConfigError
        From ``open``, if the average is longer than a frame.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("frames")
    fidelity = "reconstruction"

    def open(self, radar: Radar) -> None:
        """Settle the length for this radar."""
        super().open(radar)
        self._taps = self.params.taps_for(radar)
        if self._taps > radar.taps:
            raise ConfigError(f"smooth.energy: an average over {self._taps} taps does not fit into {radar.taps} taps")

    def step(self, block: Block) -> Block:
        """Block with smoothed frames."""
        energy = block.frames.amplitude**2
        total, count = energy.copy(), np.ones(energy.shape[1])
        # Added one by one: differences of running sums would lose weak taps behind strong ones.
        for away in range(1, self._taps // 2 + 1):
            total[:, away:] += energy[:, :-away]
            total[:, :-away] += energy[:, away:]
            count[away:] += 1
            count[:-away] += 1
        return block.replace(frames=block.frames.with_preamble(np.sqrt(total / count).astype(np.complex128)))
