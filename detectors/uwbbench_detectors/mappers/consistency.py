"""Whether a filter is right about itself, judged by how far its measurements lie from what it expected."""

from __future__ import annotations

from collections import deque

from scipy.stats import chi2


class Consistency:
    """Normalised innovations of the last measurements.

    Their sum is chi-square distributed with as many degrees of freedom as numbers were measured, in a filter that is
    right about its errors (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
    section 5.4). Measurements that a gate has rejected are to be given too, or the filter would look best when it has
    lost everything.

    Parameters
    ----------
    last : int
        Measurements that count.
    probability : float
        Of more than their sum in a filter that is right, below which it diverges.
    """

    def __init__(self, last: int = 30, probability: float = 1e-6) -> None:
        self._squared: deque[tuple[float, int]] = deque(maxlen=last)
        self._probability = probability

    def add(self, squared: float, freedom: int) -> None:
        """Take in a measurement.

        Parameters
        ----------
        squared : float
            Squared Mahalanobis distance of the innovation.
        freedom : int
            Numbers measured.
        """
        self._squared.append((squared, freedom))

    @property
    def diverges(self) -> bool:
        """Whether the last measurements are farther off than chance allows."""
        if len(self._squared) < (self._squared.maxlen or 0):
            return False
        total = sum(squared for squared, _ in self._squared)
        return bool(chi2.sf(total, sum(freedom for _, freedom in self._squared)) < self._probability)
