"""Responses filtered by the pulse of their radar."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from uwbbench.api import Block, Params, Radar, Stage, ports
from uwbbench_detectors.integrate.motion import plain


class MatchedFilterParams(Params):
    """Which pulse."""

    width_ns: float | None = Field(
        None,
        gt=0,
        description="Width of the pulse between its half amplitudes; null: 1.2 over the radar's bandwidth, that of a "
        "root raised cosine of roll-off 0.5 behind its correlator, as IEEE 802.15.4 has it: 2.4 ns at 499.2 MHz.",
    )


class MatchedFilter(Stage[MatchedFilterParams]):
    """Each response behind a filter with the shape of its pulse.

    For an echo ``a p(t - tau)`` in white noise of power s a tap, no linear filter gives a higher ratio of the echo's
    crest to the noise than the correlation with p: ``|a|^2 sum p^2 / s``. The pulse here is a Gaussian, whose width is
    all that a radar says of itself; one that is 20 % off costs 0.2 dB. The filter is scaled so that the crest of an
    echo keeps its amplitude. It widens pulses by a root of two, and helps against noise alone: not where the noise has
    passed a correlator itself, as in the channel impulse responses of most radios, and not against other echoes.

    References
    ----------
    North, Proc. IEEE 51(7):1016, 1963.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames")
    produces: ClassVar[frozenset[str]] = ports("frames")

    def open(self, radar: Radar) -> None:
        """Sample the pulse."""
        super().open(radar)
        from uwbbench_detectors.smooth.matched_loops import matched_frames

        self._matched = matched_frames
        self.pulse = pulse_taps(radar, self.params.width_ns)

    def step(self, block: Block) -> Block:
        """Block with filtered frames."""
        frames = block.frames
        parts = {}
        for name in ("preamble", "sts1", "sts2"):
            samples = getattr(frames, name)
            if samples is not None:
                parts[name] = plain(self._matched(plain(samples, np.complex64), self.pulse), np.complex64)
        return block.replace(frames=dataclasses.replace(frames, **parts))


def pulse_taps(radar: Radar, width_ns: float | None) -> NDArray[Any]:
    """A Gaussian pulse on an odd number of taps, scaled so that filtering leaves its own crest at 1.

    Parameters
    ----------
    radar : Radar
    width_ns : float or None
        Between half amplitudes; None: 1.2 over the bandwidth.

    Returns
    -------
    (2 n + 1,) float32 array
    """
    width_s = 1.2 / radar.bandwidth_hz if width_ns is None else width_ns * 1e-9
    half = max(1, int(np.ceil(1.5 * width_s / radar.sample_interval_s)))
    time = np.arange(-half, half + 1) * radar.sample_interval_s / width_s
    shape = np.exp(-4 * np.log(2) * time**2)
    return np.asarray(shape / np.sum(shape**2), np.float32)
