"""Landmarks of a filter that are far away: what happens near by is passed on to them later, all at once."""

from __future__ import annotations

import numpy as np

from uwbbench.api import FloatArray, IntArray
from uwbbench_detectors.mappers.motion import HEAD


class Rest:
    """Mean and covariance of everything as they were when the robot entered its neighbourhood, and what came after.

    With P the covariance then, of near (A) and far (B) landmarks, all that happens in the neighbourhood leaves

        P_AB = Phi P_AB(0),  P_BB = P_BB(0) - P_BA(0) Psi P_AB(0),  x_B = x_B(0) + P_BA(0) psi

    with three matrices of the size of the neighbourhood: a prediction F makes ``Phi = F Phi``; an update with the
    derivative H, innovation v of covariance S and gain K makes ``Psi += (H Phi)' S^-1 (H Phi)``,
    ``psi += (H Phi)' S^-1 v`` and ``Phi -= K H Phi``.

    References
    ----------
    Guivant and Nebot, IEEE Transactions on Robotics and Automation 17(3), 2001, section III.
    """

    def __init__(self) -> None:
        self.mean = np.zeros(HEAD)
        self.covariance = np.zeros((HEAD, HEAD))
        self.handles: list[int] = []
        self.enter(range(0), [])

    def at(self, handle: int) -> int:
        """First of the two places of a landmark in the state."""
        return HEAD + 2 * self.handles.index(handle)

    def enter(self, columns: IntArray | range, resting: list[int]) -> None:
        """Begin a neighbourhood.

        Parameters
        ----------
        columns : sequence of int
            Places in the state of what is near, the head included.
        resting : list of int
            Handles of the others; if there are none, nothing needs to be gathered.
        """
        self._columns = np.asarray(columns, np.int64)
        self._gathers = bool(resting)
        self._passed = np.eye(len(self._columns))
        self._learnt = np.zeros((len(self._columns), len(self._columns)))
        self._shift = np.zeros(len(self._columns))

    def predict(self, by_head: FloatArray) -> None:
        """Gather a movement by its derivative (3, HEAD)."""
        if self._gathers:
            self._passed[:3] = by_head @ self._passed[:HEAD]

    def correct(
        self, seen: FloatArray, weight: FloatArray | None, off: FloatArray, gain: FloatArray, rows: IntArray
    ) -> None:
        """Gather an update.

        Parameters
        ----------
        seen : (k, r) array
            Derivative of what was measured by some values of the near state.
        weight : (k, k) array or None
            Inverse of the covariance of the innovation; None where nothing far away may learn from it.
        off : (k,) array
            The innovation.
        gain : (near, k) array
        rows : (r,) int array
            Places of these values.
        """
        if not self._gathers:
            return
        passed = seen @ self._passed[rows]
        if weight is not None:
            self._learnt += passed.T @ weight @ passed
            self._shift += passed.T @ (weight @ off)
        self._passed -= gain @ passed

    def add(self, by_pose: FloatArray) -> None:
        """Gather a new landmark by the derivative (2, 3) of its place by the pose."""
        if self._gathers:
            self._passed = np.concatenate([self._passed, by_pose @ self._passed[:3]])

    def remove(self, rows: list[int]) -> None:
        """Gather that a landmark is gone from these places of the near state."""
        if self._gathers:
            self._passed = np.delete(self._passed, rows, axis=0)

    def settle(self, mean: FloatArray, covariance: FloatArray, near: list[int], known: set[int]) -> None:
        """Bring everything up to date, and begin the neighbourhood anew.

        Parameters
        ----------
        mean : (n,) array
            Of the near state.
        covariance : (n, n) array
        near : list of int
            Handles in it, in order.
        known : set of int
            Handles of all landmarks that still are.
        """
        if not self._gathers:
            self.mean, self.covariance, self.handles = mean.copy(), covariance.copy(), list(near)
            self.enter(range(len(mean)), [])
            return
        entered = self.covariance[self._columns]
        # Landmarks that began in this neighbourhood come behind all others.
        fresh = [handle for handle in near if handle not in set(self.handles)]
        size, full = len(self.mean), len(self.mean) + 2 * len(fresh)
        self.handles += fresh
        rows = places_of(self.handles, near)
        whole = np.empty((full, full))
        whole[:size, :size] = self.covariance - entered.T @ self._learnt @ entered
        across = self._passed @ entered
        whole[rows, :size] = across
        whole[:size, rows] = across.T
        whole[np.ix_(rows, rows)] = covariance
        moved = np.concatenate([self.mean + self._shift @ entered, np.empty(full - size)])
        moved[rows] = mean
        kept = [handle for handle in self.handles if handle in known]
        if len(kept) < len(self.handles):
            places = places_of(self.handles, kept)
            moved, whole, self.handles = moved[places], whole[np.ix_(places, places)], kept
        self.mean, self.covariance = moved, whole
        self.enter(places_of(self.handles, near), [handle for handle in kept if handle not in set(near)])


def places_of(handles: list[int], some: list[int]) -> IntArray:
    """Places of the head and of some landmarks in a state that holds all ``handles`` in this order."""
    place = {handle: HEAD + 2 * number for number, handle in enumerate(handles)}
    starts = np.array([place[handle] for handle in some], np.int64)
    return np.concatenate([np.arange(HEAD), (starts[:, None] + np.arange(2)).ravel()])
