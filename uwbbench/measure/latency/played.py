"""What is timed, and on what: a detector on a capture, or one with a mapper on a run; the loops know no difference."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol


class Records(Protocol):
    """An answer."""

    def records(self) -> list[dict[str, Any]]:
        """Rows as plain values."""


class Stepping(Protocol):
    """A detector at work."""

    @property
    def needs(self) -> frozenset[str]:
        """What it needs of what it works on."""

    @property
    def stages(self) -> tuple[Any, ...]:
        """Its stages."""

    def step(self, frames: Any, /) -> Records:
        """Answer that is known after these frames."""

    def flush(self) -> Records:
        """Answer that was held back."""


class Timed(Protocol):
    """A detector."""

    def open(self, capture: Any, /) -> Stepping:
        """Start on a capture or a run."""


class Played(Protocol):
    """A capture or a run, whose frames are handed over."""

    def __len__(self) -> int: ...

    def frames(self, start: int, stop: int, /, *, sts: bool = True) -> Any:
        """Frames of all receivers.

        Parameters
        ----------
        start, stop : int
            First frame or step, and the one behind the last.
        sts : bool
            With STS responses.
        """

    def blocks(self, size: int, /, *, sts: bool = True) -> Iterator[Any]:
        """Frames in consecutive blocks."""
