"""Aligned residuals of a robot that drives past points."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from uwbbench.api import SPEED_OF_LIGHT_M_S, Radar

Drive = Callable[..., Any]

TAPS, ZERO_TAP = 50, 7.0
TAP_M = SPEED_OF_LIGHT_M_S * 1e-9 / 2


@pytest.fixture(scope="session")
def array_radar(make_radar: Callable[..., Radar]) -> Radar:
    """A radar with two antennas, its transmitter in the same place."""
    return make_radar(TAPS, has_sts=True, array_spacing_m=0.0178)


@pytest.fixture(scope="session")
def make_drive(make_block: Callable[..., Any]) -> Drive:
    """Blocks of residuals, for a drive along x at 6 mm a frame."""

    def drive(
        points_m: Sequence[tuple[float, float]],
        x_m: np.ndarray,
        noise: float = 1e-3,
        yaw_rad: np.ndarray | None = None,
        seed: int = 0,
    ) -> Any:
        """A block with first path; each point is an echo of amplitude 0.1.

        Parameters
        ----------
        points_m : sequence of (x, y)
        x_m : (frames,) array
            Places of the robot.
        noise : float
        yaw_rad : (frames,) array, optional
        seed : int
        """
        rng = np.random.default_rng(seed)
        yaw_rad = np.zeros(len(x_m)) if yaw_rad is None else yaw_rad
        responses = noise * (rng.normal(size=(3, len(x_m), TAPS)) + 1j * rng.normal(size=(3, len(x_m), TAPS)))
        wave_m = SPEED_OF_LIGHT_M_S / 7987.2e6
        for x, y in points_m:
            range_m, azimuth = np.hypot(x - x_m, y), np.arctan2(y, x - x_m) - yaw_rad
            echo = np.exp(-((np.arange(TAPS) - ZERO_TAP - range_m[:, None] / TAP_M) ** 2) / 2.5)
            echo = 0.1 * echo * np.exp(-4j * np.pi * range_m / wave_m)[:, None]
            responses += echo
            phase = 2 * np.pi * 0.0178 / wave_m * np.sin(azimuth)
            responses[2] += echo * (np.exp(1j * phase) - 1)[:, None]
        position_m = np.stack([x_m, 0 * x_m, 0 * x_m], axis=1)
        return make_block(
            responses[0],
            sts1=responses[1],
            sts2=responses[2],
            position_m=position_m,
            yaw_rad=yaw_rad,
            first_path=np.full(len(x_m), ZERO_TAP),
        )

    return drive
