"""Messages of anchors as measurements of a filter: which are believed, and what is said of the others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import NormalDist

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import FloatArray, Messages, Params, Radar
from uwbbench_detectors.mappers.anchor import AZIMUTH, CLOSEST_M, RANGE, AnchorModel
from uwbbench_detectors.mappers.ekf import Ekf

FEW_SIGMAS = 4.0
"""More messages outside the gate than chance would put there, by so many standard deviations, are worth a note."""


class AnchorParams(Params):
    """How well anchors are placed and heard, and which messages are believed."""

    placed_sd_m: float = Field(
        default=0.10, gt=0, description="Standard deviation, in each axis, of where the robot sets an anchor down."
    )
    azimuth_sd_deg: float = Field(default=5.0, gt=0, description="Standard deviation of the direction of a message.")
    use_range: bool = Field(default=True, description="Whether distances of messages count, where they have any.")
    range_sd_m: float = Field(default=0.10, gt=0, description="Standard deviation of the distance of a message.")
    range_bias_m: float = Field(
        default=0.18,
        description="By how much distances are too long; 18 cm were measured on a link of two DW1000. It belongs to "
        "the radios and their antennas: measure it.",
    )
    azimuth_deg: float = Field(
        default=45.0,
        gt=0,
        le=90,
        description="Messages from farther off the boresight are not used: phases are ambiguous there.",
    )
    nearest_m: float = Field(default=1.0, ge=0, description="Messages of anchors that should be nearer are not used,")
    farthest_m: float = Field(default=10.0, gt=0, description="nor of those that should be farther away.")
    gate: float = Field(
        default=0.99, gt=0, lt=1, description="Probability with which a message of the right anchor is within the gate."
    )

    @model_validator(mode="after")
    def _some_distance_is_left(self) -> AnchorParams:
        if self.nearest_m >= self.farthest_m:
            raise ValueError(f"nearest_m, {self.nearest_m:g}, must be below farthest_m, {self.farthest_m:g}")
        return self


class Hearing:
    """Takes messages of anchors into a filter.

    An anchor becomes a landmark where the robot says that it has set it down, and a new one if it says so again.
    Messages of an anchor that was never set down are not used, nor those from beside or behind the receiver, from
    too near and too far; the others must lie within the gate, which keeps wrong identities and detours out.

    Parameters
    ----------
    params : AnchorParams
    radars : mapping of str to Radar
        By receiver.
    """

    def __init__(self, params: AnchorParams, radars: Mapping[str, Radar]) -> None:
        self._params = params
        self._models: dict[str, dict[tuple[int, ...], AnchorModel]] = {
            name: {
                said: AnchorModel(
                    np.array([*radar.mount_position_m[:2], radar.mount_yaw_rad]), said, params.range_bias_m
                )
                for said in ((RANGE, AZIMUTH), (AZIMUTH,), (RANGE,))
            }
            for name, radar in radars.items()
        }
        self._variance = np.array([params.range_sd_m**2, math.radians(params.azimuth_sd_deg) ** 2])
        # Of the chi-square distribution with one and two degrees of freedom.
        self._gates = {1: NormalDist().inv_cdf((1 + params.gate) / 2) ** 2, 2: -2 * math.log(1 - params.gate)}
        self._handles: dict[int, int] = {}
        self._used = 0
        self._rejected: dict[int, int] = {}
        self._strangers: set[int] = set()

    def take_in(self, ekf: Ekf, messages: Mapping[str, Messages]) -> None:
        """Update the filter.

        Parameters
        ----------
        ekf : Ekf
            At the time of the messages.
        messages : mapping of str to Messages
            Of one step, by receiver.
        """
        placed: set[int] = set()
        for receiver, heard in messages.items():
            for row in range(len(heard)):
                anchor = int(heard.anchor[row])
                measured = np.array([heard.range_m[row], heard.azimuth_rad[row]])
                if not heard.placed[row]:
                    self._hear(ekf, receiver, anchor, measured)
                elif anchor not in placed:  # two receivers may report it
                    placed.add(anchor)
                    self._place(ekf, receiver, anchor, measured)

    @property
    def notes(self) -> list[str]:
        """What a reader of the results must know."""
        notes = []
        rejected = sum(self._rejected.values())
        by_chance = (1 - self._params.gate) * (rejected + self._used)
        if rejected > by_chance + FEW_SIGMAS * math.sqrt(by_chance):
            each = ", ".join(f"{count} of anchor {anchor}" for anchor, count in sorted(self._rejected.items()))
            notes.append(f"{rejected} of {rejected + self._used} messages of anchors lay outside the gate: {each}")
        strangers = sorted(self._strangers)
        return notes + [
            f"messages of anchor {one}, which the robot has not set down, were not used" for one in strangers
        ]

    def _place(self, ekf: Ekf, receiver: str, anchor: int, offset: FloatArray) -> None:
        """Begin an anchor at a range and azimuth (2,)."""
        if anchor in self._handles:
            ekf.remove(self._handles[anchor])
        offset = np.array([max(offset[RANGE], CLOSEST_M), offset[AZIMUTH]])
        across = self._params.placed_sd_m / offset[RANGE]
        noise = np.diag([self._params.placed_sd_m**2, across**2])
        self._handles[anchor] = ekf.add(self._models[receiver][RANGE, AZIMUTH], offset, noise, anchor)

    def _hear(self, ekf: Ekf, receiver: str, anchor: int, measured: FloatArray) -> None:
        """Update with a range and azimuth (2,), NaN where one is not known."""
        p = self._params
        if anchor not in self._handles:
            self._strangers.add(anchor)
            return
        ranged, directed = p.use_range and not math.isnan(measured[RANGE]), not math.isnan(measured[AZIMUTH])
        said = tuple(one for one, there in ((RANGE, ranged), (AZIMUTH, directed)) if there)
        if not said or (directed and abs(measured[AZIMUTH]) > math.radians(p.azimuth_deg)):
            return
        handle, models = self._handles[anchor], self._models[receiver]
        expected, _, _ = models[RANGE,].expected(ekf.pose, ekf.place(handle)[None])
        if not p.nearest_m <= expected[0, 0] - p.range_bias_m <= p.farthest_m:
            return
        model, columns = models[said], list(said)
        noise = np.diag(self._variance[columns])
        _, squared = ekf.distances(model, measured[columns], noise, [handle])
        if squared[0] > self._gates[len(said)]:
            self._rejected[anchor] = self._rejected.get(anchor, 0) + 1
            return
        self._used += 1
        ekf.update(model, handle, measured[columns], noise)
