"""Compiling the inner loops of a stage to machine code, once for all processes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile a function of numbers and arrays when it is first called, and keep the machine code on disk.

    The interpreter lock is released while the function runs. A division by zero gives infinity or NaN, as in numpy.
    Operations are never reordered or contracted, so that results equal those of numpy to the last bit, and denormal
    numbers and NaN keep their meaning.

    Put functions that use this into a module of their own and import it where it is first needed: numba takes longer
    to import than all that listing and describing stages needs.

    Parameters
    ----------
    function : callable
        Written in the part of Python that numba compiles.

    Returns
    -------
    callable
    """
    return cast("F", numba.njit(cache=True, nogil=True, error_model="numpy")(function))
