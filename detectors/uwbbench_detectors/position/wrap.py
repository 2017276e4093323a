"""Angles in one turn, for compiled loops."""

from __future__ import annotations

import math

from uwbbench.api import inlined


@inlined
def wrapped(angle_rad: float) -> float:
    """Angle in [-pi, pi)."""
    return angle_rad - 2 * math.pi * math.floor(angle_rad / (2 * math.pi) + 0.5)
