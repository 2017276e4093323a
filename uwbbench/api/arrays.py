"""Names for the array types that travel between stages."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

A = TypeVar("A")


def locked(values: A) -> A:
    """View of an array that cannot be written to, for whoever shares it; anything else is returned as it is.

    Examples
    --------
    >>> own = np.zeros(2)
    >>> locked(own).flags.writeable, own.flags.writeable
    (False, True)
    """
    if not isinstance(values, np.ndarray) or not values.flags.writeable:
        return values
    view = values.view()
    view.flags.writeable = False
    return view


def lock_fields(record: object, names: Iterable[str]) -> None:
    """Put read-only views in place of arrays that a frozen dataclass was made with; to be called when it is made.

    Parameters
    ----------
    record : object
        A frozen dataclass.
    names : iterable of str
        Fields that may hold arrays.
    """
    for name in names:
        object.__setattr__(record, name, locked(getattr(record, name)))
