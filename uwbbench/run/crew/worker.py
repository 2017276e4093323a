"""What a forked worker does: calls that it is sent, one after the other."""

from __future__ import annotations

import os
import pickle
import socket
import sys
import threading
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import cloudpickle

from uwbbench.api import registry
from uwbbench.api.errors import PluginError
from uwbbench.api.interruption import leave_to_parent
from uwbbench.run.crew.messages import GAVE, RAISED, packed, receive, send
from uwbbench.run.crew.nursery import LOST


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
    registered : bytes
        Classes that a script or notebook has registered, which may be of no module that others can import.
    """

    path: tuple[str, ...]
    environment: Mapping[str, str]
    folder: str
    memory_mb: float | None
    registered: bytes

    @classmethod
    def here(cls, memory_mb: float | None) -> Surroundings:
        """Those of this process.

        Parameters
        ----------
        memory_mb : float or None
            What a worker may allocate.

        Raises
        ------
        PluginError
            If a registered class cannot be given to another process.
        """
        classes = registry.registered()
        try:
            given = cloudpickle.dumps(classes)
        except Exception as error:
            names = ", ".join(f"'{name}'" for _, name in classes)
            raise PluginError(
                f"{names}, registered here alone, cannot be given to the workers of a run ({error}); make a package of "
                "it with 'uwbbench new', or run without isolation"
            ) from error
        return cls(tuple(sys.path), dict(os.environ), str(Path.cwd()), memory_mb, given)

    def take_over(self) -> None:
        """Make them those of this process."""
        sys.path[:] = self.path
        os.environ.clear()
        os.environ.update(self.environment)
        os.chdir(self.folder)
        registry.take_over(cloudpickle.loads(self.registered))
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
    code = LOST
    try:
        os.dup2(2, 1)  # what a plugin prints is no result of the run
        with socket.socket(fileno=descriptor) as channel:
            _carry_out(channel)
        code = 0
    finally:
        os._exit(code)


def _end_with(parent: int) -> None:
    """End this process, whatever it is at, when the one that it was forked from has ended, however that ended."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def _carry_out(channel: socket.socket) -> None:
    leave_to_parent()
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
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
        send(channel, answer)
