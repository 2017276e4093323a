"""What a robot's radio makes of every pulse that it sends or receives."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Params, Term, View
from uwbbench_datasets.simulator.terms.ringing import RingingTap


class PulseTailParams(Params):
    """Copies behind each pulse."""

    taps: list[RingingTap] = Field(
        default=[
            RingingTap(delay_ns=3.4, level_db=-18.0, phase_deg=60.0),
            RingingTap(delay_ns=6.0, level_db=-26.0, phase_deg=-115.0),
        ],
        min_length=1,
        description="Delay, power and phase of each copy against the pulse.",
    )


class PulseTail(Term[PulseTailParams]):
    """Tail of the pulse: filters and antennas repeat every pulse, weaker, later and with another phase.

    Unlike ringing, which follows the direct path alone, it follows every echo, so that no background removes it. The
    pulse is then no member of the family that a receiver's textbook knows, is complex, and its crest has moved.
    """

    of_robot: ClassVar = True

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Let every pulse be followed by its copies."""
        turn = [10 ** (tap.level_db / 20) * np.exp(1j * np.radians(tap.phase_deg)) for tap in self.params.taps]
        copies = zip((tap.delay_ns * 1e-9 for tap in self.params.taps), turn, strict=True)
        return view.replace(pulse_copies=(*view.pulse_copies, *((delay, complex(one)) for delay, one in copies)))
