"""A radar's own direct path: its template, its delay in the template, and the pulse of echoes that move.

The receiver's crest is that of the direct path *and* of what the robot sends back right behind it, its ringing. Echoes
have no ringing, so that delays from crest to crest have a zero that is off by up to several centimetres of range,
constant for one robot, receiver and response. Where the direct path lies inside the sum follows from its pulse alone,
and the pulse can be measured on echoes that move against the robot: ringing does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from uwbbench.api.arrays import BoolArray, ComplexArray, FloatArray
from uwbbench.api.errors import ConfigError
from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S
from uwbbench.api.radar import Radar

PulseShape = Callable[[FloatArray], ComplexArray]
"""Complex height of a pulse at times (s) from its crest, where it is 1."""

MINIMUM_ECHOES = 40
"""Echoes whose mean pulse is 16 dB less noisy than one: -38 dB of its crest, as each stands 22 dB out."""

MOST_UNSURE_S = 0.1e-9
"""Standard deviation beyond which a located direct path is not believed: 1.5 cm of range."""

FARTHEST_S = 1.0e-9
"""Delay behind the crest that no ringing causes, which moves it by up to 0.6 ns: a pulse too narrow ends there."""

WORST_MISFIT = 1.5
"""Misfit beyond which the template rises otherwise than the pulse: 0.2 to 0.8 where the pulse is right, 3 to 8 with a
Gaussian of 3.2 ns in place of a raised cosine of 2 ns or the other way round."""

_REACH, _PHASES, _SEARCHED = 8, 512, 6
_ALIKE, _TURN = 32, 8
"""Consecutive echoes on which others lie alike, 20 cm of way at 0.3 m/s and 48 Hz; those of one turn of a group."""

_PULSE_S: FloatArray = np.arange(-56.0, 57.0) * 0.125e-9
_GROUPS = 4


@cache
def _between() -> FloatArray:
    """Windowed sinc (phases + 1, 16) for the places between two taps."""
    off = np.arange(1 - _REACH, _REACH + 1) - np.arange(_PHASES + 1)[:, None] / _PHASES
    window = np.i0(6 * np.sqrt(np.clip(1 - (off / _REACH) ** 2, 0, 1)))
    table = np.sinc(off) * window
    return np.asarray(table / table.sum(axis=1, keepdims=True))


def between(samples: ComplexArray, tap: FloatArray) -> ComplexArray:
    """Values of a band-limited response between its taps, zero beyond its ends.

    Parameters
    ----------
    samples : (taps,) array
    tap : (n,) array

    Returns
    -------
    (n,) complex array
        By a sinc under a Kaiser window of 16 taps (beta 6), at places rounded to 1/512 tap.
    """
    low = np.floor(tap).astype(np.int64)
    weights = _between()[np.rint((tap - low) * _PHASES).astype(np.int64)]
    place = low[:, None] + np.arange(1 - _REACH, _REACH + 1)
    inside = (place >= 0) & (place < len(samples))
    return np.asarray((weights * np.where(inside, samples[np.clip(place, 0, len(samples) - 1)], 0)).sum(axis=1))


def crest_near(samples: ComplexArray, tap: int) -> float:
    """Crest of the magnitude within a tap of the largest sample: on sixteenths, refined by a parabola of logarithms."""
    grid = tap + np.arange(-16, 17) / 16
    height = np.abs(between(samples, grid))
    top = int(height.argmax())
    if not 0 < top < len(grid) - 1 or not height[top - 1 : top + 2].min() > 0:
        return float(grid[top])
    before, crest, after = np.log(height[top - 1 : top + 2])
    bend = before - 2 * crest + after
    return float(grid[top] + (0.5 * (before - after) / bend / 16 if bend < 0 else 0.0))


def stated_pulse(shape: Literal["gauss", "raised_cosine"], width_s: float) -> PulseShape:
    """Pulse that somebody states.

    Parameters
    ----------
    shape : {"gauss", "raised_cosine"}
        ``2^-(2 t / width)^2``, or the raised cosine of roll-off 0.5 that correlators of IEEE 802.15.4 radios show.
    width_s : float
        Full width at half height of the Gaussian; symbol duration of the raised cosine.
    """
    if shape == "gauss":
        return lambda time_s: np.exp2(-((2 * time_s / width_s) ** 2)).astype(complex)

    def raised_cosine(time_s: FloatArray) -> ComplexArray:
        # cos(pi x / 2) / (1 - x^2) without its pole, x = 2 b t / T with b = 1/2
        x = np.abs(time_s) / width_s
        return np.asarray(np.sinc(x) * np.pi / 2 * np.sinc((1 - x) / 2) / (1 + x), complex)

    return raised_cosine


@dataclass(frozen=True)
class Located:
    """Where the direct path lies.

    Attributes
    ----------
    delay_s : float
        Behind the crest of the template; negative before it.
    sd_s : float
        Standard deviation of the posterior.
    misfit : float
        Power that neither pulse nor ringing explains over what the model expects, per tap, where it fits best: about 1
        or less where the pulse is right, far more where the template rises otherwise than the pulse.
    """

    delay_s: float
    sd_s: float
    misfit: float


def locate(template: ComplexArray, crest: int, interval_s: float, pulse: PulseShape, noise: float) -> Located:
    """Delay of the direct path inside the template of direct path and ringing.

    The template is ``g p(t - b) + sum_k a_k p(t - b - d_k) + n`` with returns from 0.9 to 6 ns behind the direct path,
    whose amplitudes a_k are complex Gaussian of power ``L exp(-d / tau)``; b has a Gaussian prior of 0.5 ns. Given b, L
    and tau the template is Gaussian, so that its likelihood is ``exp(-y' S^-1 y) / det S`` with ``S = p p' + R V R' +
    s I``; the posterior of b is the sum over L (-22 to -4 dB) and tau (1 and 2.5 ns).

    Parameters
    ----------
    template : (taps,) complex array
        Mean of frames, 1 at its crest.
    crest : int
        Tap of the crest.
    interval_s : float
        Time between two taps.
    pulse : callable
        See :data:`PulseShape`.
    noise : float
        Power of noise in template and pulse, of the crest's; at least -42 dB is taken, for what the model leaves out.

    Returns
    -------
    Located
    """
    start, stop = max(crest - round(6e-9 / interval_s), 0), min(crest + round(5e-9 / interval_s), len(template))
    time_s = (np.arange(start, stop) - crest) * interval_s
    b_s = np.arange(-60, 61) * 0.025e-9
    behind_s = np.arange(0.9e-9, 6.01e-9, 0.5e-9)
    own = pulse(time_s - b_s[:, None])
    returns = pulse(time_s[:, None] - behind_s - b_s[:, None, None])
    observed = template[start:stop]
    floor = max(noise, 10**-4.2)
    prior = -0.5 * (b_s / 0.5e-9) ** 2
    logs, misfits = [], []
    for level_db in (-22.0, -16.0, -10.0, -4.0):
        for decay_s in (1.0e-9, 2.5e-9):
            power = 10 ** (level_db / 10) * np.exp(-behind_s / decay_s)
            spread = own[:, :, None] * own[:, None, :].conj()
            spread = spread + (returns * power) @ returns.conj().swapaxes(1, 2) + floor * np.eye(len(observed))
            _, volume = np.linalg.slogdet(spread)
            solved = np.linalg.solve(spread, np.broadcast_to(observed[:, None], (len(b_s), len(observed), 1)))[..., 0]
            unexplained = (observed.conj() * solved).sum(axis=1).real
            logs.append(prior - unexplained - volume)
            misfits.append(unexplained)
    log, misfit = np.array(logs), np.array(misfits)
    weight = np.exp(log - log.max()).sum(axis=0)
    weight /= weight.sum()
    mean_s = float((weight * b_s).sum())
    best = np.unravel_index(log.argmax(), log.shape)
    sd_s = math.sqrt(max(float((weight * (b_s - mean_s) ** 2).sum()), 0.0))
    return Located(mean_s, sd_s, float(misfit[best]) / len(observed))


def doubt(located: Located, echoes: Located | None = None) -> str:
    """Why a located direct path is not to be believed; empty where nothing speaks against it.

    Parameters
    ----------
    located : Located
    echoes : Located, optional
        By the pulse of moving echoes, where there are any: the only witness of a tail of the pulse itself, which
        ringing explains as well.
    """
    cm = 100 * SPEED_OF_LIGHT_M_S / 2
    if located.misfit > WORST_MISFIT:
        return (
            f"the direct path does not rise like the pulse (misfit {located.misfit:.1f}, at most {WORST_MISFIT:g} is "
            "that of the right one)"
        )
    if abs(located.delay_s) > FARTHEST_S:
        return (
            f"the direct path does not rise like the pulse, which places it {located.delay_s * cm:+.0f} cm of range "
            "from its crest, farther than ringing moves one"
        )
    if located.sd_s > MOST_UNSURE_S:
        return f"it is unsure by {located.sd_s * cm:.1f} cm of range, more than {MOST_UNSURE_S * cm:.1f}"
    if echoes is not None and doubt(echoes) == "":
        off_s, sd_s = located.delay_s - echoes.delay_s, math.hypot(located.sd_s, echoes.sd_s)
        if abs(off_s) > 3 * sd_s:
            return (
                f"echoes that move have another pulse: theirs places the direct path {off_s * cm:+.1f} cm of range "
                f"away, {abs(off_s) / sd_s:.1f} standard deviations"
            )
    return ""


class DirectPath:
    """A radar's direct path, learned frame by frame; what is learned does not depend on the scale of the samples.

    Parameters
    ----------
    radar : Radar

    Raises
    ------
    ConfigError
        If delays of the radar count from transmission: no direct path is their zero.

    Attributes
    ----------
    crest : int
        Tap that crests are moved to.
    template : (taps,) complex array
        Mean of the frames, each moved, turned and scaled to be 1 at its crest.
    count, heard : int
        Frames that the template was learned from, and that were compared with it.
    echoes : int
        Moving echoes whose pulse was taken.
    """

    def __init__(self, radar: Radar) -> None:
        if radar.first_tap_delay_s is not None:
            raise ConfigError("delays of this radar count from transmission: their zero is not its direct path")
        self.crest = min(radar.noise_taps + 3, radar.taps - 1)
        self.interval_s, self._leading = radar.sample_interval_s, radar.noise_taps
        self.template: ComplexArray = np.zeros(radar.taps, complex)
        self.count = self.heard = self.echoes = self._calm = 0
        self._noise = self._jitter = self._jitter_2 = self._spread = 0.0
        self._pulses: ComplexArray = np.zeros((_GROUPS, len(_PULSE_S)), complex)
        self._weights: FloatArray = np.zeros(_GROUPS)

    def aligned(self, samples: ComplexArray) -> tuple[float, ComplexArray] | None:
        """Crest of one frame (taps), and the frame moved, turned and scaled to be 1 there.

        None where a sample is not finite, or the crest is less than 20 dB above the rest of the frame's median.
        """
        top = float(np.abs(samples).max(initial=0.0))
        if not (np.isfinite(top) and top > 0):
            return None
        unit: ComplexArray = np.asarray(samples.astype(complex) / top)
        magnitude = np.abs(unit)
        place = self._leading + int(magnitude[self._leading : self._leading + _SEARCHED].argmax())
        if not (magnitude[place] > 0 and magnitude[place] >= 10 * np.median(magnitude)):
            return None
        crest = crest_near(unit, place)
        moved = between(unit, np.arange(float(len(unit))) + (crest - self.crest))
        return crest, np.asarray(moved / moved[self.crest])

    def learn(self, frame: ComplexArray) -> None:
        """Take an aligned frame into the template."""
        self.count += 1
        self.template = self.template + (frame - self.template) / self.count

    def listen(self, frame: ComplexArray) -> None:
        """Compare an aligned frame with the template: noise, scatter of the crest, and an echo that moves, if any."""
        rest: ComplexArray = np.asarray(frame - self.template, np.complex128)
        self.heard += 1
        power = np.abs(rest) ** 2
        noise = float(np.median(power)) / math.log(2)  # of exponentially distributed power
        self._noise += noise
        behind = self.crest + max(round(2e-9 / self.interval_s), 1)
        if power[behind : behind + round(5e-9 / self.interval_s)].max(initial=0.0) < 20 * noise:
            self._compare_crest(rest)  # a near echo would move it
        self._take_echo(rest, power, noise)

    def _compare_crest(self, rest: ComplexArray) -> None:
        """Delay of a frame on its template, by least squares on the flank, whose own crest lies at zero."""
        near = slice(max(self.crest - 3, 0), self.crest + 3)
        own, slope, seen = self.template[near], np.gradient(self.template)[near], rest[near]
        straight = slope - own * (own.conj() * slope).sum() / (np.abs(own) ** 2).sum()  # what no gain imitates
        steep = float((np.abs(straight) ** 2).sum())
        if steep > 0:
            late = float((straight.conj() * seen).sum().real) / steep
            self._calm += 1
            self._jitter += late
            self._jitter_2 += late**2

    def _take_echo(self, rest: ComplexArray, power: FloatArray, noise: float) -> None:
        """Add the pulse of the strongest echo where it is clear of noise, direct path and other echoes."""
        pulse_taps = round(7e-9 / self.interval_s)
        first, stop = self.crest + max(round(2e-9 / self.interval_s), 1), len(rest) - pulse_taps
        if stop <= first:
            return
        tap = first + int(power[first:stop].argmax())
        others: BoolArray = np.abs(np.arange(len(rest)) - tap) > pulse_taps
        clear = power[tap] > 10**2.2 * noise and tap >= self.crest + round(6e-9 / self.interval_s)
        if not clear or power[others].max(initial=0.0) > max(0.01 * power[tap], 10 * noise):
            return
        around: FloatArray = crest_near(rest, tap) + _PULSE_S / self.interval_s
        pulse = between(rest, around)
        middle = pulse[len(pulse) // 2]
        weight = min(power[tap] / noise if noise > 0 else math.inf, 1000.0)
        group = self.echoes // _TURN % _GROUPS
        self._pulses[group] += weight * pulse / middle
        self._weights[group] += weight
        self._spread += weight * float((np.abs(pulse / middle) ** 2).mean() - min(noise / power[tap], 1.0))
        self.echoes += 1

    @property
    def noise(self) -> float:
        """Power of the noise of one frame, of the crest's; NaN before a frame was listened to."""
        return self._noise / self.heard if self.heard else math.nan

    @property
    def crest_sd_s(self) -> float:
        """Scatter of the crest against the flank: standard deviation of one frame's, of those without an echo near."""
        if self._calm < MINIMUM_ECHOES:
            return math.nan
        return self.interval_s * math.sqrt(max(self._jitter_2 / self._calm - (self._jitter / self._calm) ** 2, 0.0))

    @property
    def echo_pulse(self) -> tuple[FloatArray, ComplexArray]:
        """Times (s) and complex heights of the mean pulse of the echoes; NaN without any."""
        total = self._weights.sum()
        height = self._pulses.sum(axis=0) / total if total else np.full(len(_PULSE_S), np.nan + 0j)
        return np.asarray(_PULSE_S), np.asarray(height, np.complex128)

    def by_echoes(self) -> Located | None:
        """Direct path located by the pulse of the moving echoes; None with fewer than :data:`MINIMUM_ECHOES`.

        Where the pulses differ by more than noise other echoes lie on them, much alike from frame to frame: that part
        of their variance counts as if every 32nd were a new one. Echoes in four turns give four pulses, and half the
        spread of what they say is part of the answer's standard deviation.
        """
        if self.echoes < MINIMUM_ECHOES:
            return None
        pulse, weight = self.echo_pulse[1], self._weights.sum()
        unlike = max(self._spread / weight - float((np.abs(pulse) ** 2).mean()), 0.0)
        noise = self.noise / self.count + 1 / weight + unlike / (self.echoes / _ALIKE)
        found = self._by(pulse, noise)
        each = [self._by(part / w, 4 * noise).delay_s for part, w in zip(self._pulses, self._weights, strict=True)]
        spread = float(np.std(each, ddof=1)) / math.sqrt(_GROUPS)
        return Located(found.delay_s, math.hypot(found.sd_s, spread), found.misfit)

    def _by(self, height: ComplexArray, noise: float) -> Located:
        def pulse(time_s: FloatArray) -> ComplexArray:
            real, imaginary = (np.interp(time_s, _PULSE_S, part, 0.0, 0.0) for part in (height.real, height.imag))
            return np.asarray(real + 1j * imaginary)

        return locate(self.template, self.crest, self.interval_s, pulse, noise)

    def by_pulse(self, pulse: PulseShape) -> Located:
        """Direct path located by a pulse that somebody states."""
        return locate(self.template, self.crest, self.interval_s, pulse, self.noise / max(self.count, 1))
