"""Landmarks of all particles: the same landmarks in each, every particle with its own idea of where they are."""

from __future__ import annotations

import numpy as np

from uwbbench.api import FloatArray, IntArray, wrap_angle
from uwbbench_detectors.mappers import images

A, B, AA, AB, BB, LOW, HIGH, SUPPORT = range(8)
"""Planes of the table: both values of a landmark, their covariance, how far along a wall it was seen, readings."""
WALL, POINT = 0, 1


class LandmarkTable:
    """A small Kalman filter for each landmark of each particle.

    Given the way of a particle its landmarks do not depend on each other, so each has a filter of its own (Montemerlo,
    Thrun, Koller, Wegbreit, FastSLAM, AAAI 2002). All particles have the same landmarks, since one begins in all at
    once; which of them a reading belongs to is for each particle to say.

    Parameters
    ----------
    particles : int

    Attributes
    ----------
    planes : (8, particles, landmarks) array
    kind : (landmarks,) int array
    identity : (landmarks,) int array
    """

    def __init__(self, particles: int) -> None:
        self.planes = np.zeros((8, particles, 0))
        self.kind, self.identity = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._next = 0

    def __len__(self) -> int:
        return len(self.kind)

    def add(self, kind: int, planes: FloatArray) -> int:
        """Begin a landmark in all particles.

        Parameters
        ----------
        kind : int
        planes : (8, particles) array

        Returns
        -------
        int
            Its place.
        """
        self.planes = np.concatenate([self.planes, planes[:, :, None]], axis=2)
        self.kind, self.identity = np.append(self.kind, kind), np.append(self.identity, self._next)
        self._next += 1
        return len(self) - 1

    def remove(self, place: int) -> None:
        """Forget a landmark."""
        self.planes = np.delete(self.planes, place, axis=2)
        self.kind, self.identity = np.delete(self.kind, place), np.delete(self.identity, place)

    def resample(self, chosen: IntArray) -> None:
        """Copy what the chosen particles (particles,) know."""
        self.planes = self.planes[:, chosen]

    def near(self, pose: FloatArray, particle: int, reach_m: float, beyond_m: float) -> IntArray:
        """Landmarks that may be heard of.

        Parameters
        ----------
        pose : (3,) array
            Of the robot.
        particle : int
            Whose landmarks count.
        reach_m : float
            Farthest that an echo is heard from.
        beyond_m : float
            By how far a wall may go on beyond where it was seen.
        """
        a, b, low, high = self.planes[[A, B, LOW, HIGH], particle]
        cosine, sine = np.cos(b), np.sin(b)
        ahead = a - (cosine * pose[0] + sine * pose[1])
        along = cosine * pose[1] - sine * pose[0]
        of_wall = (np.abs(ahead) < reach_m) & (along > low - beyond_m) & (along < high + beyond_m)
        of_point = np.hypot(a - pose[0], b - pose[1]) < reach_m
        return np.flatnonzero(np.where(self.kind == WALL, of_wall, of_point))

    def expected(self, places: IntArray, ear: FloatArray, mouth: FloatArray) -> FloatArray:
        """Half paths, and their derivatives by both values of the landmarks.

        Parameters
        ----------
        places : (k,) int array
        ear, mouth : (2, particles) arrays

        Returns
        -------
        (3, particles, k) array
        """
        walls = self.kind[places] == WALL
        ear, mouth = ear[:, :, None], mouth[:, :, None]
        if walls.all():
            return images.of_wall(ear, mouth, self.planes[A][:, places], self.planes[B][:, places])
        found = np.empty((3, self.planes.shape[1], len(places)))
        for rows, of in ((walls, images.of_wall), (~walls, images.of_point)):
            found[:, :, rows] = of(ear, mouth, self.planes[A][:, places[rows]], self.planes[B][:, places[rows]])
        return found

    def correct(self, who: IntArray, which: IntArray, off: FloatArray, slopes: FloatArray, variance: float) -> None:
        """Put a reading into one landmark of each of some particles.

        ``K = P H' / S``, ``P <- (I - K H) P (I - K H)' + K R K'``, which stays positive.

        Parameters
        ----------
        who, which : (n,) int arrays
            Particle and landmark.
        off : (n,) array
            What the reading is beyond what was expected.
        slopes : (2, n) array
            H, derivatives of what was expected.
        variance : float
            R, of the reading.
        """
        aa, ab, bb = self.planes[AA, who, which], self.planes[AB, who, which], self.planes[BB, who, which]
        first, second = aa * slopes[0] + ab * slopes[1], ab * slopes[0] + bb * slopes[1]
        spread = first * slopes[0] + second * slopes[1] + variance
        gain_a, gain_b = first / spread, second / spread
        self.planes[A, who, which] += gain_a * off
        self.planes[B, who, which] += gain_b * off
        keep_aa, keep_ab = 1 - gain_a * slopes[0], -gain_a * slopes[1]
        keep_ba, keep_bb = -gain_b * slopes[0], 1 - gain_b * slopes[1]
        left_a, left_b = keep_aa * aa + keep_ab * ab, keep_aa * ab + keep_ab * bb
        right_a, right_b = keep_ba * aa + keep_bb * ab, keep_ba * ab + keep_bb * bb
        self.planes[AA, who, which] = left_a * keep_aa + left_b * keep_ab + gain_a * gain_a * variance
        self.planes[AB, who, which] = left_a * keep_ba + left_b * keep_bb + gain_a * gain_b * variance
        self.planes[BB, who, which] = right_a * keep_ba + right_b * keep_bb + gain_b * gain_b * variance
        self.planes[SUPPORT, who, which] += 1

    def extend(self, who: IntArray, which: IntArray, along: FloatArray) -> None:
        """Note that walls were seen at a place along them.

        Parameters
        ----------
        who, which : (n,) int arrays
            Particle and landmark.
        along : (n,) array
        """
        self.planes[LOW, who, which] = np.minimum(self.planes[LOW, who, which], along)
        self.planes[HIGH, who, which] = np.maximum(self.planes[HIGH, who, which], along)

    def twins(self, particle: int, apart_m: float, apart_rad: float) -> tuple[int, int] | None:
        """Two landmarks of one particle that are one, the older first; None if there are none.

        Walls are compared where the younger one was seen: far from the origin a small difference in direction is a
        large one in rho.

        Parameters
        ----------
        particle : int
        apart_m, apart_rad : float
            How far two walls may lie apart, and how much they may differ in direction; points as far apart as walls.
        """
        for place in range(len(self) - 1, 0, -1):
            older = np.flatnonzero(self.kind[:place] == self.kind[place])
            a, b, low, high = self.planes[[A, B, LOW, HIGH], particle, place]
            other_a, other_b = self.planes[A, particle, older], self.planes[B, particle, older]
            if self.kind[place] == POINT:
                same = np.hypot(other_a - a, other_b - b) < apart_m
            else:
                middle = 0.5 * (low + high)
                x, y = a * np.cos(b) - middle * np.sin(b), a * np.sin(b) + middle * np.cos(b)
                off = other_a - (np.cos(other_b) * x + np.sin(other_b) * y)
                same = (np.abs(off) < apart_m) & (np.abs(wrap_angle(other_b - b)) < apart_rad)
            if same.any():
                return int(older[np.argmax(same)]), place
        return None

    def merge(self, kept: int, gone: int, variance: tuple[float, float]) -> FloatArray:
        """Make one landmark of two.

        Parameters
        ----------
        kept, gone : int
            Places.
        variance : (float, float)
            By which both values of one landmark may differ besides, as it is no ideal wall or point.

        Returns
        -------
        (particles,) array
            Squared distance of the two in each particle, in standard deviations.
        """
        one, two = self.planes[:, :, kept], self.planes[:, :, gone]
        off = two[:2] - one[:2]
        if self.kind[kept] == WALL:
            off[1] = wrap_angle(off[1])
        own = np.stack([one[[AA, AB]], one[[AB, BB]]])
        other = np.stack([two[[AA, AB]], two[[AB, BB]]]) + np.diag(variance)[:, :, None]
        inverse = np.linalg.inv(np.moveaxis(own + other, 2, 0))
        own = np.moveaxis(own, 2, 0)
        gain = own @ inverse
        one[:2] += np.einsum("nij,jn->in", gain, off)
        left = own - gain @ own
        one[AA], one[AB], one[BB] = left[:, 0, 0], 0.5 * (left[:, 0, 1] + left[:, 1, 0]), left[:, 1, 1]
        one[LOW], one[HIGH] = np.minimum(one[LOW], two[LOW]), np.maximum(one[HIGH], two[HIGH])
        one[SUPPORT] += two[SUPPORT]
        squared = np.einsum("in,nij,jn->n", off, inverse, off)
        self.remove(gone)
        return np.asarray(squared)
