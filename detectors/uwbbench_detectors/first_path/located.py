"""First paths that look for the direct path inside what the robot rings: by a known pulse, or by that of echoes."""

from __future__ import annotations

import math
from typing import ClassVar, Literal, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import MINIMUM_ECHOES, Block, DirectPath, FloatArray, Located, Params, Radar, doubt, stated_pulse
from uwbbench_detectors.first_path.estimators import FirstPath

P = TypeVar("P", bound=Params)

LEARNING = 48
"""Frames behind which the template is looked at for the first time."""


class LocatedFirstPath(FirstPath[P]):
    """Crest of the direct path, moved to where the direct path lies in the running template.

    Class attributes
    ----------------
    label : str
        Name in notes.
    first_look : int
        Witnesses that the first look needs.
    """

    label: ClassVar[str]
    first_look: ClassVar[int] = LEARNING

    def open(self, radar: Radar) -> None:
        """Start without a template."""
        super().open(radar)
        self._direct = DirectPath(radar) if radar.first_tap_delay_s is None else None
        self._zero_taps = 0.0
        self._next = self.first_look

    def witnesses(self, direct: DirectPath) -> int:
        """What a look needs, and twice as many for the next: frames."""
        return direct.count

    def locate(self, direct: DirectPath) -> tuple[Located | None, str]:
        """Where the direct path lies, and why that is not to be believed; empty where it is."""
        raise NotImplementedError

    def taps_of(self, block: Block) -> FloatArray:
        """Fractional tap (frames,): the crest plus the delay found in earlier frames; NaN where there is no crest."""
        assert self._direct is not None  # noqa: S101 - the base class knows the others' zero
        taps = np.full(len(block.frames), math.nan)
        for row, samples in enumerate(block.frames.preamble):
            found = self._direct.aligned(samples) if block.frames.valid[row] else None
            if found is None:
                continue
            crest, frame = found
            taps[row] = crest + self._zero_taps
            if self._direct.count >= LEARNING // 2:
                self._direct.listen(frame)
            self._direct.learn(frame)
            witnesses = self.witnesses(self._direct)
            if self._direct.count >= LEARNING and witnesses >= self._next:
                self._next *= 2
                self._look(self._direct)
        return taps

    def _look(self, direct: DirectPath) -> None:
        located, why = self.locate(direct)
        self._zero_taps = 0.0 if located is None or why else located.delay_s / direct.interval_s
        if why and not self.notes:  # one is enough: the next look says the same with other figures
            self.note(f"{self.label}: refused after {direct.count} frames, and the zero stays at the crest: {why}")


class KnownPulseParams(Params):
    """The pulse of the radar, by whoever knows it."""

    shape: Literal["gauss", "raised_cosine"] = Field(
        description="Shape that the pulse of a single echo has in the response. It has no default: a wrong one moves "
        "the zero by decimetres."
    )
    width_ns: float | None = Field(
        None,
        gt=0,
        description="Full width at half height of a Gaussian, which needs it; symbol duration of the raised cosine, "
        "one over the radar's bandwidth if left out.",
    )

    @model_validator(mode="after")
    def _gauss_has_a_width(self) -> Self:
        if self.shape == "gauss" and self.width_ns is None:
            raise ValueError("a Gaussian pulse needs its 'width_ns'")
        return self


class KnownPulseFirstPath(LocatedFirstPath[KnownPulseParams]):
    """Direct path by a pulse that is known, where the radar does not contradict it; an opt-in.

    From frame 48 on, whenever the number of frames has doubled, the delay of the direct path behind the crest is the
    mean of its posterior in the running template (:func:`uwbbench.api.direct_path.locate`). It is refused, with a note,
    and the zero stays at the crest, where the template does not fit pulse and ringing, where it leaves the direct path
    unsure by more than 1.5 cm of range, or where the pulse of moving echoes places it elsewhere. **Without moving
    echoes a tail of the pulse itself cannot be told from ringing**: the template is the same, and the zero is off by
    what the tail moves it, 4 cm for one of -9 dB behind one tap. It takes about a third of a millisecond a frame.
    """

    label = "first_path.known_pulse"

    def open(self, radar: Radar) -> None:
        """Take the pulse."""
        super().open(radar)
        width_ns = self.params.width_ns
        width_s = 1 / radar.bandwidth_hz if width_ns is None else width_ns * 1e-9
        self._pulse = stated_pulse(self.params.shape, width_s)

    def locate(self, direct: DirectPath) -> tuple[Located | None, str]:
        """By the stated pulse, and what speaks against it."""
        located = direct.by_pulse(self._pulse)
        return located, doubt(located, direct.by_echoes())


class EchoPulseFirstPath(LocatedFirstPath[Params]):
    """Direct path by the pulse of echoes that move against the robot, measured on the way.

    Echoes hold no ringing, so that their mean is the pulse of the radar, tails and all. Once 40 of them stood 22 dB
    above the noise, 6 ns behind the crest, and 20 dB above all others, and whenever their number has doubled, they
    locate the direct path as in ``first_path.known_pulse``; until then, and where the answer is unsure by more than 1.5
    cm of range, the zero stays at the crest. The zero steps by up to some centimetres where it is found. It takes about
    a third of a millisecond a frame.
    """

    label = "first_path.echo_pulse"
    first_look = MINIMUM_ECHOES

    def witnesses(self, direct: DirectPath) -> int:
        """Echoes."""
        return direct.echoes

    def locate(self, direct: DirectPath) -> tuple[Located | None, str]:
        """By the echoes; not yet where there are too few."""
        located = direct.by_echoes()
        return located, "" if located is None else doubt(located)
