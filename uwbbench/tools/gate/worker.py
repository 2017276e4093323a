"""The process that runs detectors for a gate: one request a line on standard input, one answer a line, both JSON.

Run as ``python -m uwbbench.tools.gate.worker``, by the interpreter of the environment that the detector lives in, which
may hold another version of uwbbench than the gate's. Requests name what to do (``do``); see the functions below. An
answer with the key ``error`` is a message for the user, and the process goes on; anything unexpected ends it.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from uwbbench.api.capture import Capture
    from uwbbench.measure.latency.player import Player

PROTOCOL = 4
"""Raised whenever requests or answers change their meaning: only equal numbers understand each other."""


class Session:
    """What a worker knows: its players by name."""

    def __init__(self) -> None:
        self._players: dict[str, Player] = {}

    def join(
        self, player: str, detector: dict[str, Any], capture: dict[str, Any], frames: int, windows: int
    ) -> dict[str, Any]:
        """Load a detector and frames of a capture, and warm up.

        Parameters
        ----------
        player : str
            Name that later requests use.
        detector : dict
            Name or file (``use``) and values to change in it (``set``).
        capture : dict
            Fields of a :class:`~uwbbench.config.source.CaptureRef`.
        frames : int
            Frames used at most, from the start of the capture.
        windows : int
            Windows of warm-up at most, if their times never agree.

        Returns
        -------
        dict
            Median time of a call ``call_s``, from samples to rows, number of ``frames``, hash of their ``content``,
            ``frame_rate_hz`` and ``source``.
        """
        from uwbbench.measure.latency.player import Player
        from uwbbench.measure.latency.received import received

        opened = _opened(capture)
        joined = Player(_loaded(detector), opened, received(opened, frames))
        self._players[player] = joined
        joined.warm_up(windows)
        return {
            "call_s": joined.call_s(),
            "frames": len(joined.whole),
            "content": joined.content,
            "frame_rate_hz": opened.radar.frame_rate_hz,
            "source": opened.source,
        }

    def turn(self, player: str, size: int) -> dict[str, Any]:
        """Time of the player's next turn."""
        return {"spent_s": self._players[player].turn(size)}

    def blocks(self, base: str, head: str, size: int, count: int) -> dict[str, Any]:
        """Log ratios of two players of this process.

        Parameters
        ----------
        base, head : str
            Players that take turns.
        size : int
            Frames of a turn.
        count : int
            Blocks of turns.

        Returns
        -------
        dict
            ``log_ratios`` of head to base, one a block.
        """
        from uwbbench.measure.latency.player import in_turns
        from uwbbench.measure.latency.ratio import log_ratios

        times_s = in_turns([self._players[base], self._players[head]], size, count)
        return {"log_ratios": log_ratios(times_s[:, 1], times_s[:, 0]).tolist()}

    def respond(self, player: str, count: int, rate_hz: float, paced: bool) -> dict[str, Any]:
        """Response times of single frames.

        Parameters
        ----------
        player : str
        count : int
            Frames; a shorter capture is repeated.
        rate_hz : float
            Rate at which frames are due.
        paced : bool
            Hand out frames at that rate, or each when the one before is answered.

        Returns
        -------
        dict
            ``responses_us`` of each frame.
        """
        return {"responses_us": self._players[player].responses_us(count, rate_hz, paced=paced).tolist()}

    def detect(
        self, detector: dict[str, Any], capture: dict[str, Any], candidates: bool, handed_out: bool, to: str
    ) -> dict[str, Any]:
        """Run a detector on a whole capture, or a mapper on a run; what it finds goes into files.

        Parameters
        ----------
        detector, capture : dict
            As in :meth:`join`; of a run with the names of its ``captures``.
        candidates : bool
            Whether to write the peaks before the filters too, next to the detections as ``*.candidates.parquet``.
        handed_out : bool
            Whether to find out after which frame each detection is handed out.
        to : str
            Parquet file for the detections. Poses and map of a mapper are next to it, as ``*.poses.parquet`` and
            ``*.map.npz``.

        Returns
        -------
        dict
            Hash of the capture's content ``sha256``, and its number of ``frames``.
        """
        from uwbbench.run.folder.tables import write_detections

        if "captures" in capture:
            return _mapped(detector, capture, handed_out, Path(to))
        opened = _opened(capture)
        detections = _loaded(detector).run(opened, candidates=candidates, handed_out=handed_out)
        write_detections(Path(to), detections)
        if candidates and detections.candidates is not None:
            write_detections(Path(to).with_suffix(".candidates.parquet"), detections.candidates)
        return {"sha256": opened.sha256, "frames": len(opened)}


def _mapped(detector: dict[str, Any], run: dict[str, Any], handed_out: bool, to: Path) -> dict[str, Any]:
    """Answer of a mapper on a run, which goes into files."""
    from uwbbench.config.source import RunRef
    from uwbbench.detect.mapping import load_mapper
    from uwbbench.run.folder.mapped import write_mapped
    from uwbbench.run.folder.tables import write_detections

    names = {name: tuple(run[name]) for name in ("roots", "captures")}
    drive = RunRef(**{**run, **names}).open()
    found = load_mapper(detector["use"], changes=detector["set"]).run(drive, handed_out=handed_out)
    write_detections(to, found)
    assert found.mapped is not None  # noqa: S101 - of a mapper
    write_mapped(to.with_suffix(".poses.parquet"), to.with_suffix(".map.npz"), found.mapped, drive.time_s)
    return {"sha256": drive.sha256, "frames": len(drive)}


def _opened(capture: dict[str, Any]) -> Capture:
    from uwbbench.config.source import CaptureRef

    return CaptureRef(**{**capture, "roots": tuple(capture["roots"])}).open()


def _loaded(detector: dict[str, Any]) -> Any:
    from uwbbench.detect.pipeline import load_detector

    return load_detector(detector["use"], changes=detector["set"])


def main() -> int:
    """Answer until the input ends."""
    import uwbbench
    from uwbbench.api.errors import UwbbenchError

    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a plugin prints must not end up among the answers
    pinned = _pin()
    hello = {"protocol": PROTOCOL, "uwbbench": uwbbench.__version__, "folder": str(Path(uwbbench.__file__).parent)}
    answers.write(json.dumps({**hello, "pinned": pinned}) + "\n")
    session = Session()
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = getattr(session, request.pop("do"))(**request)
        except UwbbenchError as error:
            answer = {"error": str(error)}
        answers.write(json.dumps(answer) + "\n")
    return 0


def _pin() -> bool:
    """Keep this process on one core, the same for all workers: they take turns and never run at once."""
    if not hasattr(os, "sched_setaffinity"):
        return False
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # interrupts tend to be served by the first
    return True


if __name__ == "__main__":
    sys.exit(main())
