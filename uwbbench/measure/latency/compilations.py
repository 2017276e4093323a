"""Noticing that code was compiled during a measurement."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import TracebackType
from typing import Any, TypeVar

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
        self._listener: Any = None

    def __enter__(self) -> Compilations:
        if "numba" in sys.modules:
            self._listener = _listener(self)
            _events().register(_LOCKED, self._listener)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._listener is not None:
            _events().unregister(_LOCKED, self._listener)
        elif "numba" in sys.modules:
            self.count += 1


_LOCKED = "numba:compiler_lock"
"""Event of whoever takes the compiler's lock: to compile a function for new types, or to load what is cached."""


def _events() -> Any:
    import numba.core.event

    return numba.core.event


def _listener(watch: Compilations) -> Any:
    """Listener of numba's events; its base class can only be had once numba is there."""

    class Counting(_events().Listener):  # type: ignore[misc]  # numba is untyped
        def on_start(self, event: object) -> None:  # noqa: ARG002 - the base class names it
            watch.count += 1

        def on_end(self, event: object) -> None:
            pass

    return Counting()


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
