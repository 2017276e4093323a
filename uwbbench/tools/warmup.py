"""Compiling ahead what detectors compile, by running them as they will be run.

Compiled functions are made for the types of what they are handed: single or double precision, with STS or without. No
detector is asked what it compiles; each runs on small captures of all kinds, as a batch, frame by frame, and keeping
what its filters drop.
"""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from uwbbench.api import registry
from uwbbench.api.capture import Capture
from uwbbench.api.errors import ConfigError, UwbbenchError
from uwbbench.api.interruption import by_plugin
from uwbbench.api.locate import shipped
from uwbbench.api.radar import CHANNEL_CENTER_HZ
from uwbbench.detect.pipeline import Pipeline, load_detector
from uwbbench.measure.robustness.scene import approach

FRAMES = 64
"""Frames of each capture: mapping stages collect 50 positions before they first work."""


@dataclasses.dataclass(frozen=True)
class Warmed:
    """What became of one detector.

    Attributes
    ----------
    detector : str
    seconds : float
    compiled, loaded : int
        Functions that were compiled for some types, and that were there already.
    failure : str or None
        Why it could not be run, or broke.
    """

    detector: str
    seconds: float
    compiled: int
    loaded: int
    failure: str | None = None


def installed_detectors() -> list[str]:
    """Names of all shipped and registered detectors."""
    return list(dict.fromkeys([*shipped("detectors"), *registry.entries("detectors")]))


def warm_up(names: Iterable[str]) -> Iterator[Warmed]:
    """Run detectors on captures of all kinds, one after the other.

    Parameters
    ----------
    names : iterable of str
        Names or files.

    Yields
    ------
    Warmed
        For each name, as soon as it is done. One that fails does not stop the others.
    """
    from uwbbench.api.compiling import compile_counts  # takes 0.4 s, and a list of detectors needs none of it

    kinds = list(captures())
    for name in names:
        start, before, failure = time.perf_counter(), compile_counts(), None
        try:
            _run_on_all(load_detector(name), kinds)
        except UwbbenchError as error:
            failure = str(error)
        except BaseException as error:  # whatever a plugin raises is that plugin's fault alone
            if not by_plugin(error):
                raise
            failure = f"{type(error).__name__}: {error}"
        after = compile_counts()
        yield Warmed(
            name, time.perf_counter() - start, after.fresh - before.fresh, after.loaded - before.loaded, failure
        )


def _run_on_all(detector: Pipeline, kinds: Iterable[Capture]) -> None:
    """Run a detector on all captures that have what it needs.

    Raises
    ------
    ConfigError
        If none has.
    """
    reasons = []
    fits = False
    for capture in kinds:
        try:
            stream = detector.open(capture)
        except ConfigError as error:
            reasons.append(str(error))
            continue
        fits = True
        for frames in capture.blocks(1):
            stream.step(frames)
        stream.flush()
        for candidates in (False, True):
            detector.run(capture, candidates=candidates)
    if not fits:
        raise ConfigError(f"fits none of the built-in captures: {reasons[0]}")


def captures() -> Iterator[Capture]:
    """Small synthetic captures of all kinds that compiled functions tell apart.

    Yields
    ------
    Capture
        On channel 5 and 9, with and without STS, in single and double precision.
    """
    whole = approach(frames=FRAMES)
    for channel, sts, dtype in itertools.product((5, 9), (True, False), (np.complex64, np.complex128)):
        background = None if whole.background is None else _of_kind(whole.background, channel, dtype, sts=sts)
        capture = _of_kind(dataclasses.replace(whole, background=None), channel, dtype, sts=sts)
        yield dataclasses.replace(capture, background=background)


def _of_kind(whole: Capture, channel: int, dtype: type[np.complexfloating[Any, Any]], *, sts: bool) -> Capture:
    """The same capture on a channel, in a precision, with its STS or without."""
    samples: dict[str, Any] = dict.fromkeys(("sts1", "sts2", "first_path_index_sts1", "first_path_index_sts2"))
    for name in ("preamble", "sts1", "sts2") if sts else ("preamble",):
        samples[name] = np.array(getattr(whole, name), dtype)
    radar = dataclasses.replace(
        whole.radar, channel=channel, center_frequency_hz=CHANNEL_CENTER_HZ[channel], has_sts=sts
    )
    return dataclasses.replace(whole, name=f"warm-up, channel {channel}", radar=radar, **samples)
