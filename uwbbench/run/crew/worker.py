"""What a forked worker does: calls that it is sent, one after the other."""

from __future__ import annotations

import os
import pickle
import socket
import sys
import traceback
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from uwbbench.run.crew.messages import GAVE, RAISED, packed, receive, send


@dataclass(frozen=True)
class Surroundings:
    """What a worker takes over from the process that it works for.

    Attributes
    ----------
    path : tuple of str
        Where modules are searched.
    environment : mapping
    folder : str
        The current one.
    memory_mb : float or None
        What it may allocate.
    """

    path: tuple[str, ...]
    environment: Mapping[str, str]
    folder: str
    memory_mb: float | None

    @classmethod
    def here(cls, memory_mb: float | None) -> Surroundings:
        """Those of this process."""
        return cls(tuple(sys.path), dict(os.environ), str(Path.cwd()), memory_mb)

    def take_over(self) -> None:
        """Make them those of this process."""
        sys.path[:] = self.path
        os.environ.clear()
        os.environ.update(self.environment)
        os.chdir(self.folder)
        if self.memory_mb is not None:
            import resource

            limit = int(self.memory_mb * 2**20)
            resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


@dataclass(frozen=True)
class Raised:
    """What a call raised.

    Attributes
    ----------
    reason : str
        In one line.
    traceback : str
    """

    reason: str
    traceback: str


def said_of(error: BaseException) -> Raised:
    """What is known of an exception, whose text may itself raise."""
    from uwbbench.run.plan import reason_of

    try:
        return Raised(reason_of(error), "".join(traceback.format_exception(error)))
    except BaseException as worse:  # noqa: BLE001 - a plugin's exception may do anything when it is shown
        named = type(error).__name__
        return Raised(f"{named}: its text raises {type(worse).__name__}", "")


def work(descriptor: int) -> NoReturn:
    """Carry out the calls that come over a socket; never returns into the process that it was forked from."""
    try:
        os.dup2(2, 1)  # what a plugin prints is no result of the run
        _carry_out(socket.socket(fileno=descriptor))
    finally:
        os._exit(0)


def _carry_out(channel: socket.socket) -> None:
    from uwbbench.run.unit import die_with

    die_with(os.getppid())
    first = receive(channel)
    if first is None:
        return
    surroundings: Surroundings = pickle.loads(first)  # noqa: S301 - of the run's own process
    surroundings.take_over()
    while (message := receive(channel)) is not None:
        function, arguments = pickle.loads(message)  # noqa: S301 - of the run's own process
        try:
            answer = GAVE + packed(function(*arguments))
        except BaseException as error:  # noqa: BLE001 - a plugin may raise anything
            answer = RAISED + packed(said_of(error))
        with suppress(BrokenPipeError):
            send(channel, answer)
