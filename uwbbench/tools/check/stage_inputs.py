"""Checks of a stage on hard samples and on other radars."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from uwbbench.api.capture import Capture
from uwbbench.api.case import NotApplicable
from uwbbench.api.errors import UwbbenchError
from uwbbench.measure.robustness.scene import altered, approach, chosen, on_radar
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.inputs import FRAMES
from uwbbench.tools.check.stage_subject import StageSubject, behind_all
from uwbbench.tools.check.values import Values, same

_READ_MORE = "uwbbench stability --help"
_RADAR = "uwbbench.api.radar.Radar"
SOME = np.arange(40)


def _made_of(change: Callable[[np.ndarray], Any]) -> Capture:
    """Forty frames of the undisturbed approach whose samples went through ``change``."""
    return altered(chosen(approach(frames=FRAMES), SOME), change)


def _survives(subject: StageSubject, capture: Capture) -> Values:
    """What the stage makes of a capture, with a number in every sample and profile.

    Raises
    ------
    Nonconformity
        If a value is infinite, or a number was to be expected and there is none.
    """
    stage = subject.opened(capture)
    block = subject.declared(behind_all(capture, subject.cls.consumes))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yielded = subject.run(block, (1, 7), stage)
    for name in subject.adds & yielded.keys():
        values = yielded[name]
        wrong = ~np.isfinite(values) if name in ("frames", "noise", "profile", "features") else np.isinf(values)
        if wrong.any():
            raise Nonconformity(f"finite values of {name}", f"{int(wrong.sum())} of {values.size} are not")
    return yielded


@check(_READ_MORE)
def zero_frames_are_fine(subject: StageSubject) -> None:
    """Frames of zeros, which a transceiver hands out when reception failed, give nothing infinite and no warning."""
    _survives(subject, _made_of(np.zeros_like))


@check(_READ_MORE)
def constant_frames_are_fine(subject: StageSubject) -> None:
    """Frames of one constant, whose span and spread are 0, give nothing infinite and no warning."""
    _survives(subject, _made_of(lambda samples: np.full_like(samples, 0.3 - 0.2j)))


@check(_READ_MORE)
def invalid_frames_are_fine(subject: StageSubject) -> None:
    """A capture of nothing but invalid frames comes through."""
    _survives(subject, _made_of(lambda samples: np.full_like(samples, np.nan)))


@check(_READ_MORE)
def faint_samples_are_fine(subject: StageSubject) -> None:
    """Samples near the smallest number give nothing infinite and no warning: scale before you square."""
    _survives(subject, _made_of(lambda samples: samples * 1e-160))


@check(_READ_MORE)
def loud_samples_are_fine(subject: StageSubject) -> None:
    """Samples a million times larger give nothing infinite and no warning."""
    _survives(subject, _made_of(lambda samples: samples * 1e6))


@check(_READ_MORE)
def single_precision_is_fine(subject: StageSubject) -> None:
    """Complex64 samples, as captures store them, come through like complex128."""
    _survives(subject, _made_of(lambda samples: samples.astype(np.complex64)))


@check(_READ_MORE)
def spikes_are_fine(subject: StageSubject) -> None:
    """Frames with one tap that is not zero come through: all statistics of their noise are 0."""

    def spiked(samples: np.ndarray) -> np.ndarray:
        samples[:] = 0
        samples[np.arange(len(samples)), 5 + np.arange(len(samples)) % 40] = 1
        return samples

    _survives(subject, _made_of(spiked))


def _on_other_radar(subject: StageSubject, **changes: Any) -> str:
    """Say how the stage takes to another radar: it works, or refuses in ``open`` with a message for users."""
    usual = subject.capture
    capture = _with_taps(usual, changes.get("taps", usual.radar.taps))
    capture = on_radar(capture, dataclasses.replace(capture.radar, **changes))
    try:
        block = subject.declared(behind_all(capture, subject.cls.consumes))
    except UwbbenchError as error:
        raise NotApplicable(f"the stages before it refuse this radar: {error}") from error
    try:
        stage, again = subject.opened(capture), subject.opened(capture)
    except UwbbenchError as error:
        return f"refused: {error}"
    same(subject.run(block, stage=stage), subject.run(block, (1, 50), again), "for any cut the same result")
    return "works"


def _with_taps(capture: Capture, taps: int) -> Capture:
    """Capture whose frames, and those of its background, end after some taps."""
    parts: dict[str, Any] = {
        name: np.asarray(samples)[:, :taps]
        for name in ("preamble", "sts1", "sts2")
        if (samples := getattr(capture, name)) is not None
    }
    background = None if capture.background is None else _with_taps(capture.background, taps)
    radar = dataclasses.replace(capture.radar, taps=taps)
    return dataclasses.replace(capture, radar=radar, background=background, **parts)


@check(_RADAR)
def short_frames_are_fine(subject: StageSubject) -> str:
    """A radar of 20 taps works, or is refused in ``open`` with a message: no window may reach beyond the frame."""
    return _on_other_radar(subject, taps=20)


@check(_RADAR)
def no_noise_taps_are_fine(subject: StageSubject) -> str:
    """A radar without taps before the first arrival works, or is refused in ``open`` with a message."""
    return _on_other_radar(subject, noise_taps=0)


@check(_RADAR)
def no_channel_is_fine(subject: StageSubject) -> str:
    """A radar that is no IEEE 802.15.4 radio, on a carrier of its own, works or is refused in ``open``."""
    return _on_other_radar(subject, channel=None, center_frequency_hz=4.3e9)


@check(_RADAR)
def delays_from_transmission_are_fine(subject: StageSubject) -> str:
    """A monostatic radar that counts delays from transmission works, or is refused in ``open`` with a message."""
    return _on_other_radar(subject, first_tap_delay_s=2e-9, tx_position_m=(0.0, 0.0, 0.0))


CHECKS = (
    zero_frames_are_fine,
    constant_frames_are_fine,
    invalid_frames_are_fine,
    faint_samples_are_fine,
    loud_samples_are_fine,
    single_precision_is_fine,
    spikes_are_fine,
    short_frames_are_fine,
    no_noise_taps_are_fine,
    no_channel_is_fine,
    delays_from_transmission_are_fine,
)
