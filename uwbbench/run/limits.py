"""How long a unit may take, and how much memory its processes may allocate."""

from __future__ import annotations

from pydantic import Field

from uwbbench.config.model import ConfigModel

FIRST_S, FIRST_FRAME_S = 300.0, 0.25
"""Of a detector whose speed is not known: compiling may be among it, and a quarter of a second for each frame is 24
times the 10.42 ms that arXiv 2512.01018 allows a robot."""
LATER_S, LATER_TIMES = 60.0, 20.0
"""Of one that has answered before: so many times what its slowest capture would make of this one's frames."""


class LimitsModel(ConfigModel):
    """Limits of each unit; a unit that exceeds one is a failed row, and the others are not touched."""

    unit_s: float | None = Field(
        default=None,
        gt=0,
        description="Longest that a detector may take over one capture; if left out, by the capture's length and what "
        "the detector took over others.",
    )
    memory_mb: float | None = Field(
        default=None, ge=256, description="What each process may allocate; as much as there is if left out."
    )


class Allowance:
    """Time that detectors are given, by what they took.

    Parameters
    ----------
    limits : LimitsModel
    """

    def __init__(self, limits: LimitsModel) -> None:
        self._fixed = limits.unit_s
        self._slowest: dict[str, float] = {}

    @property
    def said(self) -> str:
        """What sets the limit, for messages."""
        return (
            ", its limit (limits.unit_s)" if self._fixed is not None else ", its limit; set limits.unit_s for another"
        )

    def seconds(self, detector: str, frames: int) -> float:
        """What a detector is given for a capture of so many frames.

        Parameters
        ----------
        detector : str
            Its name.
        frames : int
        """
        if self._fixed is not None:
            return self._fixed
        first = FIRST_S + FIRST_FRAME_S * frames
        known = self._slowest.get(detector)
        return first if known is None else min(first, max(LATER_S, LATER_TIMES * known * frames))

    def took(self, detector: str, frames: int, seconds: float) -> None:
        """Note what a detector took.

        Parameters
        ----------
        detector : str
            Its name.
        frames : int
        seconds : float
        """
        self._slowest[detector] = max(self._slowest.get(detector, 0.0), seconds / max(frames, 1))
