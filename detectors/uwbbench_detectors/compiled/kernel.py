"""The paper's chain, and others made of the same stages, as one search of each frame."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np

from uwbbench.api import Block, BoolArray, Detections, FloatArray, Frames, IntArray, Kernel, Stage
from uwbbench_detectors.compiled import layout as at
from uwbbench_detectors.compiled.chain import chain_of
from uwbbench_detectors.peaks.noise import FRAMES_TO_JUDGE, NoiseFloor
from uwbbench_detectors.position.pdoa import Pdoa

WORTH_SHARING = 1024
"""Frames of a block from which on threads gain more than they cost."""

WORTH_A_CALL = 16
"""Frames between two irregular ones that are searched along sooner than by a call of their own."""

_NO_VALUES: FloatArray = np.zeros(1)
_NO_POSES: FloatArray = np.zeros((1, 3))
for _nothing in (_NO_VALUES, _NO_POSES):
    _nothing.flags.writeable = False


class FrameSearch(Kernel):
    """Noise floor, first path, profile, peaks, their filters and selection, azimuth, range and position in one pass.

    A frame in which the rounding of a logarithm or an angle could decide, or whose values are not finite, is searched
    by the stages themselves, so that the same peaks are found whatever the input.
    """

    def __init__(self, stages: Sequence[Stage[Any]], threads: int = 1, preface: Sequence[str] = ()) -> None:
        from uwbbench_detectors.compiled.search import search, search_alone  # compiles, or loads what was compiled

        super().__init__(stages, threads, preface)
        self._search, self._search_alone = search, search_alone
        chain, _ = chain_of(stages)
        self._how, self._limits = chain.how, chain.limits
        self._names = tuple(chain.columns)
        self._width = 1 + len(self._names)
        self._order = np.array([at.COLUMNS.index(name) for name in chain.columns])
        self._one_a_frame = chain.how[at.SELECT] != at.SELECT_ALL and chain.how[at.COUNT] == 1
        self._given = chain.how[at.FIRST_PATH] == at.FIRST_PATH_GIVEN
        self._phased, self._placed = bool(chain.how[at.PHASED]), bool(chain.how[at.PLACED])
        self._aligned = bool(chain.how[at.ALIGNED])
        self._alone = not (self._given or self._phased or self._placed)
        self._noise_tally = np.zeros(at.NOISE_TALLY, np.int64)
        self._irregular = np.empty(1, np.bool_)
        self._plain = [_apart(stage) for stage in stages]
        self._noise = next((stage for stage in stages if isinstance(stage, NoiseFloor)), None)
        # The stage that still has to judge its leading taps.
        self._judging = self._noise if self._noise is not None and self._noise.method == "leading" else None
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    @classmethod
    def covers(cls, stages: Sequence[Stage[Any]]) -> int:
        """How many of these stages one search does."""
        return chain_of(stages)[1]

    def detect(self, frames: Frames, first_path: FloatArray | None) -> Detections:
        """Detections in consecutive frames."""
        samples = frames.preamble
        count = len(samples)
        capacity = count if self._one_a_frame else count * (samples.shape[1] // 2)
        table = np.empty((capacity, self._width))
        irregular = self._irregular
        if len(irregular) != count:
            self._irregular = irregular = np.empty(count, np.bool_)
        if self._alone and count < WORTH_SHARING:  # most calls of a stream, in which every step counts
            written = self._search_alone(
                _plain(samples),
                _plain(frames.valid),
                frames.first,
                self._how,
                self._limits,
                self._order,
                self._noise_tally,
                table,
                irregular,
            )
        elif self._pool is not None and self._one_a_frame and count >= WORTH_SHARING:
            written = self._shared(self._pool, frames, first_path, table, irregular)
        else:
            written = self._searched(frames, first_path, self._noise_tally, table, irregular)
        if self._judging is not None:
            self._judge(self._judging)
        plainly = written < 0
        if plainly:
            written = -1 - written
        if written < capacity:
            table = table[:written]
            if 2 * written < capacity:  # do not keep the room of a table that stayed nearly empty
                table = table.copy()
        made = Detections.of_table(self._names, table, (frames.first, frames.valid), self.notes)
        return self._with_plain(made, frames, first_path, irregular) if plainly else made

    def flush(self) -> None:
        """Conclude what was judged so far."""
        if self._noise is not None:
            self._noise.flush()
            self.gather_notes()
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def _searched(
        self,
        frames: Frames,
        first_path: FloatArray | None,
        noise_tally: IntArray,
        table: FloatArray,
        irregular: BoolArray,
    ) -> int:
        """Search a block; rows found, or -1 less that where some frames must be searched by the plain stages."""
        samples = _plain(frames.preamble)
        settings = frames.first, self._how, self._limits, self._order, noise_tally, table, irregular
        if self._alone:
            return self._search_alone(samples, _plain(frames.valid), *settings)
        given = path = path1 = path2 = yaw_rad = _NO_VALUES
        robot_m = _NO_POSES
        response1 = response2 = samples
        if self._given:
            given = _plain(np.zeros(len(samples)) if first_path is None else first_path)
        if self._phased:
            response1, response2 = _plain(frames.sts1), _plain(frames.sts2)
            if self._aligned and self._how[at.ALIGNED]:
                paths = frames.first_path_index, frames.first_path_index_sts1, frames.first_path_index_sts2
                if any(reported is None for reported in paths):
                    self._read_at_same_tap(frames)
                else:
                    path, path1, path2 = (_plain(reported) for reported in paths)
        if self._placed:
            robot_m, yaw_rad = _plain(frames.position_m), _plain(frames.yaw_rad)
        inputs = given, response1, response2, path, path1, path2, robot_m, yaw_rad
        return self._search(samples, _plain(frames.valid), *inputs, *settings)

    def _shared(
        self,
        pool: ThreadPoolExecutor,
        frames: Frames,
        first_path: FloatArray | None,
        table: FloatArray,
        irregular: BoolArray,
    ) -> int:
        """Search a block with several threads, each its own part."""
        cuts = [len(frames) * part // self.threads for part in range(self.threads + 1)]

        def searched(start: int, stop: int, noise_tally: IntArray) -> int:
            path = None if first_path is None else first_path[start:stop]
            part = slice(start, stop)
            return self._searched(frames.part(start, stop), path, noise_tally, table[part], irregular[part])

        judged = np.array([FRAMES_TO_JUDGE, 0])
        others = [pool.submit(searched, *ends, judged.copy()) for ends in pairwise(cuts[1:])]
        counts = [searched(cuts[0], cuts[1], self._noise_tally), *(other.result() for other in others)]
        if self._judging is not None and self._noise_tally[at.JUDGED] < FRAMES_TO_JUDGE:
            # The first part had too few frames to judge the noise by: look at the others again, in their order.
            counts[1:] = [searched(*ends, self._noise_tally) for ends in pairwise(cuts[1:])]
        total = 0
        for start, written in zip(cuts, counts, strict=False):
            rows = max(written, -1 - written)
            table[total : total + rows] = table[start : start + rows]
            total += rows
        return -1 - total if min(counts) < 0 else total

    def _with_plain(
        self, regular: Detections, frames: Frames, first_path: FloatArray | None, irregular: BoolArray
    ) -> Detections:
        """Detections with those of irregular frames, which the stages themselves search.

        Frames that lie near each other are searched together, and what the stages find between them is found already.
        """
        rows = np.flatnonzero(irregular)
        parts = [regular]
        for near in np.split(rows, np.flatnonzero(np.diff(rows) > WORTH_A_CALL) + 1):
            start, stop = int(near[0]), int(near[-1]) + 1
            path = None if first_path is None else first_path[start:stop]
            block = Block(frames.part(start, stop).without_invalid(), first_path=path)
            for stage in self._plain:
                block = stage.step(block)
            wanted = irregular[block.detections.frame - frames.first]
            parts.append(block.detections.take(wanted))
        for stage, plain in zip(self.stages, self._plain, strict=True):
            if stage is not self._noise:  # its judgement counts every frame, and not these alone
                for note in plain.notes:
                    stage.note(note)
        self.gather_notes()
        joined = Detections.join(parts)
        ordered = joined.take(np.argsort(joined.frame, kind="stable"))
        return ordered.annotated(processed=regular.processed, notes=self.notes)

    def _judge(self, noise: NoiseFloor) -> None:
        """Hand on what was counted of the leading taps, until the noise floor has its verdict."""
        judged = int(self._noise_tally[at.JUDGED])
        noise.tally(judged, int(self._noise_tally[at.SUSPICIOUS]))
        self._judging = noise if judged < FRAMES_TO_JUDGE else None
        self.gather_notes()

    def _read_at_same_tap(self, frames: Frames) -> None:
        """Let the phase stage note why responses are read at the preamble's tap, and do so."""
        self._how[at.ALIGNED] = 0
        phase = next(stage for stage in self.stages if isinstance(stage, Pdoa))
        phase.alignment(frames)
        self.gather_notes()


def _apart(stage: Stage[Any]) -> Stage[Any]:
    """The same opened stage with notes and state of its own."""
    twin = copy.copy(stage)
    twin.notes = []
    return twin


def _plain(values: Any) -> Any:
    """Read-only array in one piece, as the compiled search was compiled for."""
    flags = values.flags
    if not (flags.c_contiguous and flags.aligned):
        values = np.array(values, order="C")
    elif not flags.writeable:
        return values
    plain = values.view()
    plain.flags.writeable = False
    return plain
