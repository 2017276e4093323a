"""Compiling the inner loops of a stage to machine code, once for all processes."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.extending import is_jitted

from uwbbench.api.compiled_files import CompiledFiles
from uwbbench.api.numba_internals import CompileCounts, counts_of, keep

F = TypeVar("F", bound=Callable[..., object])

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
_functions: list[Any] = []


def compiled(function: F) -> F:
    """Compile a function of numbers and arrays when it is first called, and keep the machine code on disk.

    The interpreter lock is released while the function runs. A division by zero gives infinity or NaN, as in numpy.
    Operations are never reordered or contracted, so that results equal those of numpy to the last bit, and denormal
    numbers and NaN keep their meaning. Where the machine code is kept, :mod:`uwbbench.api.compiled_files` says.

    Put functions that use this into a module of their own and import it where it is first needed: numba takes longer
    to import than all that listing and describing stages needs.

    Parameters
    ----------
    function : callable
        Written in the part of Python that numba compiles.

    Returns
    -------
    callable

    Raises
    ------
    ConfigError
        If ``UWBBENCH_CACHE_DIR`` names a folder that everyone can write to, or that belongs to another user.
    """
    return _compiled(function, _OPTIONS)


def inlined(function: F) -> F:
    """Compile a function, as :func:`compiled` does, into each function that calls it.

    A call of its own counts up, and down again, the references to every array that it hands over, by operations that
    lock the memory. For functions that are called for every frame from one place.

    Parameters
    ----------
    function : callable
        Written in the part of Python that numba compiles.

    Returns
    -------
    callable
    """
    return _compiled(function, {**_OPTIONS, "forceinline": True})


def _compiled(function: F, options: dict[str, Any]) -> F:
    decorate: Any = numba.njit(**options)
    dispatcher = decorate(function)
    if is_jitted(dispatcher):  # numba hands the function itself back where compiling is switched off
        _functions.append(dispatcher)
        if Path(inspect.getfile(function)).is_file():  # what was typed at a prompt has no file to compare with
            keep(dispatcher, CompiledFiles(function, options))
    return cast("F", dispatcher)


def compile_counts() -> CompileCounts:
    """Count what this process has compiled, and what it has loaded, so far."""
    counts = [counts_of(function) for function in _functions]
    return CompileCounts(fresh=sum(count.fresh for count in counts), loaded=sum(count.loaded for count in counts))
