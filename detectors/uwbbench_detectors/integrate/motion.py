"""Where the robot was, for stages that add frames up along its way."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import Field

from uwbbench.api import FloatArray, Frames, Params, Stage


class MotionParams(Params):
    """What the motion of the robot is taken from."""

    odometry: bool = Field(
        True,
        description="Take the robot's motion from its odometry where the capture has it, else from the reference "
        "pose. Only steps between frames count, so that a drift does no harm.",
    )


def places_m(stage: Stage[Any], frames: Frames) -> tuple[FloatArray, FloatArray]:
    """Positions (frames, 3) and headings (frames,) of the robot as a stage's parameters ask for them.

    Parameters
    ----------
    stage : Stage
        With parameters that are :class:`MotionParams`.
    frames : Frames

    Returns
    -------
    (frames, 3) array, (frames,) array
        Read-only and in one piece, as compiled loops want them.
    """
    place_m, yaw_rad = frames.odometry_position_m, frames.odometry_yaw_rad
    if not stage.params.odometry or place_m is None or yaw_rad is None:
        place_m, yaw_rad = frames.position_m, frames.yaw_rad
    return plain(place_m, np.float64), plain(yaw_rad, np.float64)


def plain(values: Any, kind: type[np.generic]) -> Any:
    """Read-only array in one piece, as compiled loops are compiled for; copied only where it is not one already.

    Parameters
    ----------
    values : array
    kind : type
        Of its elements.
    """
    made = np.ascontiguousarray(values, kind)
    if made.flags.writeable:
        made = made.view()
        made.flags.writeable = False
    return made


def single(samples: Any) -> Any:
    """Frames (frames, taps) in single precision, read-only, whatever the scale of those in double precision.

    The latter are divided by their largest part each, since what follows is relative to the direct path.

    Parameters
    ----------
    samples : (frames, taps) complex array
    """
    if samples.dtype == np.complex64:
        return plain(samples, np.complex64)
    parts = np.ascontiguousarray(samples, np.complex128).view(np.float64)
    largest = np.max(np.abs(parts), axis=1, initial=0.0)
    scale = np.where(np.isfinite(largest) & (largest > np.finfo(float).tiny), largest, 1.0)
    return plain((parts / scale[:, None]).view(np.complex128), np.complex64)
