"""Local maxima of the profile, with the prominence and width of each."""

from __future__ import annotations

import warnings
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from uwbbench.api import Block, Detections, FloatArray, IntArray, Params, Stage, ports


class PeaksParams(Params):
    """How prominence and width are measured."""

    relative_height: float = Field(
        0.5, gt=0, le=1, description="Depth below the crest, as a share of the prominence, at which width is measured."
    )
    window_taps: int | None = Field(
        None,
        ge=2,
        description="Taps around a peak that its prominence looks at, rounded up to an odd number; null: all.",
    )


class Peaks(Stage[PeaksParams]):
    """Every local maximum of the profile.

    A tap, or the middle of a flat top (rounded down), that is higher than what lies on both sides. The first and last
    tap of the profile are never peaks, so a crest that falls on one is not seen. The prominence is the height above
    the higher of the two lowest points between the peak and the next higher terrain (or the end of the profile). The
    width is the distance between the two crossings of the level ``height - relative_height * prominence``, each found
    by linear interpolation, and so measured in taps. At the default relative height no width is below 0.5 taps: the
    slopes of a peak cannot be steeper.

    The definitions, and up to rounding the values, are those of ``find_peaks``, ``peak_prominences`` and
    ``peak_widths`` of SciPy, which arXiv 2512.01018 describes; ``amplitude`` is the magnitude of the samples at the
    tap, whatever the profile is scaled to.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "profile")
    produces: ClassVar[frozenset[str]] = ports("detections", "tap", "amplitude", "prominence", "width_taps")
    fidelity = "from-source"

    def step(self, block: Block) -> Block:
        """Block with one detection for every peak, by frame and then tap."""
        profile = block.part("profile")
        row, column, prominence, width = peaks_of(profile, self.params.relative_height, self.params.window_taps)
        tap = column + block.profile_start
        detections = Detections(
            block.frames.index[row],
            processed=block.frames.index,
            tap=tap,
            amplitude=block.frames.amplitude[row, tap],
            prominence=prominence,
            width_taps=width,
        )
        return block.replace(detections=detections)


def peaks_of(
    profile: FloatArray, relative_height: float = 0.5, window_taps: int | None = None
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Peaks of all rows at once.

    SciPy runs over one flat array with a NaN between rows: no comparison with NaN holds, so neither a peak nor the
    search for its bases and crossings reaches over it.

    Parameters
    ----------
    profile : (frames, taps) array
    relative_height : float
        Depth below the crest, as a share of the prominence, at which width is measured.
    window_taps : int, optional
        Taps around a peak that its prominence looks at.

    Returns
    -------
    row, column : (peaks,) int arrays
    prominence, width : (peaks,) arrays
    """
    from scipy import signal  # costs more than everything else at start-up

    separated = np.full((profile.shape[0], profile.shape[1] + 1), np.nan)
    separated[:, :-1] = profile
    flat = separated.ravel()
    peak, _ = signal.find_peaks(flat)
    with warnings.catch_warnings():
        # Prominences and widths of 0, from a window inside a flat top or next to the smallest number, are values too.
        warnings.simplefilter("ignore", RuntimeWarning)
        bases = signal.peak_prominences(flat, peak, wlen=window_taps)
        _, _, left, right = signal.peak_widths(flat, peak, relative_height, prominence_data=bases)
    row, column = np.divmod(peak, separated.shape[1])
    first = peak - column
    prominence, left_base, right_base = bases
    level = flat[peak] - prominence * relative_height
    start = _crossing(flat, first, np.floor(left).astype(np.int64), left_base, level, -1)
    stop = _crossing(flat, first, np.ceil(right).astype(np.int64), right_base, level, 1)
    return row, column, prominence, stop - start


def _crossing(
    flat: FloatArray, first: IntArray, at: IntArray, base: IntArray, level: FloatArray, direction: Literal[-1, 1]
) -> FloatArray:
    """Where the profile falls to ``level``, in taps from the first one of each peak's row.

    SciPy counts from the start of the flat array and so loses digits as it grows; only the whole tap beyond the
    crossing, ``at``, is taken from there, and that may have been rounded to the tap before.
    """
    at = at + direction * ((at != base) & (flat[at] > level))
    low = flat[at]
    share = np.zeros(len(at))
    np.divide(level - low, flat[at - direction] - low, out=share, where=low < level)
    return np.asarray((at - first) - direction * share)
