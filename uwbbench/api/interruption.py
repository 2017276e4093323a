"""Whose wish it is that the program ends: the user's, or that of a plugin that knows no better.

A plugin may raise anything, ``SystemExit`` and ``KeyboardInterrupt`` included. What the user wishes is known from the
signals of the operating system; a plugin that sends one to its own process is taken for the user.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_heard: list[bool] = []
"""Innermost last, for each place that listens: whether the user has asked."""


@contextmanager
def listening() -> Iterator[None]:
    """Raise ``KeyboardInterrupt`` where the user presses the interrupt key or asks the process to terminate.

    Outside the main thread, which no signal reaches, nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def asked(_signal: int, _frame: object) -> None:
        _heard[-1] = True
        raise KeyboardInterrupt

    before = {number: signal.signal(number, asked) for number in (signal.SIGINT, signal.SIGTERM)}
    _heard.append(False)
    try:
        yield
    finally:
        _heard.pop()
        for number, handler in before.items():
            signal.signal(number, handler)


def leave_to_parent() -> None:
    """Leave the interrupt key to the parent process, for the rest of this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _heard[:] = [False]


def by_plugin(error: BaseException) -> bool:
    """Whether what was raised is a fault of the plugin that was called, and no wish of the user.

    Where nobody listens, ``KeyboardInterrupt`` is taken for the user's.

    Parameters
    ----------
    error : BaseException
        What came out of the call of a plugin.

    Examples
    --------
    >>> by_plugin(SystemExit(0)), by_plugin(KeyboardInterrupt())
    (True, False)
    """
    if not isinstance(error, KeyboardInterrupt):
        return True
    return bool(_heard) and not _heard[-1]
