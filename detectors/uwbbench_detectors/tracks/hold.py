"""Detections that are kept for a while after a body has stopped to show."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import Block, Detections, Params, Radar, Stage, ports


class HoldParams(Params):
    """How long, and of how many bodies."""

    hold_s: float = Field(
        2.0,
        gt=0,
        description="Seconds for which a detection is repeated. Someone who stands shows by breathing, whose still "
        "moments are half a breath, 2 s, apart.",
    )
    targets: int = Field(1, ge=1, le=16, description="Rows of a frame, those held included.")
    depth_m: float = Field(0.45, gt=0, description="A detection this near to a held one is the same body.")
    speed_m_s: float = Field(2.0, ge=0, description="Added to the depth for each second that a row has been held.")


class Hold(Stage[HoldParams]):
    """The last detections repeated in frames that have none, until they are too old.

    A held row is the last one of its body with all its columns, and ``held`` 1, as nothing was measured of it in that
    frame. It ends after ``hold_s``, where a detection lies within ``depth_m`` and what the body may have gone
    meanwhile, or where a frame has as many detections as ``targets``. A body that stands is kept so, and one that has
    gone is a ghost for as long. No row is held in frames that are invalid or of zeros. For a radar that stands.
    """

    consumes: ClassVar[frozenset[str]] = ports("frames", "detections", "range_m")
    produces: ClassVar[frozenset[str]] = ports("detections", "held")

    def open(self, radar: Radar) -> None:
        """Start without rows."""
        super().open(radar)
        self._held: list[tuple[float, float, dict[str, Any]]] = []  # time and range of a row, and the row

    def step(self, block: Block) -> Block:
        """Block with the rows that are held."""
        found, frames = block.detections, block.frames
        found = found.with_columns(held=np.zeros(len(found)))
        if not len(found) and not self._held:
            return block.replace(detections=found)
        columns = found.columns
        order = np.argsort(found.frame, kind="stable")
        stop = np.searchsorted(found.frame[order], frames.index, side="right")
        rows: list[dict[str, Any]] = []
        start = 0
        for place, end in enumerate(stop):
            now = [{name: values[row] for name, values in columns.items()} for row in order[start:end]]
            start = end
            rows += now
            if len(now) or (self._held and frames.valid[place] and frames.preamble[place].any()):
                rows += self._step(now, frames.first + place, float(frames.timestamp_s[place]))
        names = list(dict.fromkeys(name for row in rows for name in row)) or list(columns)
        table: dict[str, Any] = {name: [row.get(name, np.nan) for row in rows] for name in names}
        frame = table.pop("frame")
        return block.replace(detections=Detections(frame, processed=found.processed, notes=found.notes, **table))

    def _step(self, now: list[dict[str, Any]], frame: int, time_s: float) -> list[dict[str, Any]]:
        """Rows to add to those of one frame."""
        p = self.params
        alive = [
            (since_s, range_m, row)
            for since_s, range_m, row in self._held
            if time_s - since_s <= p.hold_s
            and not any(abs(new["range_m"] - range_m) <= p.depth_m + p.speed_m_s * (time_s - since_s) for new in now)
        ][: max(p.targets - len(now), 0)]
        seen = [(time_s, new["range_m"], new) for new in now if np.isfinite(new["range_m"])]
        self._held = [*seen, *alive]
        return [{**row, "frame": frame, "held": 1.0} for _, _, row in alive]
