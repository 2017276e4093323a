"""Length of the sliding windows that clutter removal decomposes."""

from __future__ import annotations

from pydantic import Field

from uwbbench.api import Params, Radar
from uwbbench_detectors.clutter.background import LEAST_FRAMES, frames_within

MOST_FRAMES = 64
"""Of a window whose length is given in seconds."""


class WindowParams(Params):
    """Length of a window, in frames or in seconds."""

    window_frames: int = Field(64, ge=2, description="Frames of the window, the current one included.")
    window_s: float | None = Field(
        None,
        gt=0,
        description="Seconds of the window, so that one fits radars of any frame rate: at least "
        f"{LEAST_FRAMES} frames, and at most {MOST_FRAMES}, as the time of a decomposition grows with them. "
        "window_frames, where it is given too, goes before.",
    )

    @property
    def least_frames(self) -> int:
        """Fewest frames that the window has for any radar."""
        return LEAST_FRAMES if self._in_seconds else self.window_frames

    def frames_for(self, radar: Radar) -> int:
        """Frames of the window for a radar."""
        if self.window_s is None or not self._in_seconds:
            return self.window_frames
        return min(frames_within(self.window_s, radar), MOST_FRAMES)

    @property
    def _in_seconds(self) -> bool:
        return self.window_s is not None and "window_frames" not in self.model_fields_set
