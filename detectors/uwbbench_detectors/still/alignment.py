"""Magnitudes of frames at equal delays behind their first paths."""

from __future__ import annotations

from typing import ClassVar, Literal, TypeVar

import numpy as np
from pydantic import Field

from uwbbench.api import AlignedProfile, Bins, Block, ComplexArray, ConfigError, FloatArray, Params, Radar, Stage, ports
from uwbbench_detectors.peaks.interpolation import vertex_shift
from uwbbench_detectors.still.interpolation import between_taps

P = TypeVar("P", bound=Params)

FIRST_TAP = -4
"""Where the bins begin, in taps behind the first path: the rise of the direct path is among them."""
DIRECT_TAPS = (-2, 4)
"""Where the crest of the direct path is looked for, in taps behind the first path, which may be its leading edge."""
LEAST_CREST = 2.0
"""Height of a direct path over the mean magnitude of its frame; a frame of noise or of a constant has none."""
AT_ONCE = 256
"""Frames that are worked on together, so that what is made of them stays in the processor's cache."""


class Alignment(Stage[P]):
    """Magnitudes of each frame on bins that count from its first path, over the height of its direct path.

    The phase of a transceiver's frame is random, so that only magnitudes can be taken together. They are divided by the
    crest of the direct path (a parabola through the logarithms of three magnitudes), as no capture counts the
    preambles that a transceiver has accumulated. Frames without a first path or without a direct path stay empty.

    Raises
    ------
    ConfigError
        From ``open``, for a radar whose delays count from transmission: no direct path need be in its frames.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path")
    produces: ClassVar[frozenset[str]] = ports("aligned")
    fidelity = "reconstruction"

    name: ClassVar[str]

    @property
    def bins_per_tap(self) -> int:
        """Bins a tap."""
        raise NotImplementedError

    @property
    def minimum_filled(self) -> float:
        """Share of the bins that the frames of a window must fill."""
        return 0.0

    def magnitude(self, samples: ComplexArray, first_path: FloatArray) -> FloatArray:
        """Magnitudes (frames, bins), NaN where a frame has no sample.

        Parameters
        ----------
        samples : (frames, taps) array
        first_path : (frames,) array
            NaN where it is not known.
        """
        raise NotImplementedError

    def open(self, radar: Radar) -> None:
        """Lay out the bins for the radar's frames."""
        super().open(radar)
        if radar.first_tap_delay_s is not None:
            raise ConfigError(
                f"{self.name}: delays of this radar count from transmission, and no direct path to align on need be in "
                "its frames"
            )
        self.bins = Bins(FIRST_TAP, self.bins_per_tap, radar.taps * self.bins_per_tap)

    def step(self, block: Block) -> Block:
        """Block with aligned magnitudes."""
        first_path = block.part("first_path")
        first_path = np.where(np.abs(first_path) < self.radar.taps, first_path, np.nan)
        aligned = np.empty((len(block.frames), self.bins.count))
        for start in range(0, len(aligned), AT_ONCE):
            rows = slice(start, start + AT_ONCE)
            samples = np.asarray(block.frames.preamble[rows], np.complex128)
            aligned[rows] = self._over_direct_crest(samples, first_path[rows])
        return block.replace(aligned=AlignedProfile(self.bins, aligned, self.minimum_filled))

    def _over_direct_crest(self, samples: ComplexArray, first_path: FloatArray) -> FloatArray:
        amplitude = np.abs(samples)  # exact down to the smallest numbers, whose squares vanish
        crest = direct_crest(amplitude, first_path)[:, None]
        known = crest > LEAST_CREST * np.mean(amplitude, axis=1, keepdims=True)
        with np.errstate(over="ignore"):  # beside a direct path of next to nothing
            magnitude = self.magnitude(samples, first_path) / np.where(known, crest, 1.0)
        return np.where(known & np.isfinite(magnitude), magnitude, np.nan)


def direct_crest(amplitude: FloatArray, first_path: FloatArray) -> FloatArray:
    """Height (frames,) of the direct path between the taps; 0 where there is none.

    Parameters
    ----------
    amplitude : (frames, taps) array
    first_path : (frames,) array
        NaN where it is not known.
    """
    near = np.arange(*DIRECT_TAPS)
    known = np.isfinite(first_path)
    tap = np.floor(np.where(known, first_path, 0.0)).astype(np.int64)[:, None] + near
    row = np.arange(len(amplitude))
    inside = known[:, None] & (tap > 0) & (tap < amplitude.shape[1] - 1)
    height = np.where(inside, amplitude[row[:, None], np.where(inside, tap, 0)], 0.0)
    place = np.argmax(height, axis=1)
    crest, tap = height[row, place], np.where(inside, tap, 1)[row, place]
    before, after = amplitude[row, tap - 1], amplitude[row, tap + 1]
    shift = vertex_shift(before, crest, after)
    bends = (np.minimum(before, after) > 0) & (crest >= np.maximum(before, after))
    fall = np.log(np.where(bends, before, 1.0)) - np.log(np.where(bends, after, 1.0))
    return np.asarray(crest * np.exp(-fall * shift / 4))


class IntegerAlignmentParams(Params):
    """Nothing to set."""


class IntegerAlignment(Alignment[IntegerAlignmentParams]):
    """ICIR: frames moved by whole taps, so that the tap before the first path is the same in all.

    What lies between two taps is lost, up to half a tap or 7.5 cm of range either way, and a static echo changes from
    frame to frame as the taps fall differently on it.

    References
    ----------
    B. Van Herbruggen et al., IPIN 2023, doi 10.1109/IPIN57070.2023.10332499, as a public re-implementation quotes it.
    """

    name = "cir.icir"

    @property
    def bins_per_tap(self) -> int:
        """One."""
        return 1

    def magnitude(self, samples: ComplexArray, first_path: FloatArray) -> FloatArray:
        """Magnitudes of whole taps."""
        amplitude = np.abs(samples)
        known = np.isfinite(first_path)
        tap = np.floor(np.where(known, first_path, 0.0)).astype(np.int64)[:, None]
        tap = tap + self.bins.first_tap + np.arange(self.bins.count)
        inside = known[:, None] & (tap >= 0) & (tap < amplitude.shape[1])
        return np.where(inside, amplitude[np.arange(len(tap))[:, None], np.where(inside, tap, 0)], np.nan)


class FractionalAlignmentParams(Params):
    """How finely frames are sampled anew."""

    upsampling: int = Field(8, ge=1, le=64, description="Bins a tap.")
    interpolation: Literal["quadratic", "fft", "linear"] = Field(
        "quadratic",
        description="Curve through the samples: 'quadratic' spline, the source's; 'fft', exact for a response of "
        "limited band that does not reach over the ends of the frame; 'linear'.",
    )


class FractionalAlignment(Alignment[FractionalAlignmentParams]):
    """UCIR: frames sampled anew, more finely, from the fractional first path on.

    References
    ----------
    B. Van Herbruggen et al., IPIN 2023, doi 10.1109/IPIN57070.2023.10332499, as a public re-implementation quotes it;
    that real and imaginary part are interpolated, and not the magnitude, is chosen here.
    """

    name = "cir.ucir"

    @property
    def bins_per_tap(self) -> int:
        """Bins a tap."""
        return self.params.upsampling

    def magnitude(self, samples: ComplexArray, first_path: FloatArray) -> FloatArray:
        """Magnitudes between the taps."""
        return np.abs(between_taps(samples, first_path, self.bins, self.params.interpolation))


class MergedAlignmentParams(Params):
    """The bins that all frames of a window share."""

    bins_per_tap: int = Field(8, ge=1, le=64, description="Bins a tap.")
    minimum_filled: float = Field(
        0.9, gt=0, le=1, description="Share of the bins that the frames of a window must fill; below it there is none."
    )


class MergedAlignment(Alignment[MergedAlignmentParams]):
    """ACIR: every tap goes to the bin nearest to it, so that the frames of a window together make one fine response.

    It lives from first paths that fall differently between the taps from frame to frame: where all have the same
    fraction, most bins stay empty. No value is made up but those of the few empty bins, which a statistic over a window
    fills from both sides.

    References
    ----------
    B. Van Herbruggen et al., IPIN 2023, doi 10.1109/IPIN57070.2023.10332499, as a public re-implementation quotes it.
    """

    name = "cir.acir"

    @property
    def bins_per_tap(self) -> int:
        """Bins a tap."""
        return self.params.bins_per_tap

    @property
    def minimum_filled(self) -> float:
        """Share of the bins that the frames of a window must fill."""
        return self.params.minimum_filled

    def magnitude(self, samples: ComplexArray, first_path: FloatArray) -> FloatArray:
        """Magnitudes of the taps in the bins nearest to them."""
        amplitude = np.abs(samples)
        known = np.isfinite(first_path)
        behind = np.arange(amplitude.shape[1]) - np.where(known, first_path, 0.0)[:, None] - self.bins.first_tap
        nearest = np.floor(behind * self.bins.per_tap + 0.5).astype(np.int64)
        inside = known[:, None] & (nearest >= 0) & (nearest < self.bins.count)
        rows = np.full((len(amplitude), self.bins.count), np.nan)
        row, tap = np.nonzero(inside)
        rows[row, nearest[row, tap]] = amplitude[row, tap]
        return rows
