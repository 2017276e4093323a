"""The real-valued curve of each frame that detectors search."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from uwbbench.api import Block, ConfigError, Detections, FloatArray, Params, Radar, Stage, ports


def profile_start(name: str, skip_taps: int | None, radar: Radar) -> int:
    """First tap of the profile.

    Parameters
    ----------
    name : str
        The stage, for the message.
    skip_taps : int or None
        Leading taps left out; None: the radar's ``noise_taps``.
    radar : Radar

    Raises
    ------
    ConfigError
        If no tap is left.
    """
    start = radar.noise_taps if skip_taps is None else skip_taps
    if start >= radar.taps:
        raise ConfigError(f"{name}: skipping {start} of {radar.taps} taps leaves nothing to search; lower 'skip_taps'")
    return start


class AmplitudeProfileParams(Params):
    """Which taps are searched."""

    skip_taps: int | None = Field(
        None, ge=0, description="Leading taps left out; null: the radar's noise_taps, which precede any arrival."
    )


class AmplitudeProfile(Stage[AmplitudeProfileParams]):
    """Magnitudes as they are, without the leading noise taps.

    Raises
    ------
    ConfigError
        From ``open``, if no tap is left.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("profile")

    def open(self, radar: Radar) -> None:
        """Settle the taps kept."""
        super().open(radar)
        self.start = profile_start("profile.amplitude", self.params.skip_taps, radar)

    def step(self, block: Block) -> Block:
        """Block with the profile."""
        return block.replace(profile=block.frames.amplitude[:, self.start :], profile_start=self.start)


class MinMaxProfileParams(AmplitudeProfileParams):
    """Which samples are stretched to the span from 0 to 1."""

    scope: Literal["frame", "frame_all_taps", "recording"] = Field(
        "frame",
        description="Where minimum and maximum come from: the kept taps of each frame; all taps of each frame; the "
        "kept taps of the whole recording, which makes heights comparable across frames but holds every frame back "
        "until the end.",
    )


class MinMaxProfile(Stage[MinMaxProfileParams]):
    """Magnitudes scaled to the span from 0 to 1.

    ``y = (|h| - min) / (max - min)`` as in arXiv 2512.01018. The maximum of a frame is normally the direct path, so
    every height and prominence is relative to it: 6 dB more isolation between the antennas doubles them, and a plate
    that outshines the direct path sets the scale itself. Frames whose samples differ by rounding alone become zeros.

    Raises
    ------
    ConfigError
        From ``open``, if no tap is left.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("profile")
    implied: ClassVar[bool] = True
    fidelity = "from-source"

    def open(self, radar: Radar) -> None:
        """Settle the taps kept."""
        super().open(radar)
        self.start = profile_start("profile.minmax", self.params.skip_taps, radar)
        self._held: list[Block] = []

    def step(self, block: Block) -> Block:
        """Block with the profile, or an empty one where frames are held back."""
        if self.params.scope == "recording":
            self._held.append(block)
            nothing = block.cut(0, 0).replace(detections=Detections.empty())
            return self._scaled(nothing, np.zeros(0), np.zeros(0))
        amplitude = block.frames.amplitude
        ruling = amplitude if self.params.scope == "frame_all_taps" else amplitude[:, self.start :]
        return self._scaled(block, ruling.min(axis=1), ruling.max(axis=1))

    def flush(self) -> Block | None:
        """All frames, scaled by the extremes of the valid ones."""
        if not self._held:
            return None
        block = Block.join(self._held)
        self._held = []
        ruling = block.frames.amplitude[block.frames.valid, self.start :]
        lowest, highest = (ruling.min(), ruling.max()) if ruling.size else (0.0, 0.0)
        frames = len(block.frames)
        return self._scaled(block, np.full(frames, lowest), np.full(frames, highest))

    def _scaled(self, block: Block, lowest: FloatArray, highest: FloatArray) -> Block:
        """Block with the profile between the given extremes (frames,)."""
        span = highest - lowest
        # A ripple of a few units in the last place on a constant frame must not become a full-scale peak.
        varies = block.frames.valid & (span > 8 * np.finfo(float).eps * highest)
        kept = block.frames.amplitude[:, self.start :]
        profile = np.zeros(kept.shape)
        profile[varies] = (kept[varies] - lowest[varies, None]) / span[varies, None]
        return block.replace(profile=profile, profile_start=self.start)
