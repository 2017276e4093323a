"""Work on a file that nobody vouches for, in a child process that has little time and memory.

The libraries that read HDF5 and MATLAB files can crash, hang, or ask for all memory over damaged bytes. What they do to
a child is one message here.

Conventions
-----------
* The child is a fork: it starts in milliseconds, and what it does this process would do in the same way, on the same
  bytes and from the same state. On systems other than Linux, where a fork of a process with threads is not safe, the
  work is done here, without protection.
* A file is examined once in a process, as long as size, times and inode stay what they are. Those that this process has
  written need no examination.
* The environment variable ``UWBBENCH_TRUST_FILES=1`` says that all files are to be trusted: nothing is forked.
"""

from __future__ import annotations

import faulthandler
import gc
import math
import os
import pickle
import select
import signal
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Never, TypeVar

from uwbbench.api.errors import CaptureError

T = TypeVar("T")
VARIABLE = "UWBBENCH_TRUST_FILES"
LEAST_S, BYTES_A_SECOND = 10.0, 20e6
"""A child may compute for so long over a small file; a larger one gives it the time to be read so slowly."""
WAITING = 2.5
"""It may take so many times as long by the clock, as it need not be alone on the machine."""
MOST_BYTES = 4 << 30
"""Memory that a child may ask for on top of what it starts with."""
_examined: dict[tuple[Any, ...], str] = {}
"""What was found out about each file: nothing, or why it is not to be opened."""

_inside = False
"""Whether this is such a child, which needs no other."""


def examine(path: Path, work: Callable[[], object]) -> None:
    """Do something in a child to see whether it can be done here.

    Parameters
    ----------
    path : Path
        The file that it is done to.
    work : callable
        What this process is going to do. Errors that it raises are not of interest: it will raise them here.

    Raises
    ------
    CaptureError
        If the child crashed, or needed too much time or memory.
    """
    mark = _mark(path)
    if mark not in _examined:
        try:
            in_child(path, lambda: _done(work))
        except CaptureError as error:
            _examined[mark] = str(error)
        else:
            _examined[mark] = ""
    if _examined[mark]:
        raise CaptureError(_examined[mark])


def trust(path: Path) -> None:
    """Note that this process wrote a file, so that it need not be examined."""
    _examined[_mark(path)] = ""


def in_child(path: Path, work: Callable[[], T], least_s: float | None = None) -> T:
    """Result of some work on a file, done in a child.

    Parameters
    ----------
    path : Path
        For messages, and for the time that the child is given.
    work : callable
        What it returns, and the errors that it raises, are pickled.
    least_s : float, optional
        Time that it may compute for, over a small file; :data:`LEAST_S` if left out.

    Raises
    ------
    CaptureError
        If the child crashed, or needed too much time or memory.
    Exception
        What the work raised.
    """
    if sys.platform != "linux" or _inside or os.environ.get(VARIABLE) == "1":
        return work()
    limit_s = (LEAST_S if least_s is None else least_s) + path.stat().st_size / BYTES_A_SECOND
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # forks beside threads: the child needs no lock of theirs
        child = os.fork()
    if child == 0:
        _child(path, work, writing, limit_s)
    os.close(writing)
    answer = None
    try:
        answer = _heard(reading, WAITING * limit_s)
    finally:
        os.close(reading)
        if answer is None:  # its time is over, or the user has interrupted
            os.kill(child, signal.SIGKILL)
        ended = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if answer is None or -ended in (signal.SIGXCPU, signal.SIGALRM):
        raise CaptureError(f"{path}: damaged: reading it was given up after {limit_s:.0f} s")
    if ended != 0:
        how = signal.Signals(-ended).name if ended < 0 else f"exit code {ended}"
        raise CaptureError(f"{path}: damaged: the library that reads it crashed over it ({how})")
    fine, value = pickle.loads(answer)  # noqa: S301  # from a child of our own
    if not fine:
        raise value
    result: T = value
    return result


def _mark(path: Path) -> tuple[Any, ...]:
    """What changes with a file."""
    facts = path.stat()
    return (str(path), facts.st_dev, facts.st_ino, facts.st_size, facts.st_mtime_ns, facts.st_ctime_ns)


def _done(work: Callable[[], object]) -> None:
    """Do the work, and keep its errors to oneself, but for that of too little memory."""
    try:
        work()
    except MemoryError:
        raise
    except Exception:  # noqa: BLE001, S110  # the parent will meet it
        pass


def _heard(reading: int, limit_s: float) -> bytes | None:
    """All that a child says; nothing if it dies, None if it is still at work when its time is over."""
    end_s = time.monotonic() + limit_s
    parts: list[bytes] = []
    while True:
        left_s = end_s - time.monotonic()
        if left_s <= 0 or not select.select([reading], [], [], left_s)[0]:
            return None
        part = os.read(reading, 1 << 20)
        if not part:
            return b"".join(parts)
        parts.append(part)


def _child(path: Path, work: Callable[[], object], writing: int, limit_s: float) -> Never:
    """Do the work, say what it gave, and end, whatever happens."""
    status = 1
    try:
        _confine(limit_s)
        try:
            said: tuple[bool, object] = (True, work())
        except MemoryError:
            said = (False, CaptureError(f"{path}: damaged: reading it takes more than {MOST_BYTES >> 30} GB of memory"))
        except BaseException as error:  # noqa: BLE001  # raised again in the parent
            said = (False, error)
        with os.fdopen(writing, "wb") as pipe:
            pipe.write(_pickled(path, said))
        status = 0
    finally:
        os._exit(status)


def _pickled(path: Path, said: tuple[bool, object]) -> bytes:
    """What the child says; an error that cannot be sent as it is becomes one that can."""
    try:
        answer = pickle.dumps(said, protocol=pickle.HIGHEST_PROTOCOL)
        if not said[0]:
            pickle.loads(answer)  # noqa: S301  # some errors want more than their text to be made again
    except Exception:  # noqa: BLE001
        return pickle.dumps((False, CaptureError(f"{path}: {type(said[1]).__name__}: {said[1]}")))
    return answer


def _confine(limit_s: float) -> None:
    """Leave signals to the parent, print nothing, and bound the rest of this process."""
    import resource

    global _inside
    _inside = True

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(math.ceil(WAITING * limit_s) + 1)  # should the parent be killed
    faulthandler.disable()
    gc.disable()  # collecting would close files of the parent
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _bound(resource.RLIMIT_CPU, math.ceil(time.process_time() + limit_s))
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    _bound(resource.RLIMIT_AS, pages * os.sysconf("SC_PAGE_SIZE") + MOST_BYTES)


def _bound(what: int, most: int) -> None:
    """Lower a limit of this process."""
    import resource

    soft, hard = resource.getrlimit(what)
    given = [limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(what, (min([most, *given]), hard))
