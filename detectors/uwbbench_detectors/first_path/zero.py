"""Responses moved by what calibration found between the crest and the direct path of each."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, Params, Radar, Stage, ports
from uwbbench_detectors.position.receivers import of_receiver

RESPONSES = ("preamble", "sts1", "sts2")


class AlignZeroParams(Params):
    """Delay of the direct path behind its crest, for all receivers or by their names: of ``uwbbench calibrate``."""

    preamble_ns: float | dict[str, float] = Field(0.0, description="Of the preamble response; negative before it.")
    sts1_ns: float | dict[str, float] = Field(0.0, description="Of the first antenna's STS response.")
    sts2_ns: float | dict[str, float] = Field(0.0, description="Of the second antenna's.")


class AlignZero(Stage[AlignZeroParams]):
    """Each response moved so that its direct path, and not its crest, lies at the first path.

    For chains that use several responses. Each has a crest of its own: the direct path reaches two antennas, and the
    robot rings behind it in each, so that responses aligned on their crests show one echo at delays that differ by up
    to 0.6 ns (9 cm of range). Moved by ``-zero`` as a band-limited signal, ``IDFT(DFT(a) exp(2 pi i f zero))``, they
    agree. It stands behind the step that aligns the crests and gives the first path, which stays where it is; a step
    that searches the crest behind it would undo it.

    Raises
    ------
    ConfigError
        From ``open``, if a parameter does not name the receiver.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path")
    produces: ClassVar[frozenset[str]] = ports("frames")

    def open(self, radar: Radar) -> None:
        """Transfer functions of the receiver's delays."""
        super().open(radar)
        zeros_ns = (of_receiver(getattr(self.params, f"{name}_ns"), radar, f"{name}_ns") for name in RESPONSES)
        frequency_hz = np.fft.fftfreq(radar.taps, radar.sample_interval_s)
        self._turns = {
            name: np.exp(2j * np.pi * frequency_hz * zero_ns * 1e-9)
            for name, zero_ns in zip(RESPONSES, zeros_ns, strict=True)
            if zero_ns and radar.first_tap_delay_s is None
        }

    def recalibrated(self, column: str, offset: float) -> dict[str, float]:
        """A zero of a response that is ``offset`` seconds later, for ``preamble_delay_s`` and those of both STS."""
        name = column.removesuffix("_delay_s")
        if name not in RESPONSES or name == column:
            return {}
        zero_ns = of_receiver(getattr(self.params, f"{name}_ns"), getattr(self, "radar", None), f"{name}_ns")
        return {f"{name}_ns": zero_ns + offset * 1e9}

    def step(self, block: Block) -> Block:
        """Block with moved responses."""
        moved: dict[str, Any] = {
            name: np.fft.ifft(np.fft.fft(samples, axis=1) * turn, axis=1).astype(samples.dtype)
            for name, turn in self._turns.items()
            if (samples := getattr(block.frames, name)) is not None
        }
        return block.replace(frames=dataclasses.replace(block.frames, **moved)) if moved else block
