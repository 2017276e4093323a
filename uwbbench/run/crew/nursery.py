"""The process that workers are forked from: it has imported what all of them need, and has never run a plugin.

A fork takes some milliseconds where a new interpreter takes a second. What a worker changes in itself, it changes in
its own copy. The process itself is :mod:`uwbbench.run.crew.forking`.
"""

from __future__ import annotations

import atexit
import os
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Sequence

from uwbbench.api.errors import UwbbenchError

FORK, WAIT, KILL = b"F", b"W", b"K"
LIVED = 256
"""In place of the exit code of a worker that closed its line and lived on, until it was killed for that."""
LOST = 74
"""Exit code of a worker whose line was closed; that of an input or output error in sysexits.h."""
NUMBER = struct.Struct("<q")


class Nursery:
    """The nursery, as the process sees it that asks for workers.

    Raises
    ------
    UwbbenchError
        Where the operating system cannot fork.
    """

    def __init__(self) -> None:
        from uwbbench.measure.latency.launch import ONE_THREAD

        if not hasattr(os, "fork"):
            raise UwbbenchError(
                "processes of their own for detectors take a system that forks; use --no-isolation here"
            )
        self.owner = os.getpid()
        self._channel, theirs = socket.socketpair()
        with theirs:
            # -P: a file of the current folder is no module.
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                [sys.executable, "-P", "-m", "uwbbench.run.crew.forking", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=sys.__stderr__,
                pass_fds=[theirs.fileno()],
                env={**os.environ, **ONE_THREAD},
            )
        self._lock = threading.Lock()

    def fork(self) -> tuple[int, socket.socket]:
        """Process number of a new worker, and the socket to it."""
        ours, theirs = socket.socketpair()
        with theirs:
            return self._asked(FORK + bytes(NUMBER.size), [theirs.fileno()]), ours

    def wait(self, pid: int) -> int:
        """Exit code of a worker that has ended; the negative number of the signal that ended it, or :data:`LIVED`.

        Parameters
        ----------
        pid : int
            Its process number, which is free for others from then on.
        """
        return self._asked(WAIT + NUMBER.pack(pid))

    def kill(self, pid: int) -> None:
        """End a worker.

        Parameters
        ----------
        pid : int
            Its process number, which is free for others from then on.
        """
        self._asked(KILL + NUMBER.pack(pid))

    def _asked(self, request: bytes, descriptors: Sequence[int] = ()) -> int:
        with self._lock:
            answer = b""
            try:
                socket.send_fds(self._channel, [request], descriptors)
                answer = self._channel.recv(NUMBER.size, socket.MSG_WAITALL)
            except (BrokenPipeError, ConnectionResetError):
                self._channel.close()
            except BaseException:  # the user's interrupt, between question and answer: the next would get this answer
                self._channel.close()
                raise
        if len(answer) < NUMBER.size:
            raise UwbbenchError("the process that starts workers has ended; run again, with --resume for what is left")
        return int(NUMBER.unpack(answer)[0])

    @property
    def alive(self) -> bool:
        """Whether it can be asked, by this process."""
        return self.owner == os.getpid() and self._channel.fileno() >= 0 and self._process.poll() is None

    def close(self) -> None:
        """End it, and all workers with it."""
        if self.owner == os.getpid():
            self._channel.close()
            self._process.wait()


_kept: list[Nursery] = []


def nursery() -> Nursery:
    """The nursery of this process, started where there is none yet."""
    if not (_kept and _kept[0].alive):
        _kept[:] = [Nursery()]
        atexit.register(_kept[0].close)
    return _kept[0]
