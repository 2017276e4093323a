"""Which pieces of lines have been seen."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from uwbbench.api import BoolArray, FloatArray
from uwbbench_detectors.mappers.line import piece


@dataclass
class Feet:
    """Feet of perpendiculars along one line, counted in quadrats.

    Attributes
    ----------
    quadrat_m : float
        Length of a quadrat; they count from the first foot that was seen.
    """

    quadrat_m: float
    _origin_m: float = math.nan
    _seen: dict[int, tuple[int, float, float]] = field(default_factory=dict)

    def add(self, along_m: FloatArray) -> None:
        """Count feet at places (n,) along the line."""
        if math.isnan(self._origin_m):
            self._origin_m = float(along_m[0])
        quadrats = np.floor((along_m - self._origin_m) / self.quadrat_m).astype(int)
        for quadrat in np.unique(quadrats):
            own = along_m[quadrats == quadrat]
            count, low, high = self._seen.get(int(quadrat), (0, math.inf, -math.inf))
            self._seen[int(quadrat)] = (count + len(own), min(low, float(own.min())), max(high, float(own.max())))

    def join(self, other: Feet) -> None:
        """Count those of another line too, that has turned out to be the same."""
        for _, low, high in other._seen.values():
            self.add(np.unique([low, high]))

    @property
    def pieces_m(self) -> FloatArray:
        """Starts and ends (k, 2) along the line, where no quadrat between two is empty; single feet make none."""
        runs: list[list[float]] = []
        last = None
        for quadrat in sorted(place for place, seen in self._seen.items() if seen[0] >= 2):
            _, low, high = self._seen[quadrat]
            if last is not None and quadrat - last <= 2:
                runs[-1][1] = high
            else:
                runs.append([low, high])
            last = quadrat
        return np.array(runs).reshape(-1, 2)

    def segments_m(self, line: FloatArray) -> FloatArray:
        """Ends (k, 2, 2) of the pieces of the line (2,) that have been seen."""
        return np.array([piece(line, start, stop) for start, stop in self.pieces_m]).reshape(-1, 2, 2)

    def covers(self, along_m: FloatArray, margin_m: float) -> BoolArray:
        """Which places (n,) along the line are at most ``margin_m`` beside a piece that has been seen (n,)."""
        starts_m, stops_m = self.pieces_m.T
        places_m = along_m[:, None]
        return np.asarray(((starts_m - margin_m <= places_m) & (places_m <= stops_m + margin_m)).any(axis=1))
