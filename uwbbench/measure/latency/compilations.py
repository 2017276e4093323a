"""Noticing that code was compiled during a measurement."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TypeVar

Result = TypeVar("Result")


class Compilations:
    """Counts how often numba compiled code, or loaded it from its cache, while this context was open.

    Attributes
    ----------
    count : int
        Complete once the context is left. Importing numba inside counts as well.
    """

    def __init__(self) -> None:
        self.count = 0
        self._watching: AbstractContextManager[None] | None = None

    def __enter__(self) -> Compilations:
        if "numba" in sys.modules:
            from uwbbench.api.numba_internals import on_compiling

            self._watching = on_compiling(self._notice)
            self._watching.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._watching is not None:
            self._watching.__exit__(kind, error, trace)
        elif "numba" in sys.modules:
            self._notice()

    def _notice(self) -> None:
        self.count += 1


def undisturbed(measured: Callable[[], Result], tries: int = 3) -> tuple[Result, int]:
    """Measure, and measure again if anything was compiled meanwhile: its time would be in a sample.

    Parameters
    ----------
    measured : callable
        Makes a whole measurement.
    tries : int

    Returns
    -------
    result
        Of the last try.
    compilations : int
        In that try: 0, unless each try compiled something.
    """
    for _ in range(tries):
        with Compilations() as watch:
            result = measured()
        if watch.count == 0:
            break
    return result, watch.count
