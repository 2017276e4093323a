"""Range of what faces the radar as a mirror does."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, FloatArray, Params, Stage, ports


class MirrorRangeParams(Params):
    """Where mirrors face."""

    boresight_within_deg: float = Field(
        12.0,
        ge=0,
        description="Targets at azimuths up to this are taken to face along the boresight: of a surface that is "
        "driven at, the azimuth is noise.",
    )
    bias_m: float = Field(0.0, description="Calibration offset that is subtracted.")


class MirrorRange(Stage[MirrorRangeParams]):
    r"""Delay of each detection, and the range of a mirror that faces the radar.

    Plates, walls and the sides of boxes reflect like mirrors: the path goes by way of the point where the angles are
    equal, not the point of the outline that is nearest, whose range is asked for. With the receiver at 0, the
    transmitter at t, D = \|t\|, and a mirror at distance r across the unit vector n, the path is that to the
    transmitter's image, ``d^2 = |t + 2 (r - t.n) n|^2 = D^2 + 4 r (r - t.n)``, so that

        ``r = (t.n + sqrt((t.n)^2 + d^2 - D^2)) / 2``.

    n points along the azimuth seen from the middle of both antennas (``middle_rad``, else ``azimuth_rad``), or along
    the boresight where that is near, or where there is no azimuth. A point target at the same azimuth has the range of
    stage ``range``, which differs by ``D^2 sin^2 / (4 r)`` at most: 0.8 cm at 1 m for a baseline of 18 cm.

    ``d^2 - D^2 = e (e + 2 D)`` in the excess path e, which keeps its precision next to the direct path. Detections
    before it, e < 0, have no range.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "first_path", "detections", "tap")
    produces: ClassVar[frozenset[str]] = ports("delay_s", "range_m")
    rowwise = True

    def recalibrated(self, column: str, offset: float) -> dict[str, float]:
        """A bias of ``offset`` metres more."""
        return {"bias_m": self.params.bias_m + offset} if column == "range_m" else {}

    def step(self, block: Block) -> Block:
        """Block whose detections carry ``delay_s`` and ``range_m``."""
        radar, rows = self.radar, block.detections
        delay_s = (rows["tap"] - block.part("first_path")[block.rows]) * radar.sample_interval_s
        azimuth_rad = rows["middle_rad"] if "middle_rad" in rows.names else rows.azimuth_rad
        range_m = mirror_range(
            radar.excess_m(delay_s), azimuth_rad, radar.baseline_m, np.deg2rad(self.params.boresight_within_deg)
        )
        return block.with_columns(delay_s=delay_s, range_m=range_m - self.params.bias_m)


def mirror_range(
    excess_m: FloatArray, azimuth_rad: FloatArray, baseline_m: FloatArray, boresight_within_rad: float
) -> FloatArray:
    """Distance of mirrors from the receiver; NaN where the path is shorter than the baseline.

    Parameters
    ----------
    excess_m : (n,) array
        Path length minus the baseline.
    azimuth_rad : (n,) array
        Direction that they face, from boresight; NaN: along it.
    baseline_m : (3,) array
        From receiver to transmitter, in the receiver frame.
    boresight_within_rad : float
        Azimuths up to this count as 0.
    """
    faces_rad = np.where(np.abs(azimuth_rad) > boresight_within_rad, azimuth_rad, 0.0)
    along_m = np.cos(faces_rad) * baseline_m[0] + np.sin(faces_rad) * baseline_m[1]
    beyond = excess_m * (excess_m + 2 * float(np.linalg.norm(baseline_m)))
    root = np.sqrt(np.maximum(along_m * along_m + beyond, 0.0))
    # (a + sqrt(a^2 + b)) / 2 loses its digits where a < 0 and b is small.
    half = np.where(along_m >= 0, along_m + root, beyond / np.where(along_m < 0, root - along_m, 1.0)) / 2
    return np.asarray(np.where(excess_m >= 0, half, np.nan))
