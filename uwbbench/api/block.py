"""What travels along the chain of stages: frames, and all that was computed about them so far."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uwbbench.api.aligned import AlignedProfile, WindowProfile
from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.detections import Detections
from uwbbench.api.errors import PluginError
from uwbbench.api.frames import Frames

PER_FRAME = ("first_path", "noise_rms", "profile", "aligned", "window_mean", "window_sd", "features")
"""Parts of a block that have a row for each frame."""


@dataclass(frozen=True)
class Block:
    """Frames and what the stages so far have made of them.

    A stage returns a new block with the parts that it produces. Arrays are shared, never changed in place.

    Attributes
    ----------
    frames : Frames
    first_path : (frames,) array or None
        Fractional tap at which the delay is zero. Port ``first_path``.
    noise_rms : (frames,) array or None
        Root mean square of the noise, in the units of the raw samples. Port ``noise``.
    profile : (frames, taps - profile_start) array or None
        The real-valued curve that detectors search. Port ``profile``.
    profile_start : int
        Tap of the first column of ``profile``, whose columns are taps of the frame.
    aligned : AlignedProfile or None
        Magnitudes that count from the first path, on bins of their own. Port ``aligned``.
    window_mean, window_sd : WindowProfile or None
        Mean and standard deviation of aligned magnitudes over windows of frames. Ports of the same names.
    features : (frames, taps, features) array or None
        Numbers that describe each tap, for stages that classify taps. Port ``features``.
    detections : Detections
        Rows so far; may hold rows of earlier frames behind a stage that delays them. Port ``detections``.
    """

    frames: Frames
    first_path: FloatArray | None = None
    noise_rms: FloatArray | None = None
    profile: FloatArray | None = None
    profile_start: int = 0
    aligned: AlignedProfile | None = None
    window_mean: WindowProfile | None = None
    window_sd: WindowProfile | None = None
    features: FloatArray | None = None
    detections: Detections = field(default_factory=Detections.empty)

    def replace(self, **parts: Any) -> Block:
        """Block with some parts replaced."""
        held = self.__dict__.copy()
        held.update(parts)
        if len(held) > len(self.__dict__):
            raise TypeError(f"a block has no {', '.join(parts.keys() - self.__dict__.keys())}")
        made = object.__new__(Block)  # several times cheaper than dataclasses.replace, in every stage of every call
        object.__setattr__(made, "__dict__", held)
        return made

    def with_columns(self, **columns: Any) -> Block:
        """Block whose detections carry more columns."""
        return self.replace(detections=self.detections.with_columns(**columns))

    @property
    def rows(self) -> IntArray:
        """Row of this block's frames that each detection belongs to (n,)."""
        return self.detections.frame - self.frames.first

    def part(self, name: str) -> FloatArray:
        """``first_path``, ``noise_rms``, ``profile`` or ``features``, known to be there.

        Raises
        ------
        PluginError
            If no stage has produced it: the asking stage does not declare what it consumes.
        """
        return np.asarray(self._known(name))

    @property
    def aligned_profile(self) -> AlignedProfile:
        """``aligned``, known to be there; raises as :meth:`part` does."""
        aligned: AlignedProfile = self._known("aligned")
        return aligned

    def windows(self, name: str) -> WindowProfile:
        """``window_mean`` or ``window_sd``, known to be there; raises as :meth:`part` does."""
        windows: WindowProfile = self._known(name)
        return windows

    def _known(self, name: str) -> Any:
        value = getattr(self, name)
        if value is None:
            raise PluginError(
                f"a stage uses '{name}', which no earlier stage has produced; it must declare that it consumes it"
            )
        return value

    def cut(self, start: int, stop: int) -> Block:
        """Frames ``start`` to ``stop`` of this block, with all that is known of them and their detections."""
        rows = self.rows
        parts: dict[str, Any] = {
            name: value[start:stop] for name in PER_FRAME if (value := getattr(self, name)) is not None
        }
        if len(rows):
            parts["detections"] = self.detections.take((rows >= start) & (rows < stop))
        return self.replace(frames=self.frames.part(start, stop), **parts)

    @staticmethod
    def join(blocks: list[Block]) -> Block:
        """One block from consecutive ones."""
        if len(blocks) == 1:
            return blocks[0]
        first = blocks[0]

        def stacked(name: str) -> Any:
            parts = [getattr(block, name) for block in blocks]
            if parts[0] is None:
                return None
            return np.concatenate(parts) if isinstance(parts[0], np.ndarray) else type(parts[0]).join(parts)

        return first.replace(
            frames=Frames.join([block.frames for block in blocks]),
            detections=Detections.join([block.detections for block in blocks]),
            **{name: stacked(name) for name in PER_FRAME},
        )
