"""Fractional tap of the direct path, from which delays count."""

from __future__ import annotations

from typing import ClassVar, TypeVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, ConfigError, FloatArray, IntArray, Params, Radar, Stage, ports
from uwbbench_detectors.peaks.interpolation import vertex_shift

P = TypeVar("P", bound=Params)


class FirstPath(Stage[P]):
    """Where the delay is zero.

    Delays of a radar whose window opens a known time after transmission count from the transmission: its windows need
    not hold a direct path, and every method gives the tap, usually negative, at which the transmission lies.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("first_path")

    def taps_of(self, block: Block) -> FloatArray:
        """Fractional tap (frames,) of the direct path inside the window."""
        raise NotImplementedError

    def step(self, block: Block) -> Block:
        """Block with ``first_path``."""
        if self.radar.first_tap_delay_s is None:
            return block.replace(first_path=self.taps_of(block))
        transmission = -self.radar.first_tap_delay_s / self.radar.sample_interval_s
        return block.replace(first_path=np.full(len(block.frames), transmission))


class CrestSearchParams(Params):
    """Where the crest of the direct path is searched."""

    within_taps: int = Field(
        6, ge=1, description="Taps searched for the crest, counted from the end of the leading noise taps."
    )


S = TypeVar("S", bound=CrestSearchParams)


class CrestSearch(FirstPath[S]):
    """A first path that starts from the largest of the first taps.

    Raises
    ------
    ConfigError
        From ``open``, if all taps precede the first arrival.
    """

    def open(self, radar: Radar) -> None:
        """Check that there are taps to search."""
        super().open(radar)
        if radar.noise_taps >= radar.taps:
            raise ConfigError(f"first path: all {radar.taps} taps precede the first arrival (noise_taps)")

    def crest(self, amplitude: FloatArray) -> IntArray:
        """Tap (frames,) of the largest magnitude in the search window."""
        start = self.radar.noise_taps
        window = amplitude[:, start : start + self.params.within_taps]
        return np.asarray(start + np.argmax(window, axis=1), dtype=np.int64)


class CrestFirstPathParams(CrestSearchParams):
    """How the crest is found."""

    interpolate: bool = Field(
        False,
        description="Refine the tap by a parabola through the logarithms of three magnitudes; a whole tap is half a "
        "tap off at worst, 7.5 cm of range at 1 ns.",
    )


class CrestFirstPath(CrestSearch[CrestFirstPathParams]):
    """Crest of the direct path: the largest magnitude among the first taps.

    Delays then run from crest to crest, so that the rise time of the pulse cancels (arXiv 2512.01018 takes the index
    of the first path from the response itself).
    """

    implied = True
    fidelity = "from-source"

    def taps_of(self, block: Block) -> FloatArray:
        """Tap (frames,) of the crest, fractional if interpolated."""
        amplitude = block.frames.amplitude
        crest = self.crest(amplitude)
        return crest + log_parabola(amplitude, crest) if self.params.interpolate else crest.astype(np.float64)


class LeadingEdgeFirstPathParams(CrestSearchParams):
    """How the edge is found."""

    fraction: float = Field(
        0.5,
        gt=0,
        lt=1,
        description="Height of the edge, as a share of the crest. Against crest-to-crest delays ranges grow by 17 cm "
        "at 0.5 of a raised-cosine pulse of 2 ns, and by 37 cm at 0.2 of a 3.2 ns pulse.",
    )


class LeadingEdgeFirstPath(CrestSearch[LeadingEdgeFirstPathParams]):
    """Leading edge of the direct path: the first crossing of a share of its crest.

    The crossing is searched from the end of the leading noise taps up to the crest, and placed between two taps by
    linear interpolation, as receivers do in hardware.
    """

    def taps_of(self, block: Block) -> FloatArray:
        """Fractional tap (frames,) of the crossing."""
        amplitude = block.frames.amplitude
        row = np.arange(len(amplitude))
        threshold = self.params.fraction * amplitude[row, self.crest(amplitude)]
        start = self.radar.noise_taps
        above = amplitude[:, start : start + self.params.within_taps] >= threshold[:, None]
        tap = start + np.argmax(above, axis=1)
        before = np.where(tap > 0, amplitude[row, tap - 1], np.inf)  # the window itself may open above the threshold
        crosses = before < threshold
        high = amplitude[row, tap]
        back = np.zeros(len(amplitude))
        back[crosses] = ((high - threshold)[crosses]) / ((high - before)[crosses])
        return np.asarray(tap - back)


class ReportedFirstPathParams(Params):
    """Nothing to set."""


class ReportedFirstPath(FirstPath[ReportedFirstPathParams]):
    """First path as the device reports it.

    Chips report the leading edge of the pulse, 1 to 2.4 ns before its crest: ranges come out 15 to 37 cm longer than
    with the crest unless a bias takes that back.
    """

    needs: ClassVar[frozenset[str]] = ports("first_path")

    def taps_of(self, block: Block) -> FloatArray:
        """Fractional tap (frames,) from the capture."""
        reported = block.frames.first_path_index
        if reported is None:
            raise ConfigError("first_path.reported: the frames carry no reported first path")
        if not np.isfinite(reported[block.frames.valid]).all():
            self.note("first_path.reported: some frames have no reported first path, and nothing in them has a range")
        return np.asarray(reported, dtype=np.float64)


def log_parabola(amplitude: FloatArray, tap: IntArray) -> FloatArray:
    """Distance (frames,) in taps from each crest to the vertex of the parabola through three log magnitudes.

    Zero at the edges of the frame.

    Parameters
    ----------
    amplitude : (frames, taps) array
    tap : (frames,) int array
        One tap of each frame.
    """
    inside = (tap > 0) & (tap < amplitude.shape[1] - 1)
    row, middle = np.flatnonzero(inside), tap[inside]
    offset = np.zeros(len(tap))
    offset[row] = vertex_shift(amplitude[row, middle - 1], amplitude[row, middle], amplitude[row, middle + 1])
    return offset
