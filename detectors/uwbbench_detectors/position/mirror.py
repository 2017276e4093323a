"""Range of what faces the radar as a mirror does."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import SPEED_OF_LIGHT_M_S, Block, FloatArray, Params, Radar, Stage, ports
from uwbbench_detectors.integrate.motion import plain
from uwbbench_detectors.position.receivers import of_receiver


class MirrorRangeParams(Params):
    """Where mirrors face."""

    boresight_within_deg: float = Field(
        12.0,
        ge=0,
        description="Targets at azimuths up to this are taken to face along the boresight: of a surface that is "
        "driven at, the azimuth is noise.",
    )
    bias_m: float | dict[str, float] = Field(
        0.0, description="Calibration offset that is subtracted, one for all receivers or by their names."
    )


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
        if column != "range_m":
            return {}
        return {"bias_m": of_receiver(self.params.bias_m, getattr(self, "radar", None), "bias_m") + offset}

    def open(self, radar: Radar) -> None:
        """Work out the geometry of the antennas."""
        super().open(radar)
        from uwbbench_detectors.position import mirror_loops as loops

        self._mirror_ranges = loops.mirror_ranges
        from_transmission = radar.first_tap_delay_s is not None
        settings = {
            loops.WITHIN_RAD: np.deg2rad(self.params.boresight_within_deg),
            loops.BASELINE_X: radar.baseline_m[0],
            loops.BASELINE_Y: radar.baseline_m[1],
            loops.BASELINE_M: radar.baseline_length_m,
            loops.INTERVAL_S: radar.sample_interval_s,
            loops.EXCESS_OFFSET_M: radar.baseline_length_m if from_transmission else 0.0,
            loops.SPEED_M_S: SPEED_OF_LIGHT_M_S,
            loops.BIAS_M: of_receiver(self.params.bias_m, radar, "range.mirror: bias_m"),
        }
        self.at: FloatArray = np.zeros(loops.SETTINGS)
        self.at[list(settings)] = list(settings.values())

    def step(self, block: Block) -> Block:
        """Block whose detections carry ``delay_s`` and ``range_m``."""
        rows = block.detections
        delay_s = (rows["tap"] - block.part("first_path")[block.rows]) * self.radar.sample_interval_s
        azimuth_rad = plain(rows["middle_rad" if "middle_rad" in rows.names else "azimuth_rad"], np.float64)
        range_m = self._mirror_ranges(plain(delay_s, np.float64), azimuth_rad, self.at)
        return block.with_columns(delay_s=delay_s, range_m=range_m)
