"""Echo paths of walls and points by their image sources, for many particles and landmarks at once.

Half the path that an echo has flown, from the mouth over the landmark to the ear, is used throughout: with both at one
place it is the range. A wall is the line of all x with ``x . n = rho``, ``n = (cos alpha, sin alpha)``; the robot is on
the side where ``x . n < rho``.
"""

from __future__ import annotations

import numpy as np

from uwbbench.api import FloatArray


def of_wall(ear: FloatArray, mouth: FloatArray, rho: FloatArray, alpha: FloatArray) -> FloatArray:
    """Half the path by way of a wall, with its derivatives by ``rho`` and ``alpha``.

    The image of the mouth behind the wall is where the echo seems to come from. With h and k the distances of ear and
    mouth from the wall and D that between them, the path to it is ``sqrt(D^2 + 4 h k)``: of the ear's offset to the
    image, the part along the wall is that to the mouth, and the part across is ``h + k`` in place of ``h - k``.

    Parameters
    ----------
    ear, mouth : (2, ...) arrays
        Places in metres.
    rho, alpha : (...) arrays
        Shapes broadcast against each other.

    Returns
    -------
    (3, ...) array
        NaN where ear or mouth is not before the wall.
    """
    cosine, sine = np.cos(alpha), np.sin(alpha)
    before_ear = rho - (cosine * ear[0] + sine * ear[1])
    before_mouth = rho - (cosine * mouth[0] + sine * mouth[1])
    apart2 = (ear[0] - mouth[0]) ** 2 + (ear[1] - mouth[1]) ** 2
    half = 0.5 * np.sqrt(
        np.where(np.minimum(before_ear, before_mouth) > 0, apart2, np.nan) + 4 * before_ear * before_mouth
    )
    turned_ear = sine * ear[0] - cosine * ear[1]
    turned_mouth = sine * mouth[0] - cosine * mouth[1]
    by_rho = 0.5 * (before_ear + before_mouth) / half
    by_alpha = 0.5 * (turned_ear * before_mouth + turned_mouth * before_ear) / half
    return np.stack([half, by_rho, by_alpha])


def of_point(ear: FloatArray, mouth: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Half the path by way of a point, with its derivatives by ``x`` and ``y``.

    Parameters
    ----------
    ear, mouth : (2, ...) arrays
        Places in metres.
    x, y : (...) arrays
        Shapes broadcast against each other.

    Returns
    -------
    (3, ...) array
    """
    ear_x, ear_y, mouth_x, mouth_y = x - ear[0], y - ear[1], x - mouth[0], y - mouth[1]
    from_ear = np.maximum(np.hypot(ear_x, ear_y), 1e-9)
    from_mouth = np.maximum(np.hypot(mouth_x, mouth_y), 1e-9)
    by_x = 0.5 * (ear_x / from_ear + mouth_x / from_mouth)
    by_y = 0.5 * (ear_y / from_ear + mouth_y / from_mouth)
    return np.stack([0.5 * (from_ear + from_mouth), by_x, by_y])


def foot_along(ear: FloatArray, mouth: FloatArray, rho: FloatArray, alpha: FloatArray) -> FloatArray:
    """Where along a wall an echo is reflected: the way from the foot of the origin, counter-clockwise about it.

    Parameters
    ----------
    ear, mouth : (2, ...) arrays
        Places in metres.
    rho, alpha : (...) arrays
        Shapes broadcast against each other.
    """
    cosine, sine = np.cos(alpha), np.sin(alpha)
    before_ear = rho - (cosine * ear[0] + sine * ear[1])
    before_mouth = rho - (cosine * mouth[0] + sine * mouth[1])
    along_ear = cosine * ear[1] - sine * ear[0]
    along_mouth = cosine * mouth[1] - sine * mouth[0]
    return np.asarray((along_ear * before_mouth + along_mouth * before_ear) / (before_ear + before_mouth))
