"""What a drive shows of the robot itself: direct path, ringing, noise, and where delays begin. No truth is needed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from uwbbench.api import registry
from uwbbench.api.arrays import ComplexArray, FloatArray
from uwbbench.api.block import Block
from uwbbench.api.capture import Capture
from uwbbench.api.direct_path import MINIMUM_ECHOES, DirectPath, Located, PulseShape, doubt
from uwbbench.api.errors import ConfigError, ScoringError
from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S
from uwbbench.detect.pipeline import Pipeline
from uwbbench.measure.calibration import Calibration, stages_of

RESPONSES = ("preamble", "sts1", "sts2")
NEAR_S = 8e-9
"""Delay up to which an echo lies on the ringing that locates the direct path."""

_MOST_FRAMES = 4000
"""Frames that a template is learned from; of longer captures every n-th."""


@dataclass(frozen=True)
class OwnPath:
    """A robot's own direct path in one response of one receiver.

    Attributes
    ----------
    receiver, response : str
    frames : int
        With a direct path; the template is the mean of those without an echo on their ringing.
    snr_db : float
        Crest of the direct path over the noise of one frame.
    crest_sd_m : float
        Scatter of one frame's crest, of range.
    ringing_db : float
        Highest of the template from 5 ns behind its crest on, to the crest.
    echoes : int
        Moving echoes that stood clear.
    pulse_width_s : float
        Full width at half height of their mean; NaN with fewer than 40.
    located : Located or None
        Direct path behind the crest.
    doubt : str
        Why it is not to be believed, or could not be located; empty where it is sure enough.
    template : (taps,) complex array
        1 at ``crest``.
    crest : int
    """

    receiver: str
    response: str
    frames: int
    snr_db: float
    crest_sd_m: float
    ringing_db: float
    echoes: int
    pulse_width_s: float
    located: Located | None
    doubt: str
    template: ComplexArray
    crest: int

    @property
    def zero_m(self) -> float:
        """Direct path behind its crest, of range; NaN where it was not located."""
        return math.nan if self.located is None else self.located.delay_s * SPEED_OF_LIGHT_M_S / 2

    @property
    def zero_sd_m(self) -> float:
        """Standard deviation of it."""
        return math.nan if self.located is None else self.located.sd_s * SPEED_OF_LIGHT_M_S / 2


def own_paths(capture: Capture, pulse: PulseShape | None = None) -> list[OwnPath]:
    """What a drive shows of the robot itself, response by response.

    Parameters
    ----------
    capture : Capture
        Of a radar that moves; anything may be in view, or nothing.
    pulse : callable, optional
        The radar's pulse, by whoever knows it; left out: that of moving echoes.

    Raises
    ------
    ScoringError
        If the radar's delays do not begin at its direct path, or no frame has one.
    """
    rows = {name: getattr(capture, name) for name in RESPONSES if getattr(capture, name) is not None}
    every = _every(len(capture))
    return [_own_path(capture, name, np.asarray(samples)[every], pulse) for name, samples in rows.items()]


def calibrate_zero(detector: Pipeline, capture: Capture, pulse: PulseShape | None = None) -> Calibration:
    """Zero of delay of a detector, from what a drive shows of the robot itself; no truth is needed.

    The direct path is located in the frames that the detector's first path is taken from, and compared with it. What
    the range is off by follows as ``c / 2`` times that, which is exact for a transmitter behind the receiver; at 0.6 m
    beside a baseline of 25 cm it is 4 % less than it should be.

    Parameters
    ----------
    detector : Pipeline
    capture : Capture
    pulse : callable, optional
        As in :func:`own_paths`.

    Returns
    -------
    Calibration
        Its offsets replace those that the detector has.

    Raises
    ------
    ScoringError
        If the direct path could not be located, or is not sure enough; the message says why.
    ConfigError
        If the detector has no first path.
    """
    own = own_paths(capture, pulse)
    preamble = own[0]
    for path in own:
        if path.doubt and (path is preamble or _takes(detector, capture, path.response)):
            raise ScoringError(f"capture '{capture.name}', receiver '{path.receiver}', {path.response}: {path.doubt}")
    assert preamble.located is not None  # noqa: S101 - there is a doubt without
    late_s = _late_s(detector, capture, [path.response for path in own])
    if "preamble" not in late_s:
        raise ScoringError(f"detector '{detector.name}' found no first path on capture '{capture.name}'")
    zeros_s = {
        path.response: late_s[path.response] + path.located.delay_s
        for path in own
        if path.located is not None and not path.doubt and path.response in late_s
    }
    return Calibration(
        range_bias_m=zeros_s["preamble"] * SPEED_OF_LIGHT_M_S / 2,
        azimuth_bias_rad=None,
        n=preamble.frames,
        stages=stages_of(detector, capture.radar),
        range_scatter_m=preamble.crest_sd_m,
        range_sd_m=preamble.zero_sd_m,
        zeros_s=zeros_s,
    )


def _takes(detector: Pipeline, capture: Capture, response: str) -> bool:
    """Whether a step of the detector takes the zero of a response."""
    stages = stages_of(detector, capture.radar).values()
    return any(stage.recalibrated(f"{response}_delay_s", 0.0) for stage in stages)


def _late_s(detector: Pipeline, capture: Capture, responses: Sequence[str]) -> dict[str, float]:
    """Median delay of the crest of each response behind the detector's first path, in the frames it is given."""
    direct = DirectPath(capture.radar)
    late: dict[str, list[float]] = {name: [] for name in responses}
    for block in _located_blocks(detector, capture):
        every = _every(len(block.frames))
        for name in responses:
            for samples, first_path in zip(
                getattr(block.frames, name)[every], block.part("first_path")[every], strict=True
            ):
                found = direct.aligned(samples)
                if found is not None and np.isfinite(first_path):
                    late[name].append(found[0] - first_path)
    interval_s = capture.radar.sample_interval_s
    return {name: float(np.median(taps)) * interval_s for name, taps in late.items() if taps}


def _located_blocks(detector: Pipeline, capture: Capture) -> Iterator[Block]:
    """Blocks behind the step that gives the first path, with all responses."""
    for step, after in pairwise(detector.config.steps):
        if "first_path" in registry.load_plugin("stages", step.use).produces:
            return detector.arriving(capture, after.label, sts=capture.radar.has_sts)
    raise ConfigError(f"detector '{detector.name}' has no step that gives a first path")


def _every(frames: int) -> slice:
    """At most so many frames, evenly over all."""
    return slice(None, None, max(-(-frames // _MOST_FRAMES), 1))


def _own_path(capture: Capture, response: str, rows: ComplexArray, pulse: PulseShape | None) -> OwnPath:
    """One response's direct path: its template first, then all frames against it."""
    try:
        direct = DirectPath(capture.radar)
    except ConfigError as error:
        raise ScoringError(f"capture '{capture.name}': {error}") from error
    frames = [found[1] for samples in rows if (found := direct.aligned(samples)) is not None]
    if not frames:
        raise ScoringError(f"capture '{capture.name}': no frame's {response} has a direct path 20 dB above its median")
    for frame in _calm(np.array(frames), direct):
        direct.learn(frame)
    for frame in frames:
        direct.listen(frame)
    echoes = direct.by_echoes()
    if pulse is not None:
        located: Located | None = direct.by_pulse(pulse)
        why = doubt(located, echoes) if located else ""
    else:
        located = echoes
        why = (
            doubt(located)
            if located
            else f"only {direct.echoes} echoes that move stood clear, and a pulse needs {MINIMUM_ECHOES}: without them "
            "the direct path cannot be told from what the robot rings, unless the pulse is stated"
        )
    behind = direct.template[direct.crest + round(5e-9 / direct.interval_s) :]
    return OwnPath(
        receiver=capture.radar.receiver,
        response=response,
        frames=len(frames),
        snr_db=-10 * math.log10(direct.noise) if direct.noise > 0 else math.inf,
        crest_sd_m=direct.crest_sd_s * SPEED_OF_LIGHT_M_S / 2,
        ringing_db=20 * math.log10(max(float(np.abs(behind).max(initial=0.0)), 1e-12)),
        echoes=direct.echoes,
        pulse_width_s=_width_s(*direct.echo_pulse) if echoes else math.nan,
        located=located,
        doubt=why,
        template=direct.template,
        crest=direct.crest,
    )


def _calm(frames: ComplexArray, direct: DirectPath) -> ComplexArray:
    """Aligned frames without an echo so near that it would be learned as ringing; all, where fewer than 40 are."""
    usual = np.median(frames.real, axis=0) + 1j * np.median(frames.imag, axis=0)
    power = np.abs(frames - usual) ** 2
    noise = np.median(power, axis=1) / math.log(2)
    near = power[:, direct.crest + 1 : direct.crest + round(NEAR_S / direct.interval_s)].max(axis=1, initial=0.0)
    calm = near < 20 * noise
    return frames[calm] if calm.sum() >= MINIMUM_ECHOES else frames


def _width_s(time_s: FloatArray, height: ComplexArray) -> float:
    """Full width at half height of a pulse, whose crest is in the middle; NaN where it does not fall so far."""
    magnitude, middle = np.abs(height), len(height) // 2
    edges = []
    for side in (magnitude[middle::-1], magnitude[middle:]):
        below = np.flatnonzero(side < 0.5)
        if not len(below):
            return math.nan
        high, low = side[below[0] - 1], side[below[0]]
        edges.append(below[0] - (0.5 - low) / (high - low))
    return float(sum(edges) * (time_s[1] - time_s[0]))
