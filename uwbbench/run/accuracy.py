"""The accuracy pass: captures are opened, detectors find, and what they found is scored, each in a process of its own.

A process that has run a detector does nothing else afterwards: it neither opens captures for others nor scores, so that
no detector can change what another is given or how it is judged.
"""

from __future__ import annotations

import pickle
import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path

from uwbbench.run.crew import Ending, Task
from uwbbench.run.crew.crew import Hands
from uwbbench.run.crew.worker import Raised
from uwbbench.run.limits import Allowance
from uwbbench.run.suite import ChangedCapture
from uwbbench.run.unit import Finished, Job, Opened, entry_of, found, judged, opened

OPENS = "captures"
"""Role of the processes that open captures and score what was found on them."""
PATIENCE_S = 3600.0
"""For opening a capture, which may have to be simulated first, and for scoring."""


Handle = Callable[[Ending], Iterator[Finished]]
"""What follows when a task has ended."""


@dataclass
class _Capture:
    """A capture on its way.

    Attributes
    ----------
    units : deque of Job
        Not begun.
    one : Job
        Any of its units, to open it by.
    worker : int or None
        Number of the process that has it open.
    known : Opened
        What that one said of it.
    detecting : int
        Detectors at work on it.
    answers : deque
        What detectors found, and how long they took: to be scored.
    scoring : bool
        Whether its process is scoring.
    """

    units: deque[Job]
    one: Job
    worker: int | None = None
    known: Opened = field(default_factory=Opened)
    detecting: int = 0
    answers: deque[tuple[Job, bytes | None, float]] = field(default_factory=deque)
    scoring: bool = False

    @property
    def done(self) -> bool:
        """Whether nothing is left to do on it."""
        return not (self.units or self.detecting or self.answers or self.scoring)

    def forget(self) -> None:
        """Take back what waits to be scored, as the process that had the capture open has died."""
        self.units.extendleft(job for job, _, _ in reversed(self.answers))
        self.answers.clear()
        self.worker = None


class AccuracyPass:
    """Units carried out by a crew.

    Parameters
    ----------
    hands : Hands
        Who does it.
    jobs : sequence of Job
        Units of the same capture one after the other.
    allowance : Allowance
        Time that detectors are given.
    """

    def __init__(self, hands: Hands, jobs: Sequence[Job], allowance: Allowance) -> None:
        self._hands, self._allowance = hands, allowance
        by_capture: dict[str, deque[Job]] = {}
        for job in jobs:
            by_capture.setdefault(f"{job.unit.dataset} {job.unit.capture_id}", deque()).append(job)
        self._waiting = deque(_Capture(units, units[0]) for units in by_capture.values())
        self._open: list[_Capture] = []
        self._running: dict[Task, Handle] = {}
        self._numbers = count()

    def finished(self) -> Iterator[Finished]:
        """Units as they end.

        Raises
        ------
        ChangedCapture
            If a suite's capture is not the one that it was frozen with.
        """
        with tempfile.TemporaryDirectory(prefix="uwbbench-") as scratch:
            self._fill(Path(scratch))
            while self._running:
                ending = self._hands.next()
                ended = list(self._running.pop(ending.task)(ending))
                for capture in [one for one in self._open if one.done]:
                    self._close(capture)
                self._fill(Path(scratch))  # before what has ended is stored, so that nobody waits for that
                yield from ended

    def _fill(self, scratch: Path) -> None:
        """Start as many tasks as are carried out at the same time."""
        while len(self._running) < self._hands.size and (begun := self._next(scratch)) is not None:
            task, handle = begun
            self._running[task] = handle
            self._hands.start(task)

    def _next(self, scratch: Path) -> tuple[Task, Handle] | None:
        """Whatever can be done now, and what follows: score, detect, or open one more capture."""
        for capture in self._open:
            if capture.worker is not None and capture.answers and not capture.scoring:
                return self._to_score(capture)
        for capture in self._open:
            if capture.worker is not None and capture.units:
                return self._to_detect(capture)
        if self._waiting and len(self._open) < self._hands.size:
            return self._to_open(self._waiting.popleft(), scratch)
        return None

    def _to_open(self, capture: _Capture, scratch: Path) -> tuple[Task, Handle]:
        self._open.append(capture)
        shared = len({job.unit.detector.name for job in capture.units}) > 1
        file = scratch / f"{next(self._numbers)}" if shared and self._hands.apart else None
        task = Task(OPENS, opened, (capture.one, file), PATIENCE_S)
        return task, partial(self._was_opened, capture)

    def _was_opened(self, capture: _Capture, ending: Ending) -> Iterator[Finished]:
        if ending.raised is not None:
            self._hands.dismiss(ending.worker)
            capture.forget()
            while capture.units:
                yield _failed(capture.units.popleft(), ending.raised)
            return
        capture.known = pickle.loads(ending.message or b"")  # noqa: S301 - of a process that has run no detector
        if capture.known.changed:
            raise ChangedCapture(capture.known.changed)
        capture.worker = ending.worker
        self._hands.hold(ending.worker)

    def _to_detect(self, capture: _Capture) -> tuple[Task, Handle]:
        job = capture.units.popleft()
        name = job.unit.detector.name
        if job.unit.detector.results is not None:  # found by another program: nothing is run
            capture.answers.append((job, None, 0.0))
            return self._to_score(capture)
        limit_s = self._allowance.seconds(name, capture.known.frames)
        task = Task(f"detector {name}", found, (job, capture.known.file), limit_s, self._allowance.said)
        capture.detecting += 1
        return task, partial(self._was_detected, capture, job)

    def _was_detected(self, capture: _Capture, job: Job, ending: Ending) -> Iterator[Finished]:
        capture.detecting -= 1
        if ending.raised is not None:  # what it has left behind is nothing for the next capture
            self._hands.dismiss(ending.worker)
            yield _failed(job, ending.raised)
            return
        self._allowance.took(job.unit.detector.name, capture.known.frames, ending.seconds)
        capture.answers.append((job, ending.message, ending.seconds))

    def _to_score(self, capture: _Capture) -> tuple[Task, Handle]:
        job, message, seconds = capture.answers.popleft()
        capture.scoring = True
        task = Task(OPENS, judged, (job, message), PATIENCE_S, worker=capture.worker)
        return task, partial(self._was_scored, capture, job, seconds)

    def _was_scored(self, capture: _Capture, job: Job, seconds: float, ending: Ending) -> Iterator[Finished]:
        capture.scoring = False
        if ending.raised is None:
            finished: Finished = pickle.loads(ending.message or b"")  # noqa: S301 - of a process that ran no detector
            finished.entry.facts["elapsed_s"] = seconds + ending.seconds
            yield finished
            return
        yield _failed(job, ending.raised)
        if ending.died:  # what else was found on the capture waits for another process that opens it
            capture.forget()
            self._open.remove(capture)
            self._waiting.appendleft(capture)

    def _close(self, capture: _Capture) -> None:
        self._open.remove(capture)
        if capture.worker is not None:
            self._hands.release(capture.worker)
        if capture.known.file is not None:
            capture.known.file.unlink()


def contents(hands: Hands, jobs: Iterable[Job]) -> dict[str, str]:
    """SHA-256 of each capture, by its file name; empty where it cannot be opened.

    Parameters
    ----------
    hands : Hands
        Who opens them.
    jobs : iterable of Job
        One of each capture.
    """
    waiting, running, known = deque(jobs), dict[Task, str](), dict[str, str]()
    while waiting or running:
        while waiting and len(running) < hands.size:
            job = waiting.popleft()
            task = Task(OPENS, opened, (job,), PATIENCE_S)
            running[task] = job.unit.capture_id
            hands.start(task)
        ending = hands.next()
        # One that cannot be opened, or was changed, is no capture of before: its unit says why.
        given = Opened() if ending.message is None else pickle.loads(ending.message)  # noqa: S301 - ran no detector
        known[running.pop(ending.task)] = given.sha256
    return known


def _failed(job: Job, raised: Raised) -> Finished:
    return Finished(entry_of(job.unit, "failed", reason=raised.reason, traceback=raised.traceback))
