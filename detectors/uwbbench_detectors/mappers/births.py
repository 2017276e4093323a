"""Walls and points from ranges alone: what a stretch of way leaves of the directions in which one may lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uwbbench.api import FloatArray, wrap_angle
from uwbbench_detectors.mappers import images
from uwbbench_detectors.mappers.landmark_table import POINT, WALL

ALL_ROUND = np.radians(np.arange(-180.0, 180.0, 3.0))
LOCAL = np.linspace(-3.0, 3.0, 13)
"""Directions that are tried: all round by one particle, then within three standard deviations by all."""
ROUNDS = 3
"""Steps of least squares for the distance."""
FLATNESS_RAD = np.radians(0.2)
"""Standard deviation of a direction that remains, as no wall is quite flat."""


@dataclass(frozen=True)
class Trail:
    """Readings that no landmark explains, of one track of one ear, as the particles have them.

    Attributes
    ----------
    half_m : (n,) array
        Half paths.
    ear, mouth : (n, 2, particles) arrays
        Where ear and mouth were.
    facing : (n, particles) array
        Where the ear looked.
    """

    half_m: FloatArray
    ear: FloatArray
    mouth: FloatArray
    facing: FloatArray

    def of(self, particle: int) -> Trail:
        """As one particle has it."""
        rows = slice(particle, particle + 1)
        return Trail(self.half_m, self.ear[..., rows], self.mouth[..., rows], self.facing[..., rows])


def _settled(kind: int, trail: Trail, angle: FloatArray, sd_m: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Best distance for each direction by least squares (Gauss and Newton), and how well it fits.

    Parameters
    ----------
    kind : int
        A wall, whose distance is rho; or a point, whose distance is that from the last reading's ear.
    trail : Trail
    angle : (particles, angles) array
    sd_m : float
        Of a half path.

    Returns
    -------
    distance_m : (particles, angles) array
    variance_m2 : (particles, angles) array
        Of it, given the direction.
    cost : (particles, angles) array
        Squared residuals in standard deviations; infinite where such a landmark is impossible.
    """
    half, ear, mouth = trail.half_m[:, None, None], trail.ear[..., None], trail.mouth[..., None]
    ear, mouth = np.moveaxis(ear, 1, 0), np.moveaxis(mouth, 1, 0)
    cosine, sine = np.cos(angle), np.sin(angle)
    if kind == WALL:
        middle = 0.5 * (ear + mouth)
        distance = np.mean(half + cosine * middle[0] + sine * middle[1], axis=0)
        # Before the wall all along the way, or else the mirror image is on the wrong side.
        distance = np.maximum(distance, 0.05 + np.max(cosine * ear[0] + sine * ear[1], axis=0))
    else:
        distance = np.broadcast_to(trail.half_m[-1], angle.shape).copy()
    for _ in range(ROUNDS):
        if kind == WALL:
            path, slope, _ = images.of_wall(ear, mouth, distance, angle)
        else:
            x, y = ear[0, -1] + distance * cosine, ear[1, -1] + distance * sine
            path, by_x, by_y = images.of_point(ear, mouth, x, y)
            slope = by_x * cosine + by_y * sine
        off = half - path
        steep = np.maximum(np.sum(slope**2, axis=0), 1e-6)
        cost = np.sum(off**2, axis=0) / sd_m**2
        step = np.sum(slope * off, axis=0) / steep
        distance = distance + np.nan_to_num(step)
    cost = np.where(np.isfinite(cost) & (distance > 0 if kind == POINT else True), cost, np.inf)
    return distance, sd_m**2 / steep, cost


@dataclass(frozen=True)
class Birth:
    """A landmark that a trail leaves no doubt of.

    Attributes
    ----------
    kind : int
    mean : (2, particles) array
    covariance : (3, particles) array
        Of the first value, of both, of the second.
    log_likelihood : (particles,) array
        How well the trail fits the way of each particle, up to a constant.
    along : (n, particles) array
        Where along a wall it was seen; zeros of a point.
    """

    kind: int
    mean: FloatArray
    covariance: FloatArray
    log_likelihood: FloatArray
    along: FloatArray


def born(trail: Trail, best: int, sd_m: float, view_rad: float, sure_rad: float, worst: float) -> Birth | None:
    """A wall or a point, if the ranges along a way say where it is; else None.

    All directions are tried, each with the distance that fits it best: ranges along a straight way leave two
    directions, one on each side, and ranges along a way straight ahead leave a wide fan of them. Of these the ear's
    view takes away what lies behind it, and what is left must be narrow.

    Parameters
    ----------
    trail : Trail
    best : int
        Particle that is asked first.
    sd_m : float
        Standard deviation of a half path.
    view_rad : float
        Directions that the ear hears from, to both sides of where it looks.
    sure_rad : float
        Largest standard deviation of the direction.
    worst : float
        Largest mean squared residual, in standard deviations, of something that is wall or point.
    """
    asked = trail.of(best)
    found = [(*_direction(kind, asked, sd_m, view_rad), kind) for kind in (WALL, POINT)]
    # A point has as many values as a wall, but walls are what rooms are made of: it must fit clearly better.
    wall, point = found
    cost, angle, sd, kind = point if point[0] + 9.0 < wall[0] else wall
    if sd > sure_rad or cost > worst * len(trail.half_m):
        return None
    # Particles look elsewhere, but all hear it on the same side; then each goes on with what is left.
    middle = angle + wrap_angle(trail.facing[-1] - trail.facing[-1, best])
    width = np.full_like(middle, max(sd, np.radians(3.0)))
    for _ in range(2):
        angles = middle[:, None] + width[:, None] * LOCAL
        distance, variance, costs = _settled(kind, trail, angles, sd_m)
        least = costs.min(axis=1, keepdims=True)
        if not np.isfinite(least).all():
            return None
        likely = np.exp(-0.5 * (costs - least))
        log_likelihood = -0.5 * least[:, 0] + np.log(width * likely.sum(axis=1))
        likely /= likely.sum(axis=1, keepdims=True)
        middle = np.sum(likely * angles, axis=1)
        width = np.maximum(np.sqrt(np.sum(likely * (angles - middle[:, None]) ** 2, axis=1)), np.radians(0.1))
    mean_distance = np.sum(likely * distance, axis=1)
    off_angle, off_distance = angles - middle[:, None], distance - mean_distance[:, None]
    cov = np.stack(
        [
            np.sum(likely * (off_distance**2 + variance), axis=1),
            np.sum(likely * off_distance * off_angle, axis=1),
            np.sum(likely * off_angle**2, axis=1) + FLATNESS_RAD**2,
        ]
    )
    mean = np.stack([mean_distance, middle])
    if kind == WALL:
        ear, mouth = np.moveaxis(trail.ear, 1, 0), np.moveaxis(trail.mouth, 1, 0)
        return Birth(kind, mean, cov, log_likelihood, images.foot_along(ear, mouth, mean[0], mean[1]))
    return _placed(mean, cov, trail, log_likelihood)


def _direction(kind: int, trail: Trail, sd_m: float, view_rad: float) -> tuple[float, float, float]:
    """Least cost, and mean and standard deviation of the direction, of what one particle has."""
    angle = ALL_ROUND[None]
    cost = _settled(kind, trail, angle, sd_m)[2]
    seen = np.abs(wrap_angle(angle - trail.facing[-1][:, None])) <= view_rad
    least = float(cost.min(where=seen & np.isfinite(cost), initial=np.inf))
    if not np.isfinite(least):
        return np.inf, 0.0, np.inf
    likely = np.exp(-0.5 * np.where(seen, cost - least, np.inf))[0]
    likely /= likely.sum()
    turn = np.sum(likely * np.exp(1j * ALL_ROUND))
    middle = float(np.angle(turn))
    sd = float(np.sqrt(np.sum(likely * wrap_angle(ALL_ROUND - middle) ** 2)))
    return least, middle, sd


def _placed(polar: FloatArray, cov: FloatArray, trail: Trail, log_likelihood: FloatArray) -> Birth:
    """A point by its distance and direction (2, particles) from the last ear, in metres."""
    distance, angle = polar
    cosine, sine = np.cos(angle), np.sin(angle)
    dd, da, aa = cov[0], cov[1] * distance, cov[2] * distance**2
    mean = trail.ear[-1] + distance * np.stack([cosine, sine])
    covariance = np.stack(
        [
            cosine**2 * dd - 2 * cosine * sine * da + sine**2 * aa,
            cosine * sine * (dd - aa) + (cosine**2 - sine**2) * da,
            sine**2 * dd + 2 * cosine * sine * da + cosine**2 * aa,
        ]
    )
    return Birth(POINT, mean, covariance, log_likelihood, np.zeros_like(trail.facing))
