"""Segments by the entropy of sliding windows."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Block, ConfigError, Detections, Params, Radar, Stage, ports

_LENGTHS = ("window", "tail", "guard", "merge", "minimum")
_COLUMNS = ("tap", "start_tap", "stop_tap", "amplitude", "score_db")
_PULSES = "in pulse lengths (1 / bandwidth) instead of taps, so that one value fits radars of any sampling; rounded."


class EntropyParams(Params):
    """Windows, what their entropy is compared with, and how they make up segments."""

    window_taps: int = Field(5, ge=1, le=256, description="Samples of a sliding window.")
    estimator: Literal["gauss", "vasicek"] = Field(
        "gauss",
        description="'gauss': ln(pi e mean|x|^2), the entropy of complex normal samples, which is the logarithm of the "
        "window's mean power. 'vasicek': from spacings of the sorted magnitudes (Vasicek 1976).",
    )
    spacing: int = Field(
        2, ge=1, description="'vasicek': ranks to each side of a sample that its spacing spans; below half the window."
    )
    sigmas: float = Field(
        5.0,
        ge=0,
        description="A window is hot from this many robust standard deviations (1.4826 MAD) of the tail above its "
        "median. Share of frames of white noise (50 taps) with a segment: 14.3 % at 3, 3.1 % at 5, 0.7 % at 7; of "
        "noise that the radar's filter has shaped 16.4, 4.1 and 1.3 %.",
    )
    reference: Literal["tail", "frame"] = Field(
        "tail",
        description="Windows whose median and spread are those of noise: the last ones, or all of a frame, for frames "
        "that hold echoes to the end.",
    )
    tail_taps: int = Field(16, ge=4, description="Last windows of a frame that make the tail.")
    guard_taps: int = Field(
        3, ge=1, description="Least distance of the middle of a hot window behind the first path: ringing lies before."
    )
    merge_taps: int = Field(1, ge=0, description="Runs with this many cold windows between them, or fewer, are one.")
    minimum_taps: int = Field(2, ge=1, description="Shorter segments are dropped.")
    window_pulses: float | None = Field(None, gt=0, le=64, description=f"Window {_PULSES}")
    tail_pulses: float | None = Field(None, gt=0, description=f"Tail {_PULSES}")
    guard_pulses: float | None = Field(None, gt=0, description=f"Guard {_PULSES}")
    merge_pulses: float | None = Field(None, ge=0, description=f"Gap that is bridged {_PULSES}")
    minimum_pulses: float | None = Field(None, gt=0, description=f"Shortest segment {_PULSES}")

    @model_validator(mode="after")
    def _one_unit(self) -> Self:
        for name in _LENGTHS:
            if {f"{name}_taps", f"{name}_pulses"} <= self.model_fields_set:
                raise ValueError(f"give {name}_taps or {name}_pulses, not both")
        if self.reference == "frame" and {"tail_taps", "tail_pulses"} & self.model_fields_set:
            raise ValueError("a tail has no meaning with reference 'frame', which looks at all windows")
        return self

    def taps_of(self, name: str, radar: Radar) -> int:
        """Length of ``name``, such as ``window``, in taps of a radar; never 0 where 0 has no meaning."""
        pulses = getattr(self, f"{name}_pulses")
        if pulses is None:
            return int(getattr(self, f"{name}_taps"))
        taps = round(pulses / (radar.bandwidth_hz * radar.sample_interval_s))
        least: int = {"merge": 0, "tail": 4}.get(name, 1)
        return max(int(taps), least)


class EntropySegments(Stage[EntropyParams]):
    """Segments where the entropy of a sliding window exceeds that of the frame's tail.

    A window is hot where its differential entropy exceeds ``median + sigmas 1.4826 MAD`` of the tail. Neighbouring hot
    windows make a segment, from the middle of the first to that of the last, half a tap more on either side. Its
    ``tap`` and ``amplitude`` are those of its strongest sample, ``start_tap`` and ``stop_tap`` its ends, ``score_db``
    the largest entropy inside over the tail's median, as a ratio of powers.

    With the estimator ``gauss`` the entropy is the logarithm of the mean power, so that this is a detector of
    energy with a threshold that follows noise of any strength. Where the tail's entropies have no spread, as without
    noise, there is no threshold: nothing is found, and a note says so.

    Of the source its abstract alone could be read: differential entropy of sliding windows makes regions of interest.
    Window, threshold and estimator are chosen here.

    Raises
    ------
    ConfigError
        From ``open``, if a frame has fewer windows than the tail, or the spacing spans the window.

    References
    ----------
    A. Mimouna et al., "Entropy-based Ultra-Wide Band radar signals segmentation for multi obstacle detection",
    2021; O. Vasicek, J. Royal Statistical Society B 38(1), 1976 (estimator).
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path")
    produces: ClassVar[frozenset[str]] = ports("detections", "tap", "start_tap", "stop_tap", "amplitude", "score_db")
    fidelity = "reconstruction"

    def open(self, radar: Radar) -> None:
        """Work out all lengths in taps of this radar."""
        super().open(radar)
        from uwbbench_detectors.segments import entropy_loops

        p = self.params
        window, tail, guard, merge, minimum = (p.taps_of(name, radar) for name in _LENGTHS)
        windows = radar.taps - window + 1
        if p.reference == "frame":
            tail = windows
        if windows < max(tail, 4):
            raise ConfigError(
                f"segment.entropy: windows of {window} taps and a tail of {tail} of them need "
                f"{window + max(tail, 4) - 1} taps, but a frame has {radar.taps}; lower one of them"
            )
        if p.estimator == "vasicek" and 2 * p.spacing >= window:
            raise ConfigError(
                f"segment.entropy: a spacing of {p.spacing} must be below half the window of {window} taps"
            )
        self._segments = entropy_loops.segments
        kind = getattr(entropy_loops, p.estimator.upper())
        self._settings = ((kind, window, p.spacing), tail, p.sigmas, (float(guard), merge, minimum))

    def step(self, block: Block) -> Block:
        """Block with a detection for each segment, by frame and then tap."""
        frames = block.frames
        first_path = block.part("first_path")
        found, silent = self._segments(frames.amplitude, first_path, frames.first, *self._settings)
        if silent:
            self.note(
                "segment.entropy: in some frames the entropies of the tail have no spread; without noise there is no "
                "threshold, and nothing is found in them"
            )
        looked_at = (frames.first, np.ones(len(frames), bool))
        return block.replace(detections=Detections.of_table(_COLUMNS, found, looked_at, ()))
