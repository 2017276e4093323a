"""A worker process as seen from the gate: requests, answers, and what is said when it breaks."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from uwbbench.api.errors import UwbbenchError
from uwbbench.config.source import CaptureRef, RunRef
from uwbbench.measure.latency.launch import ONE_THREAD
from uwbbench.tools.gate.config import Side
from uwbbench.tools.gate.worker import PROTOCOL

OWN = Path(sys.executable)


class SetUpError(UwbbenchError):
    """Something could not be measured: an environment, a detector or a capture is not as the gate needs it."""


class Worker:
    """A process that runs detectors, in this or another environment, on one core with one thread.

    Parameters
    ----------
    python : Path
        Interpreter of the environment.
    timeout_s : float
        An answer that takes longer has failed.

    Raises
    ------
    SetUpError
        If there is no such interpreter, or its uwbbench does not understand this one.
    """

    def __init__(self, python: Path, timeout_s: float) -> None:
        self.python, self.timeout_s = python, timeout_s
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the process
        try:
            self._process = subprocess.Popen(  # noqa: S603 - the interpreter that the gate file names
                [str(python), "-P", "-m", "uwbbench.tools.gate.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
                text=True,
                bufsize=1,
                env=_environment(python),
            )
        except OSError as error:
            self._said.close()
            raise SetUpError(f"{python}: no Python interpreter to run: {error.strerror or error}") from None
        self._answers: queue.SimpleQueue[str] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()
        try:
            self.hello = self._answer("start")
            self._check_protocol()
        except BaseException:
            self.close()
            raise

    def _check_protocol(self) -> None:
        theirs = self.hello.get("protocol")
        if theirs != PROTOCOL:
            raise SetUpError(
                f"{self.python}: its uwbbench {self.hello.get('uwbbench')} speaks version {theirs} of the gate's "
                f"protocol, this one version {PROTOCOL}; install versions that agree"
            )

    def _listen(self) -> None:
        assert self._process.stdout is not None  # noqa: S101 - for the type checker
        for line in self._process.stdout:
            self._answers.put(line)
        self._answers.put("")

    def ask(self, do: str, **values: Any) -> dict[str, Any]:
        """Answer to a request.

        Raises
        ------
        SetUpError
            If the request cannot be met, the process ended, or took too long.
        """
        assert self._process.stdin is not None  # noqa: S101 - for the type checker
        try:
            self._process.stdin.write(json.dumps({"do": do, **values}) + "\n")
            self._process.stdin.flush()
        except OSError:
            pass  # it has ended: what it said last is read below
        answer = self._answer(do)
        if "error" in answer:
            where = "" if self.python == OWN else f"{self.python}: "
            raise SetUpError(f"{where}{answer['error']}")
        return answer

    def _answer(self, do: str) -> dict[str, Any]:
        try:
            line = self._answers.get(timeout=self.timeout_s)
        except queue.Empty:
            raise SetUpError(f"{self.python}: no answer within {self.timeout_s:g} s ({do})") from None
        if not line:
            raise SetUpError(f"{self.python}: {self._ending()}")
        try:
            answer = json.loads(line)
        except ValueError:
            answer = None
        if not isinstance(answer, dict):
            raise SetUpError(f"{self.python}: no answer of a worker: {line.strip()!r}")
        return answer

    def _ending(self) -> str:
        """How the process ended, and what it said last."""
        code = self._process.wait(timeout=self.timeout_s)
        self._said.seek(0)
        lines = [line for line in self._said.read().decode(errors="replace").splitlines() if line.strip()]
        how = f"killed by signal {-code}" if code < 0 else f"exit code {code}"
        said = lines[-1] if lines else "it said nothing"
        if "No module named" in said and "uwbbench" in said:
            said += "; install a uwbbench with gates there"
        return f"the worker ended ({how}): {said}"

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._said):
            if pipe is not None:
                pipe.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def worker_of(side: Side, timeout_s: float) -> Worker:
    """Start a worker in the environment of a side."""
    return Worker(side.python or OWN, timeout_s)


def join(worker: Worker, player: str, side: Side, ref: CaptureRef, frames: int, windows: int) -> dict[str, Any]:
    """Load a side's detector and frames of a capture in a worker, and warm up.

    Parameters
    ----------
    worker : Worker
    player : str
        Name that later requests use.
    side : Side
    ref : CaptureRef
    frames : int
        Frames used at most, from the start of the capture.
    windows : int
        Windows of warm-up at most, if their times never agree.

    Returns
    -------
    dict
        Median time of a call ``call_s``, number of ``frames``, hash of their ``content``, ``frame_rate_hz`` and
        ``source``.

    Raises
    ------
    SetUpError
        If the worker cannot load or run them.
    """
    return worker.ask(
        "join", player=player, detector=_detector(side), capture=asdict(ref), frames=frames, windows=windows
    )


def detect(
    worker: Worker, side: Side, ref: CaptureRef | RunRef, *, candidates: bool, handed_out: bool, to: Path
) -> dict[str, Any]:
    """Run a side's detector on a whole capture, or its mapper on a run, in a worker; what it finds goes into files.

    Parameters
    ----------
    worker : Worker
    side : Side
    ref : CaptureRef or RunRef
    candidates : bool
        Whether to write the peaks before the filters too, next to the detections as ``*.candidates.parquet``.
    handed_out : bool
        Whether to find out after which frame each detection is handed out.
    to : Path
        Parquet file for the detections.

    Returns
    -------
    dict
        Hash of the capture's content ``sha256``, and its number of ``frames``.

    Raises
    ------
    SetUpError
        If the worker cannot load or run them.
    """
    asked = {"candidates": candidates, "handed_out": handed_out, "to": str(to)}
    return worker.ask("detect", detector=_detector(side), capture=asdict(ref), **asked)


def _detector(side: Side) -> dict[str, Any]:
    return {"use": side.detector, "set": side.set}


def _environment(python: Path) -> dict[str, str]:
    """Environment of a worker: one thread, and in another Python environment nothing that points back into this one."""
    kept = {**os.environ, **ONE_THREAD}
    if python != OWN:
        for name in ("PYTHONPATH", "PYTHONHOME", "__PYVENV_LAUNCHER__"):
            kept.pop(name, None)
    return kept
