"""Where the receiver's samples fall, and what it reports about that."""

from __future__ import annotations

import dataclasses

import numpy as np
from pydantic import Field

from uwbbench.api import Capture, CaptureError, FloatArray, Params, Term, View


class GridParams(Params):
    """Sampling grid and reported first path."""

    jitter_taps: float = Field(0.5, ge=0, description="The grid moves by up to this, evenly, from frame to frame.")
    error_taps: float = Field(0.1, ge=0, description="Standard deviation of the reported first path.")
    resolution: int = Field(64, ge=1, description="Parts of a tap in which the first path is reported.")


class Grid(Term[GridParams]):
    """Sampling grid that is not locked to the direct path, and the first path as the device reports it."""

    _crest_tap: FloatArray

    def prepare(self, view: View, rng: np.random.Generator) -> View:
        """Shift each frame's grid."""
        shift = rng.uniform(-self.params.jitter_taps, self.params.jitter_taps, len(view))
        self._crest_tap = view.crest_tap + shift
        return view.replace(crest_tap=self._crest_tap)

    def record(self, capture: Capture, rng: np.random.Generator) -> Capture:
        """Report the first path of each response, each with its own error.

        Raises
        ------
        CaptureError
            If frames were lost or repeated before.
        """
        if len(capture) != len(self._crest_tap):
            raise CaptureError("term 'grid' must come before the terms that lose or repeat frames")
        steps = self.params.resolution

        def reported() -> FloatArray:
            tap = self._crest_tap + self.params.error_taps * rng.standard_normal(len(self._crest_tap))
            return np.asarray(np.round(tap * steps) / steps)

        radar = dataclasses.replace(capture.radar, has_first_path=True)
        capture = dataclasses.replace(capture, radar=radar, first_path_index=reported())
        if not radar.has_sts:
            return capture
        return dataclasses.replace(capture, first_path_index_sts1=reported(), first_path_index_sts2=reported())
