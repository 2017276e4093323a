"""Charts drawn by vl-convert, in a process of its own.

Its engine reserves tens of gigabytes of address space, and ends the process where it does not get them; that must not
be one that has results to write.
"""

from __future__ import annotations

import atexit
import importlib.util
import json
import os
import subprocess
import sys
from contextlib import suppress
from functools import lru_cache
from typing import Any

from uwbbench.show.drawer import LENGTH
from uwbbench.show.extras import ReportToolsError, report_tools


def svg(spec: dict[str, Any]) -> str:
    """SVG of a Vega-Lite chart.

    Raises
    ------
    ReportToolsError
        If vl-convert is not installed, or cannot draw here.
    """
    return _asked("svg", spec).decode()


def png(drawn: str) -> bytes:
    """PNG, at twice the size, of an SVG; raises as :func:`svg` does."""
    return _asked("png", drawn)


@lru_cache(maxsize=1)
def script() -> str:
    """Script that draws charts in a browser; raises as :func:`svg` does."""
    return _asked("script", None).decode()


_running: list[subprocess.Popen[bytes]] = []


def _drawer() -> subprocess.Popen[bytes]:
    if not (_running and _running[0].poll() is None and _owner == [os.getpid()]):
        with report_tools():
            if importlib.util.find_spec("vl_convert") is None:
                raise ImportError("vl_convert")
        # -P: a file of the current folder is no module.
        command = [sys.executable, "-P", "-m", "uwbbench.show.drawer"]
        pipe, quiet = subprocess.PIPE, subprocess.DEVNULL
        _running[:] = [subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=quiet)]  # noqa: S603 - our own module
        _owner[:] = [os.getpid()]
        atexit.register(_end, _running[0])
    return _running[0]


_owner: list[int] = []


def _asked(what: str, value: Any) -> bytes:
    drawer = _drawer()
    assert drawer.stdin is not None and drawer.stdout is not None  # noqa: S101, PT018 - both are pipes
    try:
        drawer.stdin.write(json.dumps([what, value]).encode() + b"\n")
        drawer.stdin.flush()
    except BrokenPipeError:
        _fail(drawer)
    head = drawer.stdout.read(LENGTH.size)
    if len(head) < LENGTH.size:
        _fail(drawer)
    (size,) = LENGTH.unpack(head)
    answer = drawer.stdout.read(size)
    if len(answer) < size:
        _fail(drawer)
    return answer


def _fail(drawer: subprocess.Popen[bytes]) -> None:
    code = drawer.wait()
    _running.clear()
    how = f"signal {-code}" if code < 0 else f"exit code {code}"
    raise ReportToolsError(
        f"charts cannot be drawn here: their engine ended ({how}), as where address space is limited ('ulimit -v')"
    )


def _end(drawer: subprocess.Popen[bytes]) -> None:
    with suppress(BrokenPipeError):
        if drawer.stdin is not None:
            drawer.stdin.close()
    drawer.wait()
