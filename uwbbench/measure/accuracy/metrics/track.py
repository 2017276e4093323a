"""How well tracks follow what is there: metrics of the scoring ``track``.

Conventions
-----------
* All are made of a :class:`~uwbbench.api.outcomes.TrackOutcome`; :mod:`uwbbench.measure.accuracy.judges.tracks` says
  what is matched with what, and what a switch, a fragmentation, a delay and a false track are.
* GOSPA and OSPA of order p over frames: the p-th powers are averaged, and the root is taken at the end. The parts of
  GOSPA are roots of their own means: their squares add up to that of GOSPA.
* Where the truth is not exhaustive a track that follows nothing proves nothing: such a capture adds nothing to GOSPA,
  OSPA and false tracks.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.metric import Kind, Metric, Outcome
from uwbbench.api.outcomes import TrackOutcome

_Better = Literal["higher", "lower", "zero"]


class _TrackMetric(Metric):
    """A sum over frames, objects or tracks, and how many these are."""

    of: ClassVar[type[Outcome]] = TrackOutcome
    better: ClassVar[_Better] = "lower"
    default: ClassVar[bool] = True
    brief: ClassVar[bool] = False


class _RootMeanSquare(_TrackMetric):
    """Root of a mean over frames of squares."""

    unit: ClassVar[str] = "m"
    kind: ClassVar[Kind] = "positive"

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Root of the mean square."""
        total, count = partial.tolist()
        return math.sqrt(total / count) if count else math.nan


class _Rate(_TrackMetric):
    """A sum over a count."""

    kind: ClassVar[Kind] = "ratio"

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Sum over count."""
        total, count = partial.tolist()
        return float(total / count) if count else math.nan

    @classmethod
    def parts(cls, partial: FloatArray) -> tuple[float, float]:
        """Sum and count."""
        total, count = partial.tolist()
        return total, count


class GospaLocalisation(_RootMeanSquare):
    """Part of GOSPA that is the distance of tracks from their objects.

    Examples
    --------
    >>> GospaLocalisation.value(np.array([0.04, 4.0])), GospaLocalisation.value(np.zeros(2))
    (0.1, nan)
    """

    title: ClassVar[str] = "GOSPA localisation"
    order: ClassVar[int] = 4

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Sum of squared distances, and frames."""
        return np.array([_tracks(outcome).localisation_m2.sum(), len(outcome.group)], float)


class GospaMissed(_RootMeanSquare):
    """Part of GOSPA that is objects without a track: half the squared cut-off for each."""

    title: ClassVar[str] = "GOSPA missed"
    order: ClassVar[int] = 5

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Half the squared cut-off for each miss, and frames."""
        return np.array([_tracks(outcome).cutoff_m ** 2 / 2 * outcome.fn.sum(), len(outcome.group)], float)


class GospaFalse(_RootMeanSquare):
    """Part of GOSPA that is tracks without an object: half the squared cut-off for each."""

    title: ClassVar[str] = "GOSPA false"
    needs_exhaustive_truth: ClassVar[bool] = True
    order: ClassVar[int] = 6

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Half the squared cut-off for each false row, and frames."""
        if not outcome.exhaustive:
            return np.zeros(2)
        return np.array([_tracks(outcome).cutoff_m ** 2 / 2 * outcome.fp.sum(), len(outcome.group)], float)


class Gospa(_RootMeanSquare):
    """Generalised optimal sub-pattern assignment distance, p = 2 and alpha = 2, of tracks and objects.

    It weighs errors of place, misses and false tracks together; no tracker wins by any one of them alone.
    """

    title: ClassVar[str] = "GOSPA"
    needs_exhaustive_truth: ClassVar[bool] = True
    brief: ClassVar[bool] = True
    headline: ClassVar[int | None] = 0
    order: ClassVar[int] = 2

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Sum of the squares of all three parts, and frames."""
        if not outcome.exhaustive:
            return np.zeros(2)
        squares = sum(part.partial(outcome)[0] for part in (GospaLocalisation, GospaMissed, GospaFalse))
        return np.array([squares, len(outcome.group)], float)


class Ospa(_Rate):
    """Optimal sub-pattern assignment distance of order 1, mean over frames."""

    title: ClassVar[str] = "OSPA"
    unit: ClassVar[str] = "m"
    needs_exhaustive_truth: ClassVar[bool] = True
    order: ClassVar[int] = 8

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Sum of the distances, and frames."""
        if not outcome.exhaustive:
            return np.zeros(2)
        return np.array([_tracks(outcome).ospa_m.sum(), len(outcome.group)], float)


class Ospa2(_RootMeanSquare):
    """Optimal sub-pattern assignment distance of order 2."""

    title: ClassVar[str] = "OSPA (p = 2)"
    needs_exhaustive_truth: ClassVar[bool] = True
    default: ClassVar[bool] = False
    order: ClassVar[int] = 9

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Sum of the squared distances, and frames."""
        if not outcome.exhaustive:
            return np.zeros(2)
        return np.array([_tracks(outcome).ospa_2_m2.sum(), len(outcome.group)], float)


class TrackRmse(_TrackMetric):
    """Root mean square error of tracks where they are matched: read it with the recall, or a tracker wins by missing.

    Examples
    --------
    >>> TrackRmse.value(np.array([0.1, -0.1])), TrackUnbiasedRmse.value(np.array([0.1, 0.1]))
    (0.1, 0.0)
    """

    title: ClassVar[str] = "RMSE"
    unit: ClassVar[str] = "m"
    kind: ClassVar[Kind] = "positive"
    merge: ClassVar[Literal["sum", "stack"]] = "stack"
    brief: ClassVar[bool] = True
    headline: ClassVar[int | None] = 3
    order: ClassVar[int] = 35

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Signed errors (n,) of the matched rows."""
        return np.asarray(outcome.error_m[outcome.matched & np.isfinite(outcome.error_m)])

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Root of the mean squared error."""
        return float(np.sqrt(np.mean(partial**2))) if len(partial) else math.nan


class TrackUnbiasedRmse(TrackRmse):
    """The same without the mean error: what calibration would leave."""

    title: ClassVar[str] = "RMSE without bias"
    brief: ClassVar[bool] = False
    headline: ClassVar[int | None] = None
    order: ClassVar[int] = 36

    @staticmethod
    def value(partial: FloatArray) -> float:
        """Population standard deviation of the signed errors."""
        return float(np.std(partial)) if len(partial) else math.nan


class IdentitySwitches(_Rate):
    """How often another track takes over an object, for each object (CLEAR-MOT)."""

    title: ClassVar[str] = "ID switches"
    unit: ClassVar[str] = "1/object"
    margin: ClassVar[float] = 0.1
    brief: ClassVar[bool] = True
    order: ClassVar[int] = 82

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Switches, and objects."""
        of = _tracks(outcome)
        return np.array([of.switches.sum(), len(of.object_frame)], float)


class Fragmentations(_Rate):
    """How often an object is followed again after it was lost, for each object."""

    title: ClassVar[str] = "fragmentations"
    unit: ClassVar[str] = "1/object"
    margin: ClassVar[float] = 0.1
    order: ClassVar[int] = 84

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Fragmentations, and objects."""
        of = _tracks(outcome)
        return np.array([of.fragmentations.sum(), len(of.object_frame)], float)


class FalseTracksPerMinute(_Rate):
    """Tracks that are near nothing for most of their life, in a minute of scored frames."""

    title: ClassVar[str] = "false tracks"
    unit: ClassVar[str] = "1/min"
    margin: ClassVar[float] = 0.1
    needs_exhaustive_truth: ClassVar[bool] = True
    brief: ClassVar[bool] = True
    order: ClassVar[int] = 86

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """False tracks, and the minutes in which they were counted."""
        if not outcome.exhaustive:
            return np.zeros(2)
        return np.array([_tracks(outcome).false_track.sum(), outcome.duration_s / 60], float)


class ConfirmationDelay(_Rate):
    """Time from the first sight of an object to its first confirmed track; objects without any are left out."""

    title: ClassVar[str] = "confirmation delay"
    unit: ClassVar[str] = "s"
    margin: ClassVar[float] = 0.05
    order: ClassVar[int] = 88

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """Sum of the delays, and objects that have one."""
        delay_s = _tracks(outcome).delay_s
        return np.array([np.nansum(delay_s), np.isfinite(delay_s).sum()], float)


def _tracks(outcome: Outcome) -> TrackOutcome:
    """Outcome of the scoring that these metrics are of."""
    if not isinstance(outcome, TrackOutcome):
        raise TypeError(f"a metric of tracks takes a TrackOutcome, not {type(outcome).__name__}")
    return outcome


TRACK_METRICS: dict[str, type[Metric]] = {
    "gospa": Gospa,
    "gospa_localisation": GospaLocalisation,
    "gospa_missed": GospaMissed,
    "gospa_false": GospaFalse,
    "ospa": Ospa,
    "ospa_2": Ospa2,
    "track_rmse": TrackRmse,
    "track_unbiased_rmse": TrackUnbiasedRmse,
    "identity_switches": IdentitySwitches,
    "fragmentations": Fragmentations,
    "false_tracks_per_minute": FalseTracksPerMinute,
    "confirmation_delay": ConfirmationDelay,
}
"""By registered name: what scores of tracks hold besides those of every scoring."""
