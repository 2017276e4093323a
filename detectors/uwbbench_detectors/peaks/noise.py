"""Noise level of each frame, in the units of its raw samples."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from pydantic import Field, model_validator

from uwbbench.api import Block, ConfigError, FloatArray, Params, Radar, Stage, ports

SUSPICIOUS_RATIO = 3.0
"""Leading noise over tail noise above which the leading taps hold more than noise."""
FRAMES_TO_JUDGE = 50


def rms(amplitude: FloatArray) -> FloatArray:
    """Root mean square along the taps, safe for any magnitude.

    Each frame is scaled by its largest sample first: squares of values below 1e-162 would vanish.

    Parameters
    ----------
    amplitude : (frames, taps) array

    Returns
    -------
    (frames,) array
    """
    largest = amplitude.max(axis=1)
    scaled = amplitude / np.where(largest > 0, largest, 1.0)[:, None]
    return np.asarray(largest * np.sqrt(np.mean(scaled * scaled, axis=1)))


def rayleigh_rms(amplitude: FloatArray) -> FloatArray:
    """Root mean square of the noise from the median magnitude along the taps.

    The magnitude of complex white noise with mean square s^2 is Rayleigh distributed,
    ``P(|h| > a) = exp(-a^2 / s^2)``, so that its median is ``s sqrt(ln 2)``. Echoes in less than half of the taps
    raise the estimate only a little.

    Parameters
    ----------
    amplitude : (frames, taps) array

    Returns
    -------
    (frames,) array
    """
    return np.asarray(np.median(amplitude, axis=1) / np.sqrt(np.log(2)))


class NoiseFloorParams(Params):
    """Where the noise is measured."""

    method: Literal["auto", "leading", "running_median", "tail", "median"] = Field(
        "auto",
        description="'leading': RMS of the taps before any arrival (the paper's); its spread over four taps is 2.3 dB "
        "in white noise and 2.9 dB in filter-correlated noise. 'running_median': median of that over past frames, "
        "steadier. 'tail': RMS of the last taps. 'median': from the median magnitude of all taps. 'auto': 'leading' "
        "where the radar has taps before any arrival, else 'median'.",
    )
    taps: int | None = Field(
        None, ge=1, description="Taps of the leading or tail window; null: as many as the radar's noise_taps."
    )
    frames: int = Field(50, ge=1, description="Frames of the running median, the current one included.")

    @model_validator(mode="after")
    def _taps_are_used(self) -> Self:
        if self.method == "median" and self.taps is not None:
            raise ValueError("'taps' has no meaning with method 'median', which looks at all taps")
        return self


class NoiseFloor(Stage[NoiseFloorParams]):
    """Root mean square of the noise in each frame.

    The paper takes the first four samples, which lie before the direct path (arXiv 2512.01018). They are noise only
    where the direct path's crest stands at tap 7 or later: with the crest at tap 5 the pulse itself fills them to
    -15...-24 dB of the crest, and a score against them becomes a ratio to the direct path. A note says so where the
    leading taps exceed three times the tail in most frames.

    Raises
    ------
    ConfigError
        From ``open``, if the window is empty or longer than a frame.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("noise")
    implied: ClassVar[bool] = True
    fidelity = "from-source"

    def open(self, radar: Radar) -> None:
        """Settle method and window for this radar."""
        super().open(radar)
        self.method = self.params.method
        if self.method == "auto":
            self.method = "leading" if radar.noise_taps else "median"
            if self.method == "median":
                self.note("noise_floor: no taps before the first arrival, used the median magnitude of all taps")
        self.taps = self.params.taps or radar.noise_taps
        if self.method != "median":
            if not self.taps:
                raise ConfigError(
                    f"noise_floor: method '{self.method}' needs 'taps', since this radar has no taps before the "
                    "first arrival (noise_taps is 0); or use method 'median'"
                )
            if self.taps > radar.taps:
                raise ConfigError(f"noise_floor: taps is {self.taps}, but a frame has only {radar.taps} taps")
        self._past: FloatArray = np.empty(0)
        self._judged = self._suspicious = 0

    def step(self, block: Block) -> Block:
        """Block with ``noise_rms``; 0 for frames without a signal."""
        amplitude = block.frames.amplitude
        if self.method == "median":
            return block.replace(noise_rms=rayleigh_rms(amplitude))
        tail = rms(amplitude[:, -self.taps :])
        if self.method == "tail":
            return block.replace(noise_rms=tail)
        leading = rms(amplitude[:, : self.taps])
        measured = block.frames.valid & amplitude.any(axis=1)
        self._judge(leading[measured], tail[measured])
        if self.method == "running_median":
            steady = np.zeros(len(leading))
            steady[measured] = self._running_median(leading[measured])
            leading = steady
        return block.replace(noise_rms=leading)

    def flush(self) -> None:
        """Judge the leading taps of a capture too short to have been judged before."""
        if self._judged < FRAMES_TO_JUDGE:
            self._conclude()

    def tally(self, judged: int, suspicious: int) -> None:
        """Take over the judgement of leading taps from elsewhere: frames judged so far, and suspicious ones of them."""
        concludes = judged == FRAMES_TO_JUDGE and self._judged < judged
        self._judged, self._suspicious = judged, suspicious
        if concludes:
            self._conclude()

    def _running_median(self, level: FloatArray) -> FloatArray:
        """Median (frames,) over each frame and those before it."""
        window = self.params.frames
        known = len(self._past)
        joined = np.concatenate([self._past, level])
        self._past = joined[max(len(joined) - window + 1, 0) :]
        starting = [np.median(joined[: end + 1]) for end in range(known, min(window - 1, len(joined)))]
        if len(joined) < window:
            return np.array(starting)
        return np.concatenate([starting, np.median(sliding_window_view(joined, window), axis=1)])

    def _judge(self, leading: FloatArray, tail: FloatArray) -> None:
        """Count suspicious frames among the first ones, so that the verdict does not hang on how blocks are cut."""
        judged = slice(0, max(FRAMES_TO_JUDGE - self._judged, 0))
        if not len(leading[judged]):
            return
        self._suspicious += int(np.sum(leading[judged] > SUSPICIOUS_RATIO * tail[judged]))
        self._judged += len(leading[judged])
        if self._judged == FRAMES_TO_JUDGE:
            self._conclude()

    def _conclude(self) -> None:
        if 2 * self._suspicious > self._judged:
            self.note(
                f"noise_floor: the first {self.taps} taps exceed {SUSPICIOUS_RATIO:g} times the noise of the last "
                f"{self.taps} in most of the frames judged; they hold more than noise, and scores against them are low"
            )
