"""Azimuth from the phase difference of arrival."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Block, ConfigError, FloatArray, Params, Radar, Stage, ports
from uwbbench_detectors.position.receivers import of_receiver

PAPER_FACTOR = 0.95
"""Printed divisor of the angle, which equals twice the antenna spacing in wavelengths on channel 9."""


class AzimuthParams(Params):
    """How a phase difference becomes an angle."""

    formula: Literal["paper", "paper_inside", "physical", "table"] = Field(
        "paper",
        description="'paper' asin(alpha/pi)/0.95; 'paper_inside' asin(alpha/(0.95 pi)), within 1 degree of it inside "
        "+-45; 'physical' asin(alpha lambda / (2 pi s)); 'table' interpolates measured pairs. On channel 5 the paper's "
        "form reads too small with a channel 9 array: 20, 30, 45 degrees become 16.2, 24.0, 34.9.",
    )
    spacing_m: float | None = Field(
        None, gt=0, description="Antenna spacing s for 'physical'; null takes the radar's own."
    )
    bias_deg: float | dict[str, float] = Field(
        0.0,
        description="Calibration offset that is subtracted, one for all receivers or by their names. The paper's are "
        "0.0522 rad = 2.99 (channel 5) and 0.0209 rad = 1.20 (channel 9).",
    )
    bias_domain: Literal["theta", "alpha"] = Field(
        "theta", description="Whether the offset belongs to the angle or to the phase difference."
    )
    sign: Literal[1, -1] = Field(1, description="-1 where the board's STS1 antenna is the left one.")
    table: list[tuple[float, float]] | None = Field(
        None, description="Pairs [pdoa_deg, azimuth_deg] for 'table', by rising phase difference; ends are held."
    )

    @model_validator(mode="after")
    def _check_table(self) -> Self:
        if (self.table is None) == (self.formula == "table"):
            raise ValueError("'table' is needed by formula: table, and by no other formula")
        if self.spacing_m is not None and self.formula != "physical":
            raise ValueError(f"'spacing_m' is used by formula: physical, not by {self.formula}")
        if self.table is not None:
            pdoa_deg, azimuth_deg = np.array(self.table).reshape(-1, 2).T
            slope = np.diff(azimuth_deg)
            if len(pdoa_deg) < 2 or np.any(np.diff(pdoa_deg) <= 0):
                raise ValueError("'table' needs two pairs or more, by rising phase difference")
            if np.any(slope <= 0) and np.any(slope >= 0):
                raise ValueError("the azimuths of 'table' must rise throughout, or fall throughout")
        return self


class Azimuth(Stage[AzimuthParams]):
    """Azimuth of each detection from its phase difference of arrival.

    The argument of every arcsine is clipped to [-1, 1]; with the paper's formula a full phase difference of pi then
    reads as 94.7 degrees.

    Raises
    ------
    ConfigError
        For ``formula: physical`` where neither ``spacing_m`` nor the radar gives the antenna spacing, or a receiver
        that ``bias_deg`` does not name.

    References
    ----------
    arXiv 2512.01018 (formula ``paper`` and its offsets).
    """

    consumes = ports("detections", "pdoa_rad")
    produces = ports("azimuth_rad")
    rowwise = True
    fidelity = "from-source"

    def recalibrated(self, column: str, offset: float) -> dict[str, float]:
        """A bias of ``offset`` radians more."""
        if column != "azimuth_rad":
            return {}
        if self.params.bias_domain != "theta":
            raise ConfigError("bias_domain: an offset of the azimuth can be set in the domain 'theta' alone")
        bias_deg = of_receiver(self.params.bias_deg, getattr(self, "radar", None), "bias_deg")
        return {"bias_deg": bias_deg + float(np.rad2deg(offset))}

    def open(self, radar: Radar) -> None:
        """Find the antenna spacing where the formula asks for it, and the receiver's offset."""
        super().open(radar)
        self.bias_rad = float(np.deg2rad(of_receiver(self.params.bias_deg, radar, "azimuth: bias_deg")))
        if self.params.formula == "physical" and self._spacing_m is None:
            raise ConfigError(
                f"azimuth: formula 'physical' needs the antenna spacing: receiver '{radar.receiver}' does not know its "
                "own; give spacing_m"
            )

    def step(self, block: Block) -> Block:
        """Block whose detections carry ``azimuth_rad``."""
        bias_rad = self.bias_rad
        in_alpha = self.params.bias_domain == "alpha"
        alpha = self.params.sign * block.detections["pdoa_rad"] - (bias_rad if in_alpha else 0.0)
        return block.with_columns(azimuth_rad=self._angle(alpha) - (0.0 if in_alpha else bias_rad))

    @property
    def _spacing_m(self) -> float | None:
        return self.radar.array_spacing_m if self.params.spacing_m is None else self.params.spacing_m

    @property
    def divisors(self) -> tuple[float, float] | None:
        """What the phase difference is divided by to give the argument of the arcsine, and what the arcsine is.

        None where the formula is a table.
        """
        if self.params.formula == "paper":
            return np.pi, PAPER_FACTOR
        if self.params.formula == "paper_inside":
            return PAPER_FACTOR * np.pi, 1.0
        if self._spacing_m is not None and self.params.formula == "physical":
            return 2 * np.pi * self._spacing_m / self.radar.wavelength_m, 1.0
        return None

    def _angle(self, alpha_rad: FloatArray) -> FloatArray:
        if self.divisors is not None:
            largest, factor = self.divisors
            return np.asarray(np.arcsin(np.clip(alpha_rad / largest, -1.0, 1.0)) / factor)
        pdoa_deg, azimuth_deg = np.array(self.params.table).T
        return np.asarray(np.deg2rad(np.interp(np.rad2deg(alpha_rad), pdoa_deg, azimuth_deg)))
