"""Process that workers are forked from: ``python -m uwbbench.run.crew.forking FD``, with a connected socket."""

from __future__ import annotations

import os
import signal
import socket
import sys
import time
from contextlib import suppress
from typing import NoReturn

from uwbbench.api.interruption import leave_to_parent
from uwbbench.run.crew.nursery import FORK, LIVED, NUMBER, WAIT

_PATIENCE_S = 1.0
"""In which a worker ends that has closed its line."""


def _prepare() -> None:
    """Import what every worker needs, none of it a plugin."""
    import numba  # noqa: F401
    import pandas  # noqa: F401
    import scipy.signal  # noqa: F401

    import uwbbench.run.unit  # noqa: F401


def _serve(channel: socket.socket) -> None:
    """Fork workers and wait for their ends, until the process that asks has ended."""
    workers: set[int] = set()
    with suppress(BrokenPipeError, ConnectionResetError):  # whoever asked does not wait for the answer any more
        _answer(channel, workers)
    for pid in workers:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def _answer(channel: socket.socket, workers: set[int]) -> None:
    from uwbbench.run.crew.worker import work

    while True:
        request, descriptors, _, _ = socket.recv_fds(channel, 1 + NUMBER.size, 1)
        if len(request) < 1 + NUMBER.size:
            return
        if request[:1] == FORK:
            pid = os.fork()
            if pid == 0:
                channel.close()
                work(descriptors[0])
            os.close(descriptors[0])
            workers.add(pid)
            channel.sendall(NUMBER.pack(pid))
        else:
            (pid,) = NUMBER.unpack(request[1:])
            code = _code_of(pid, _PATIENCE_S if request[:1] == WAIT else 0.0)
            workers.discard(pid)
            channel.sendall(NUMBER.pack(code))


def _code_of(pid: int, patience_s: float) -> int:
    """Exit code of a child, which is killed if it lives longer than that."""
    until = time.monotonic() + patience_s
    while True:
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() >= until:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            return LIVED
        time.sleep(0.002)


def main() -> NoReturn:
    """Serve the socket whose number is given."""
    leave_to_parent()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # that of a whole group is the parent's too, which ends all in order
    _prepare()
    with suppress(BrokenPipeError, ConnectionResetError):  # the run was interrupted, and listens no more
        _serve(socket.socket(fileno=int(sys.argv[1])))
    sys.exit(0)


if __name__ == "__main__":
    main()
