"""The chain of a moving radar, from the alignment to the map of fixed objects, in one pass over each frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from uwbbench.api import Detections, FloatArray, Frames, Kernel, Stage
from uwbbench_detectors.clutter.robot import RobotTemplate
from uwbbench_detectors.filters.sidelobe import SidelobeFilter
from uwbbench_detectors.filters.thresholds import AngleCostFilter, AzimuthFilter, ReflectionFilter
from uwbbench_detectors.first_path.template import AlignTemplate
from uwbbench_detectors.integrate import bank_layout as lay
from uwbbench_detectors.integrate.doppler_range import DopplerRange
from uwbbench_detectors.integrate.fuse import FuseResponses
from uwbbench_detectors.integrate.motion import places_m, plain, single
from uwbbench_detectors.position.doppler_phase import DopplerPhase
from uwbbench_detectors.position.mirror import MirrorRange
from uwbbench_detectors.smooth.matched import MatchedFilter
from uwbbench_detectors.tracks import fixed_layout as fixed
from uwbbench_detectors.tracks.fixed import FixedTrack

ORDER: tuple[type[Stage[Any]], ...] = (
    AlignTemplate,
    RobotTemplate,
    FuseResponses,
    MatchedFilter,
    DopplerRange,
    SidelobeFilter,
    DopplerPhase,
    AzimuthFilter,
    AngleCostFilter,
    MirrorRange,
    ReflectionFilter,
    FixedTrack,
)
"""Stages that are taken over, each once at most, in this order; the first and the bank must be there."""


class WholeChain(Kernel):
    """Alignment, robot template, fusion, matched filter, Doppler-range bank, mask, angle, range and map in one pass.

    Runs the same compiled steps as the stages do, so that rows are equal to the last bit; what it saves is the way
    from stage to stage, which in a stream takes longer than the work.
    """

    def __init__(self, stages: Sequence[Stage[Any]], threads: int = 1, preface: Sequence[str] = ()) -> None:
        super().__init__(stages, threads, preface)
        from uwbbench_detectors.integrate import whole_loops as loops

        self._whole_frames = loops.whole_frames
        by: dict[type[Stage[Any]], Any] = {type(stage): stage for stage in stages}
        self._align: AlignTemplate = by[AlignTemplate]
        self._bank: DopplerRange = by[DopplerRange]
        robot, fuse, match = by.get(RobotTemplate), by.get(FuseResponses), by.get(MatchedFilter)
        lobes, angle, mirror, map_ = (by.get(kind) for kind in (SidelobeFilter, DopplerPhase, MirrorRange, FixedTrack))
        self._switches = np.zeros(loops.SWITCHES, np.int64)
        switches = {
            loops.ROBOT: robot,
            loops.FUSES: fuse,
            loops.MATCHES: match,
            loops.SECOND: self._bank.params.second,
            loops.MASKS: lobes,
            loops.ANGLES: angle,
            loops.RANGES: mirror,
            loops.FOLLOWS: map_,
        }
        self._switches[list(switches)] = [bool(step) for step in switches.values()]
        self._sts1, self._sts2 = fuse is not None, self._bank.params.second
        self._limits = np.array([np.inf, np.inf, 0.0])
        if AzimuthFilter in by:
            self._limits[loops.WIDEST_RAD] = np.deg2rad(by[AzimuthFilter].params.maximum_deg)
        if AngleCostFilter in by:
            self._limits[loops.MOST_COST] = by[AngleCostFilter].params.maximum
        if ReflectionFilter in by:
            self._limits[loops.LEAST_REFLECTION] = by[ReflectionFilter].least
        taps = self.radar.taps
        none, no_rows = np.zeros(1), np.zeros((1, 1))
        self._refused = np.zeros(1, bool)
        bank = self._bank
        bank.at[lay.TO_TAP] = self._align.params.to_tap
        self._state = (
            self._switches,
            self._limits,
            self._align.templates,
            self._align.carried,
            self._align.at,
            self._align.table,
            robot.templates if robot else np.zeros((1, 2, taps), np.float32),
            robot.carried if robot else no_rows,
            robot.at if robot else none,
            fuse.noise if fuse else no_rows,
            match.pulse if match else np.zeros(1, np.float32),
            bank.bins,
            bank.carried,
            bank.noise,
            bank.come,
            bank.sums,
            bank.at,
            bank.rows,
            lobes.at if lobes else none,
            angle.fan if angle else no_rows,
            angle.at if angle else none,
            mirror.at if mirror else none,
            map_.objects if map_ else no_rows,
            map_.carried if map_ else none,
            map_.at if map_ else none,
            self._refused,
        )
        if map_:
            self._names: tuple[str, ...] = fixed.NAMES
            self._places = None
        else:
            self._names = bank.names
            places = list(range(1 + len(bank.names)))
            for stage, names, first in (
                (angle, ("azimuth_rad", "angle_cost", "middle_rad"), loops.AZIMUTH_RAD),
                (mirror, ("delay_s", "range_m"), loops.DELAY_S),
            ):
                if stage:
                    self._names += names
                    places += range(first, first + len(names))
            self._places = np.array(places)

    @classmethod
    def covers(cls, stages: Sequence[Stage[Any]]) -> int:
        """How many of these stages, from the first on, are a run of the chain."""
        place, taken = 0, 0
        for stage in stages:
            if type(stage) not in ORDER[place:]:
                break
            place = ORDER.index(type(stage)) + 1
            taken += 1
        kinds = [type(stage) for stage in stages[:taken]]
        if AlignTemplate not in kinds or DopplerRange not in kinds or stages[0].radar.first_tap_delay_s is not None:
            return 0
        if FixedTrack in kinds and not {DopplerPhase, MirrorRange} <= set(kinds):
            return taken - 1
        odometry = {stage.params.odometry for stage in stages[:taken] if hasattr(stage.params, "odometry")}
        return taken if len(odometry) == 1 else 0

    def detect(self, frames: Frames, first_path: FloatArray | None) -> Detections:  # noqa: ARG002
        """Detections in consecutive frames."""
        preamble = single(frames.preamble)
        sts1 = single(frames.sts1) if self._sts1 else preamble
        sts2 = single(frames.sts2) if self._sts2 else preamble
        place_m, yaw_rad = places_m(self._bank, frames)
        table = self._whole_frames(
            preamble, sts1, sts2, plain(frames.valid, np.bool_), place_m, yaw_rad, frames.first, *self._state
        )
        if self._refused[0]:
            self._refused[0] = False
            self._align.note_refused()
            self.gather_notes()
        if self._places is not None:
            table = np.ascontiguousarray(table[:, self._places])
        return Detections.of_table(self._names, table, (frames.first, frames.valid), self.notes)
