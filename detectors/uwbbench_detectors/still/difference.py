"""Difference of a window from a background without obstacles."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Literal, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import (
    Bins,
    Block,
    BoolArray,
    ConfigError,
    Detections,
    FloatArray,
    IntArray,
    Params,
    Stage,
    WindowProfile,
    ports,
)
from uwbbench_detectors.peaks.interpolation import vertex_shift
from uwbbench_detectors.still.alignment import DIRECT_TAPS

ROUNDING = 64 * np.finfo(float).eps
"""Share of a mean below which a difference is an error of summation."""


class DifferenceParams(Params):
    """Where an obstacle is looked for."""

    guard_taps: float = Field(
        2.5, ge=0, description="Nothing is looked for nearer behind the direct crest of the background than this."
    )
    peak: Literal["max", "first"] = Field(
        "max",
        description="'max': the largest difference, the source's; 'first': the crest of the first run of bins over the "
        "threshold.",
    )
    run_taps: float = Field(1.0, gt=0, description="'first': shortest run over the threshold.")
    pulse_taps: float = Field(3.0, gt=0, description="'first': the crest is looked for this far behind its start.")

    interpolate: bool = Field(
        True,
        description="Refine crests, that of the direct path too, by a parabola through three bins. The source's "
        "re-implementation takes whole bins: 15 cm of range apart in integer alignment.",
    )

    @model_validator(mode="after")
    def _runs_are_used(self) -> Self:
        given = sorted({"run_taps", "pulse_taps"} & self.model_fields_set)
        if self.peak == "max" and given:
            raise ValueError(f"'{given[0]}' has no meaning with peak 'max', which looks at no runs; use peak 'first'")
        return self


P = TypeVar("P", bound=DifferenceParams)


class Difference(Stage[P]):
    """The bin in which a window differs most from the background, for all frames of the window.

    Taps count from the direct crest of the background, so that the rise of the pulse, and the offset of a reported
    first path from the crest, cancel. ``amplitude`` is the difference there, over the height of the direct path.

    Raises
    ------
    ConfigError
        From ``show_background``, if no window of the background can be used.
    """

    needs: ClassVar[frozenset[str]] = ports("background")
    produces: ClassVar[frozenset[str]] = ports("detections", "tap", "amplitude")
    fidelity = "reconstruction"

    name: ClassVar[str]
    statistic: ClassVar[str]

    def show_background(self, blocks: Iterable[Block]) -> None:
        """Take the background's windows together, and find the crest of its direct path."""
        self.background = background = Background.of(blocks, self.name)
        taps = background.bins.place
        near = np.flatnonzero((taps >= DIRECT_TAPS[0]) & (taps < DIRECT_TAPS[1]) & np.isfinite(background.mean))
        crest = int(near[np.argmax(background.mean[near])])
        self.crest_tap = self._tap(background.mean, crest)
        self._allowed = taps >= self.crest_tap + self.params.guard_taps

    def difference(self, windows: WindowProfile, row: int) -> tuple[FloatArray, FloatArray]:
        """What is searched (bins,) for the highest peak in one window, and what it must exceed (bins,)."""
        raise NotImplementedError

    def step(self, block: Block) -> Block:
        """Block with one detection for each frame of a window that differs from the background."""
        windows = block.windows(self.statistic)
        found = [self._found(windows, row) for row in range(len(windows.stop))]
        place = np.array([(math.nan, math.nan) if one is None else one for one in found]).reshape(-1, 2)
        frame = np.flatnonzero(windows.row >= 0)
        held = windows.row[frame]
        seen = np.isfinite(place[held, 0])
        frame, held = frame[seen], held[seen]
        detections = Detections(
            block.frames.first + frame,
            processed=block.frames.index,
            tap=block.part("first_path")[frame] + place[held, 0],
            amplitude=place[held, 1],
        )
        return block.replace(detections=detections)

    def _found(self, windows: WindowProfile, row: int) -> tuple[float, float] | None:
        """Taps behind the direct crest, and height, of what is found in one window."""
        searched, threshold = self.difference(windows, row)
        more = np.abs(searched) > ROUNDING * self.background.mean  # NaN is not
        searched = np.where(self._allowed & more, searched, -np.inf)
        above = searched > threshold
        if self.params.peak == "first":
            above = self._first_run(above)
        if not above.any():
            return None
        place = int(np.argmax(np.where(above, searched, -np.inf)))
        return self._tap(searched, place) - self.crest_tap, float(searched[place])

    def _tap(self, curve: FloatArray, place: int) -> float:
        """Taps from the first path to a crest (place) of a curve (bins,)."""
        shift = _vertex(curve, place) if self.params.interpolate else 0.0
        return float(self.background.bins.place[place] + shift / self.background.bins.per_tap)

    def _first_run(self, above: BoolArray) -> BoolArray:
        """Bins of the first long enough run over the threshold, no farther than a pulse reaches from its start."""
        shortest = max(math.ceil(self.params.run_taps * self.background.bins.per_tap), 1)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], above.astype(np.int8), [0]])))
        begin, end = edges[::2], edges[1::2]
        long = np.flatnonzero(end - begin >= shortest)
        first = np.zeros(len(above), np.bool_)
        if len(long):
            start = begin[long[0]]
            reach = max(round(self.params.pulse_taps * self.background.bins.per_tap), 1)
            first[start : start + reach] = above[start : start + reach]
        return first


@dataclass(frozen=True)
class Background:
    """All windows of a background taken together.

    Attributes
    ----------
    bins : Bins
    mean, sd : (bins,) arrays
        ``sd`` is NaN where no window has one.
    count : (bins,) int array
        Frames behind each.
    """

    bins: Bins
    mean: FloatArray
    sd: FloatArray
    count: IntArray

    @classmethod
    def of(cls, blocks: Iterable[Block], name: str) -> Background:
        """Background from the blocks that a stage is shown.

        Means and sums of squares about them are merged (Chan, Golub, LeVeque, The American Statistician 37(3), 1983).

        Parameters
        ----------
        blocks : iterable of Block
            However they are cut: a window is known by where it ends.
        name : str
            The stage, for the message.

        Raises
        ------
        ConfigError
            If no window can be used.
        """
        mean: dict[int, FloatArray] = {}
        sd: dict[int, FloatArray] = {}
        count: dict[int, IntArray] = {}
        refused: list[str] = []
        bins = None
        for block in blocks:
            windows, spread = block.windows("window_mean"), block.window_sd
            bins = windows.bins
            refused += windows.refused
            for row, stop in enumerate(windows.stop.tolist()):
                mean[stop], count[stop] = windows.value[row], windows.count[row]
                sd[stop] = np.full(bins.count, np.nan) if spread is None else spread.value[row]
        if bins is None or not mean:
            why = "; ".join(dict.fromkeys(refused)) or "it has no frames"
            raise ConfigError(f"{name}: the background gives no window to compare with: {why}")
        return cls(bins, *_merged(*(np.stack(list(part.values())) for part in (mean, sd, count))))


def _merged(mean: FloatArray, sd: FloatArray, count: IntArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Mean, standard deviation and count (bins,) of several windows (windows, bins)."""
    total = count.sum(axis=0)
    nothing = np.full(len(total), np.nan)
    known = np.where(count > 0, mean, 0.0)
    together = np.divide(np.sum(count * known, axis=0), total, out=nothing.copy(), where=total > 0)
    squares = np.where(count > 1, (count - 1) * sd**2, 0.0) + np.where(count > 0, count * (known - together) ** 2, 0.0)
    variance = np.divide(squares.sum(axis=0), total - 1, out=nothing.copy(), where=total > 1)
    return together, np.sqrt(variance), total


def _vertex(curve: FloatArray, place: int) -> float:
    """Distance in bins from a crest (place) of a curve (bins,) to the vertex of the parabola through three values."""
    if not 0 < place < len(curve) - 1:
        return 0.0
    before, crest, after = curve[place - 1 : place + 2]
    if not (np.isfinite(before) and np.isfinite(after)):
        return 0.0
    return float(vertex_shift(np.array([before]), np.array([crest]), np.array([after]))[0])


class MeanDifferenceParams(DifferenceParams):
    """Where an obstacle is looked for, and from which difference on."""

    sigmas: float | None = Field(
        3.0,
        ge=0,
        description="Threshold, in standard deviations of the differences below zero, which no obstacle causes but by "
        "shadowing; null takes the largest difference whatever it is, as the source does.",
    )


class MeanDifference(Difference[MeanDifferenceParams]):
    """BMA: the highest peak of the mean magnitude less that of the background.

    References
    ----------
    B. Van Herbruggen et al., IPIN 2023, doi 10.1109/IPIN57070.2023.10332499, as a public re-implementation quotes it,
    whose own the threshold and the first peak are.
    """

    name = "detect.bma"
    statistic = "window_mean"
    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path", "window_mean")

    def difference(self, windows: WindowProfile, row: int) -> tuple[FloatArray, FloatArray]:
        """Mean less the background's, and a threshold from what of it is negative."""
        difference = windows.value[row] - self.background.mean
        below = difference[self._allowed & (difference < 0)]
        sigma = math.sqrt(np.mean(below**2)) if len(below) else 0.0
        return difference, np.full(len(difference), (self.params.sigmas or 0.0) * sigma)


class DeviationDifferenceParams(DifferenceParams):
    """Where an obstacle is looked for, and how seldom noise is to be taken for one."""

    false_alarm_rate: float | None = Field(
        1e-3,
        gt=0,
        lt=1,
        description="Share of the bins without obstacle whose standard deviation exceeds its threshold; null takes the "
        "largest difference whatever it is, as the source does.",
    )


class DeviationDifference(Difference[DeviationDifferenceParams]):
    """BSDA: the highest peak of the standard deviation of the magnitude less that of the background.

    Of n frames of normally distributed magnitudes the ratio of the two variances follows an F distribution, so that a
    bin is taken for more than noise where the difference exceeds ``sd_b (sqrt(F(1 - P; n - 1, n_b - 1)) - 1)``.
    Magnitudes of noise alone are Rayleigh distributed, whose heavier tail makes 1.5 times the rate of it.

    Raises
    ------
    ConfigError
        From ``show_background``, if no window of the background can be used.

    References
    ----------
    B. Van Herbruggen et al., IPIN 2023, doi 10.1109/IPIN57070.2023.10332499, as a public re-implementation quotes it,
    whose own the threshold and the first peak are.
    """

    name = "detect.bsda"
    statistic = "window_sd"
    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path", "window_mean", "window_sd")

    def difference(self, windows: WindowProfile, row: int) -> tuple[FloatArray, FloatArray]:
        """Standard deviation less the background's, and a threshold from the F distribution."""
        background = self.background
        difference = windows.value[row] - background.sd
        if self.params.false_alarm_rate is None:
            return difference, np.zeros(len(difference))
        pairs, of_bin = np.unique(np.stack([windows.count[row], background.count]), axis=1, return_inverse=True)
        ratio = np.array([variance_ratio(self.params.false_alarm_rate, *pair) for pair in pairs.T.tolist()])
        return difference, background.sd * (np.sqrt(ratio[of_bin.ravel()]) - 1)


@lru_cache(maxsize=4096)
def variance_ratio(rate: float, count: int, background_count: int) -> float:
    """Ratio of two sample variances that is exceeded at a given rate where the true variances are equal.

    The upper quantile of the F distribution, as the inverse of the lower one with degrees of freedom exchanged, which
    keeps its digits at small rates.

    Parameters
    ----------
    rate : float
    count, background_count : int
        Normally distributed values behind each variance, numerator first.

    Returns
    -------
    float
        NaN where one of the variances is not known.
    """
    from scipy import special

    if min(count, background_count) < 2:
        return math.nan
    return 1 / float(special.fdtri(background_count - 1, count - 1, rate))
