"""What a long command is doing, on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_EVERY_S = 10.0
"""Between two lines where stderr is no terminal."""


@contextmanager
def progress(quiet: bool, *, lines: bool = False) -> Iterator[Callable[[str], None]]:
    """Show what is being done: one line that changes on a terminal.

    Parameters
    ----------
    quiet : bool
        Show nothing.
    lines : bool
        Where stderr is no terminal, write a line now and then; otherwise nothing.

    Yields
    ------
    callable
        Takes what is being done.
    """
    if quiet or not (sys.stderr.isatty() or lines):
        yield lambda _: None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.markup import escape

        with Console(stderr=True).status("starting") as line:
            yield lambda text: line.update(escape(text))
    else:
        yield _Lines()


class _Lines:
    """A line of stderr every now and then."""

    def __init__(self) -> None:
        self.last = -_EVERY_S

    def __call__(self, text: str) -> None:
        now = time.monotonic()
        if now - self.last >= _EVERY_S:
            self.last = now
            sys.stderr.write(f"{text}\n")
            sys.stderr.flush()
