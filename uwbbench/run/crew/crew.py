"""Calls carried out by workers, each of which plays one role all its life."""

from __future__ import annotations

import pickle
import selectors
import signal
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Protocol, Self

from uwbbench.api.errors import UwbbenchError
from uwbbench.api.interruption import by_plugin
from uwbbench.run.crew.messages import GAVE, LARGEST_BYTES, LENGTH, Refused, packed, send, unpacked
from uwbbench.run.crew.nursery import LIVED, LOST, Nursery, nursery
from uwbbench.run.crew.worker import Raised, Surroundings, said_of

MOST_IDLE = 12
"""Workers that are kept for their role while they have nothing to do; those idle for longest end."""


@dataclass(frozen=True, eq=False)
class Task:
    """One call.

    Attributes
    ----------
    role : str
        What the worker is for, such as a detector: no worker ever plays two roles.
    function : callable
        Of a module, so that a worker finds it.
    arguments : tuple
    limit_s : float
        A call that takes longer is ended, with its worker.
    limited_by : str
        What set that limit, for the reason.
    worker : int or None
        Number of the worker that has to do it, as it has something at hand; any of the role if None.
    """

    role: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    limit_s: float
    limited_by: str = ""
    worker: int | None = None


@dataclass(frozen=True)
class Ending:
    """How a task ended.

    Attributes
    ----------
    task : Task
    worker : int
        Number of the worker that did it.
    message : bytes or None
        What it gave, as its worker packed it; None where it gave nothing.
    raised : Raised or None
        Why it gave nothing.
    seconds : float
        How long it took.
    died : bool
        Whether its worker is no more.
    """

    task: Task
    worker: int
    message: bytes | None
    raised: Raised | None
    seconds: float
    died: bool = False


class Hands(Protocol):
    """Whoever carries out tasks.

    Attributes
    ----------
    size : int
        Tasks at the same time.
    apart : bool
        Whether roles are played by processes of their own.
    """

    size: int
    apart: bool

    def start(self, task: Task) -> None:
        """Begin a task; never more than ``size`` at a time."""

    def next(self) -> Ending:
        """Wait for the next task to end."""

    def hold(self, worker: int) -> None:
        """Keep a worker for tasks that ask for it by its number."""

    def release(self, worker: int) -> None:
        """Let a worker that was held do other tasks of its role."""

    def dismiss(self, worker: int) -> None:
        """End a worker; one that has ended already is no error."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...


@dataclass
class _Worker:
    number: int
    role: str
    pid: int
    channel: socket.socket
    task: Task | None = None
    started: float = 0.0
    idle_since: float = 0.0
    heard: bytearray = field(default_factory=bytearray)


class Crew:
    """Workers of a run.

    Parameters
    ----------
    size : int
        Tasks that are carried out at the same time.
    memory_mb : float, optional
        What each worker may allocate; as much as there is if left out.
    """

    apart = True

    def __init__(self, size: int, memory_mb: float | None = None) -> None:
        self.size, self._memory_mb = size, memory_mb
        self._nursery: Nursery = nursery()
        self._workers: dict[int, _Worker] = {}
        self._selector = selectors.DefaultSelector()
        self._count = 0
        self._held: set[int] = set()
        self._lost: deque[Task] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in list(self._workers.values()):
            self._end(worker)
        self._selector.close()

    def start(self, task: Task) -> None:
        """Begin a task, by a worker of its role that has nothing to do or a new one.

        Parameters
        ----------
        task : Task
        """
        if task.worker is not None and task.worker not in self._workers:
            self._lost.append(task)
            return
        worker = self._free(task)
        worker.task, worker.started = task, time.monotonic()
        message = pickle.dumps((task.function, task.arguments), protocol=5)
        with suppress(BrokenPipeError, ConnectionResetError):  # it has ended: its channel says so to who waits
            send(worker.channel, message)

    def next(self) -> Ending:
        """Wait for the next task to end: by an answer, by the death of its worker, or by its limit."""
        if self._lost:
            task = self._lost.popleft()
            return Ending(
                task, task.worker or 0, None, Raised("the process that had it at hand has ended", ""), 0.0, True
            )
        while True:
            for worker in self._workers.values():
                if worker.task is not None and time.monotonic() - worker.started > worker.task.limit_s:
                    return self._ended(worker, f"took longer than {worker.task.limit_s:.4g} s{worker.task.limited_by}")
            busy = [w.started + w.task.limit_s for w in self._workers.values() if w.task is not None]
            patience = max(0.0, min(busy) - time.monotonic()) + 0.01
            for key, _ in self._selector.select(patience):
                ending = self._heard(key.data)
                if ending is not None:
                    return ending

    def hold(self, worker: int) -> None:
        """Keep a worker for tasks that ask for it by its number."""
        self._held.add(worker)

    def release(self, worker: int) -> None:
        """Let a worker that was held do other tasks of its role."""
        self._held.discard(worker)

    def dismiss(self, worker: int) -> None:
        """End a worker; one that has ended already is no error."""
        self._held.discard(worker)
        if worker in self._workers:
            self._end(self._workers[worker])

    def _free(self, task: Task) -> _Worker:
        if task.worker is not None:
            return self._workers[task.worker]
        idle = [
            one
            for one in self._workers.values()
            if one.task is None and one.role == task.role and one.number not in self._held
        ]
        return idle[0] if idle else self._hired(task.role)

    def _hired(self, role: str) -> _Worker:
        idle = sorted((w for w in self._workers.values() if w.task is None), key=lambda one: one.idle_since)
        idle = [one for one in idle if one.number not in self._held]
        for one in idle[: max(0, len(idle) - MOST_IDLE)]:
            self._end(one)
        pid, channel = self._nursery.fork()
        self._count += 1
        worker = _Worker(self._count, role, pid, channel)
        self._workers[worker.number] = worker
        self._selector.register(channel, selectors.EVENT_READ, worker)
        with suppress(BrokenPipeError, ConnectionResetError):  # as of a task
            send(channel, pickle.dumps(Surroundings.here(self._memory_mb)))
        return worker

    def _heard(self, worker: _Worker) -> Ending | None:
        """Ending of a worker's task, once all of its answer is there, or its end."""
        try:
            part = worker.channel.recv(1 << 20)
        except OSError:
            part = b""
        worker.heard += part
        if worker.task is None:  # it has died between tasks, or says what nobody asked
            self._end(worker)
            return None
        if not part:
            return self._ended(worker)
        if len(worker.heard) < LENGTH.size:
            return None
        (size,) = LENGTH.unpack(worker.heard[: LENGTH.size])
        if size > LARGEST_BYTES:
            return self._ended(worker, f"answered with {size} bytes, of which {LARGEST_BYTES} are allowed")
        if len(worker.heard) < LENGTH.size + size:
            return None
        kind, message = worker.heard[LENGTH.size : LENGTH.size + 1], bytes(worker.heard[LENGTH.size + 1 :])
        worker.heard.clear()
        task, worker.task = worker.task, None
        worker.idle_since = time.monotonic()
        seconds = worker.idle_since - worker.started
        if kind == GAVE:
            return Ending(task, worker.number, message, None, seconds)
        return Ending(task, worker.number, None, _raised(message), seconds)

    def _ended(self, worker: _Worker, why: str = "") -> Ending:
        """Ending of the task of a worker that has died, or has to."""
        task, seconds = worker.task, time.monotonic() - worker.started
        assert task is not None  # noqa: S101 - only such are asked about
        self._forget(worker)
        if why:
            self._nursery.kill(worker.pid)
        else:
            why = _how(self._nursery.wait(worker.pid))
        return Ending(task, worker.number, None, Raised(why, ""), seconds, died=True)

    def _end(self, worker: _Worker) -> None:
        self._forget(worker)
        if self._nursery.alive:  # else it has ended all its workers
            with suppress(UwbbenchError):  # or is ending just now
                self._nursery.kill(worker.pid)

    def _forget(self, worker: _Worker) -> None:
        self._selector.unregister(worker.channel)
        worker.channel.close()
        del self._workers[worker.number]


def _raised(message: bytes) -> Raised:
    """What a worker says that its call raised."""
    try:
        said = unpacked(message)
    except Refused as error:
        return Raised(str(error), "")
    return said if isinstance(said, Raised) else Raised("it says nothing that can be read", "")


def _how(code: int) -> str:
    """What an exit code means."""
    if code in (LIVED, LOST):
        return "its process closed the line to the run"
    if code >= 0:
        return f"its process ended itself (exit code {code})"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"its process was ended by {name}" + (", as for want of memory" if -code == signal.SIGKILL else "")


class InProcess:
    """Tasks in this process, one after the other: for a debugger. Nothing is isolated, and no limit is kept."""

    size = 1
    apart = False

    def __init__(self) -> None:
        self._task: Task | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is left to end."""

    def start(self, task: Task) -> None:
        """Take a task."""
        self._task = task

    def next(self) -> Ending:
        """Carry out the task."""
        task, self._task = self._task, None
        assert task is not None  # noqa: S101 - there is one
        started = time.monotonic()
        message, raised = None, None
        try:
            message = packed(task.function(*task.arguments))
        except BaseException as error:
            if not by_plugin(error):
                raise
            raised = said_of(error)
        return Ending(task, 0, message, raised, time.monotonic() - started)

    def dismiss(self, worker: int) -> None:
        """Nobody is there to be dismissed."""

    def hold(self, worker: int) -> None:
        """All is at hand here."""

    def release(self, worker: int) -> None:
        """All is at hand here."""


def crew_of(size: int, memory_mb: float | None = None, *, isolated: bool = True) -> Hands:
    """Workers, or this process where there is no isolation.

    Parameters
    ----------
    size : int
        Tasks at the same time.
    memory_mb : float, optional
        What each worker may allocate.
    isolated : bool
    """
    return Crew(size, memory_mb) if isolated else InProcess()
