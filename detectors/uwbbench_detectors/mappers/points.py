"""Points as landmarks of a filter: which cluster is which landmark, what is new, and what was none."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Detections, FloatArray, Landmarks, Params, Radar
from uwbbench_detectors.mappers.consistency import Consistency
from uwbbench_detectors.mappers.ekf import Ekf
from uwbbench_detectors.mappers.evidence import Evidence, EvidenceParams
from uwbbench_detectors.mappers.point import PointModel
from uwbbench_detectors.mappers.window import Window, WindowParams


class PointsParams(Params):
    """How points are gathered, told apart, and believed."""

    window: WindowParams = Field(WindowParams.model_validate({}), description="How echoes gather along the way.")
    evidence: EvidenceParams = Field(EvidenceParams.model_validate({}), description="When a landmark is believed.")
    range_sd_m: float = Field(0.045, gt=0, description="Standard deviation of the range of a cluster of points.")
    bearing_sd_deg: float = Field(4.5, gt=0, description="Standard deviation of its bearing.")
    spread_m: float = Field(
        0.25, gt=0, description="Clusters are left out whose points lie farther from their median, in the median."
    )
    gate: float = Field(9.21, gt=0, description="Squared Mahalanobis distance within which a cluster is a landmark.")
    begin: float = Field(
        25.0, gt=0, description="Beyond this from all landmarks a cluster begins one; in between it is not used."
    )
    merge: float = Field(5.99, gt=0, description="Squared Mahalanobis distance within which two landmarks are one,")
    merge_m: float = Field(0.5, gt=0, description="if they are no farther apart than this.")
    merge_sd_m: float = Field(
        0.05, gt=0, description="Standard deviation of how far two places of one landmark may be apart."
    )

    @model_validator(mode="after")
    def _gate_is_inside(self) -> PointsParams:
        if self.begin < self.gate:
            raise ValueError(f"begin, {self.begin:g}, must not be below gate, {self.gate:g}")
        return self


@dataclass(frozen=True)
class Sighting:
    """A cluster that a window has shown of a landmark.

    Attributes
    ----------
    handle : int
        Of the landmark in the filter.
    measured : (2,) array
        Range in metres and bearing in radians from the robot at the end of the window.
    confirmed : bool
        Whether the landmark was, so that the robot's pose has learnt from this.
    """

    handle: int
    measured: FloatArray
    confirmed: bool


class Points:
    """Takes the points of front ends into a filter, window by window.

    Each cluster goes to one landmark at most, and each landmark takes one; the nearest pair first, confirmed
    landmarks before others. A landmark that is not confirmed learns from what is seen of it, but neither the robot nor
    any other landmark does, so that the mirror points of walls, which move along with the robot, do it no harm. One
    that should be seen and is not, again and again, is dropped; and so is one that was not confirmed long after it was
    seen. Two landmarks that cannot be told apart become one.

    Parameters
    ----------
    params : PointsParams
    ekf : Ekf
        Moved by the caller, before each :meth:`add`.
    radars : mapping of str to Radar
    """

    def __init__(self, params: PointsParams, ekf: Ekf, radars: Mapping[str, Radar]) -> None:
        self._params, self._ekf, self._model = params, ekf, PointModel()
        self._noise = np.diag([params.range_sd_m**2, math.radians(params.bearing_sd_deg) ** 2])
        self._window = Window(params.window, radars)
        self._evidence = Evidence(params.evidence, params.window, radars)
        self._consistency = Consistency()

    @property
    def diverges(self) -> bool:
        """Whether clusters lie farther from what the filter expects than chance allows."""
        return self._consistency.diverges

    def add(self, moved: FloatArray, found: Mapping[str, Detections]) -> list[Sighting]:
        """Take in a step; what the window has shown, if it ends here.

        Parameters
        ----------
        moved : (3,) array
            Odometry since the step before.
        found : mapping of str to Detections
            By receiver.
        """
        self._window.add(moved, found)
        self._evidence.travel(math.hypot(moved[0], moved[1]))
        return self.end() if self._window.full else []

    def end(self) -> list[Sighting]:
        """End the window here, and take in what it has shown."""
        measured = [
            np.array([math.hypot(*cluster.place_m), math.atan2(cluster.place_m[1], cluster.place_m[0])])
            for cluster in self._window.take()
            if cluster.spread_m <= self._params.spread_m
        ]
        ekf, evidence = self._ekf, self._evidence
        handles = ekf.near(self._model.kind)
        should = [handle for handle in handles if evidence.expects(ekf.pose, ekf.place(handle))]
        squared = np.array([ekf.distances(self._model, one, self._noise, handles)[1] for one in measured])
        squared = squared.reshape(len(measured), len(handles))
        taken = self._assigned(squared, handles)
        self._judge(squared, handles, taken)
        sightings = [self._see(handles[column], measured[row]) for row, column in taken.items()]
        for row, one in enumerate(measured):
            if row not in taken and squared[row].min(initial=np.inf) > self._params.begin:
                sightings.append(self._begin(one))
        seen = {sighting.handle for sighting in sightings}
        for handle in should:
            if handle not in seen:
                evidence.miss(handle)
        for handle in evidence.refuted():
            self._drop(handle)
        for handle in sorted(seen):
            self._merge(handle)
        return sightings

    def clear(self) -> None:
        """Forget the points of the window, after the robot was moved in a way that odometry does not tell."""
        self._window.clear()

    def landmarks(self) -> Landmarks:
        """Confirmed landmarks, with the windows that each was seen in as support."""
        return self._ekf.landmarks(handles=[one for one in self._evidence.handles if self._evidence.confirmed(one)])

    def _assigned(self, squared: FloatArray, handles: list[int]) -> dict[int, int]:
        """Column of each row that has one: the nearest pair first, those of confirmed landmarks before others."""
        rows, columns = np.nonzero(squared <= self._params.gate)
        tentative = [not self._evidence.confirmed(handles[column]) for column in columns]
        column_of: dict[int, int] = {}
        for place in np.lexsort((squared[rows, columns], np.array(tentative, bool))):
            row, column = int(rows[place]), int(columns[place])
            if row not in column_of and column not in column_of.values():
                column_of[row] = column
        return column_of

    def _see(self, handle: int, measured: FloatArray) -> Sighting:
        confirmed = self._evidence.confirmed(handle)
        self._ekf.update(self._model, handle, measured, self._noise, trusted=confirmed)
        self._evidence.see(handle, self._ekf.pose, self._ekf.place(handle))
        return Sighting(handle, measured, confirmed)

    def _begin(self, measured: FloatArray) -> Sighting:
        handle = self._ekf.add(self._model, measured, self._noise)
        self._evidence.see(handle, self._ekf.pose, self._ekf.place(handle))
        return Sighting(handle, measured, confirmed=False)

    def _judge(self, squared: FloatArray, handles: list[int], taken: dict[int, int]) -> None:
        """Count how far the cluster that a confirmed landmark was given, or else the nearest one, lies from it."""
        row_of = {column: row for row, column in taken.items()}
        for column, handle in enumerate(handles):
            if self._evidence.confirmed(handle):
                row = row_of.get(column)
                off = squared[:, column].min(initial=np.inf) if row is None else squared[row, column]
                if off <= self._params.begin:
                    self._consistency.add(float(off), 2)

    def _drop(self, handle: int) -> None:
        self._ekf.remove(handle)
        self._evidence.forget(handle)

    def _merge(self, handle: int) -> None:
        """Make one of a landmark and of any other that cannot be told from it."""
        p, ekf = self._params, self._ekf
        others = [other for other in ekf.near(self._model.kind) if other != handle]
        if not others or not self._evidence.knows(handle):
            return
        places = np.array([ekf.place(other) for other in others])
        for place in np.flatnonzero(np.hypot(*(places - ekf.place(handle)).T) <= p.merge_m):
            other = others[place]
            if ekf.apart(handle, other) > p.merge:
                continue
            kept, dropped = sorted((handle, other), key=lambda one: (not self._evidence.confirmed(one), one))
            if self._evidence.confirmed(dropped):
                ekf.merge(kept, dropped, p.merge_sd_m**2 * np.eye(2))
                self._evidence.forget(dropped)
            else:
                self._drop(dropped)
            if dropped == handle:
                return
