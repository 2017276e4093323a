"""What machine code was made from, as a hash.

To the machine code of a function belongs all that its names meant when it was compiled: the functions that it calls,
under the names that it calls them by, and those that they call; constants and arrays; the classes of its arguments,
whose fields are places in memory to it and no longer names. Each is identified by what it is in this process, and by
the file it was written in, so that also decorators and whatever else stands there count. Python, numpy and numba
itself are identified by their versions.
"""

from __future__ import annotations

import hashlib
import inspect
import io
import pickle
import re
from collections.abc import Callable, Iterator
from enum import EnumMeta
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.extending import is_jitted

from uwbbench.api.numba_internals import options_of

_GIVEN = {"builtins", "copyreg", "math", "cmath", "numba", "numpy", "llvmlite"}
"""Packages whose code a version identifies; not all of the standard library, whose names another module may have."""
_VERSIONS = f"numba {numba.__version__}, numpy {np.__version__}"  # that of Python is in the names of files


def origin_of_function(function: Callable[..., object], options: dict[str, Any]) -> str:
    """Hash of a function and of all that it reaches by name.

    Asked for when the function is first called, as what it calls may be defined behind it.

    Parameters
    ----------
    function : callable
        As written, not yet compiled.
    options : dict
        How it is compiled.

    Returns
    -------
    str
        16 hexadecimal digits.
    """
    return _hashed(_VERSIONS, sorted(options.items()), function)


def origin_of_types(types: object) -> str:
    """Hash of argument types, and of the classes among them: of named tuples, alone or within others, and of enums.

    Parameters
    ----------
    types : object
        As numba names them, with whatever belongs to them.

    Returns
    -------
    str
        16 hexadecimal digits.
    """
    return _hashed(types, *_origins(types))


def _hashed(*values: object) -> str:
    digest = hashlib.sha256()
    seen: dict[object, int] = {}
    for value in values:
        for part in _described(value, seen):
            digest.update(hashlib.sha256(part).digest())
    return digest.hexdigest()[:16]


def _origins(types: object) -> list[object]:
    """Classes and functions that argument types hold anywhere, in order: those that a pickle refers to."""
    origins: dict[object, None] = {}

    class Pickler(pickle.Pickler):
        def reducer_override(self, part: Any) -> Any:
            if not isinstance(part, type | FunctionType) or _is_given(part):
                return NotImplemented
            origins[part] = None
            return str, ()  # nobody reads this pickle

    Pickler(io.BytesIO()).dump(types)
    return list(origins)


def _is_given(value: object) -> bool:
    """Whether the version of Python, numpy or numba identifies a value."""
    name = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
    return isinstance(name, str) and name.partition(".")[0] in _GIVEN


def _described(value: Any, seen: dict[object, int]) -> Iterator[bytes]:
    """All that a value means to the compiler; what came before, by its number."""
    if isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape}".encode() + value.tobytes()
    elif isinstance(value, tuple):
        yield f"tuple {len(value)}".encode()
        yield from _described(type(value), seen)
        for part in value:
            yield from _described(part, seen)
    elif not (isinstance(value, type | FunctionType) or hasattr(value, "__wrapped__")):
        yield re.sub(" at 0x[0-9a-f]+", "", f"{type(value)} {value!r}").encode()
    elif id(value) in seen:
        yield f"number {seen[id(value)]}".encode()
    else:
        seen[id(value)] = len(seen)
        yield f"{value.__module__}.{value.__qualname__}".encode()
        if not _is_given(value):
            yield from _defined(value, seen)


def _defined(value: Any, seen: dict[object, int]) -> Iterator[bytes]:
    """How a class or function is defined."""
    yield from _source(value, seen)
    if isinstance(value, EnumMeta):
        yield repr(list(value)).encode()
    elif isinstance(value, type):
        yield from _described(getattr(value, "_fields", ()), seen)
        yield from _described(tuple(getattr(value, "_field_defaults", {}).items()), seen)
    elif isinstance(value, FunctionType):
        yield from _coded(value.__code__)
        yield from _described(value.__defaults__ or (), seen)
        for name, meant in _read_by(value):
            yield name.encode()
            yield from _described(meant, seen)
    else:  # compiled, or made for compiled code
        yield repr(sorted(options_of(value).items()) if is_jitted(value) else type(value)).encode()
        yield from _described(value.__wrapped__, seen)


def _source(value: Any, seen: dict[object, int]) -> Iterator[bytes]:
    """File that a class or function was written in; empty if there is none."""
    try:
        path = inspect.getfile(inspect.unwrap(value))
        if path not in seen:
            seen[path] = len(seen)
            yield Path(path).read_bytes()
        yield f"file {seen[path]}".encode()
    except (TypeError, OSError):  # a class, or text, that was made as the program ran
        yield b""


def _coded(code: CodeType) -> Iterator[bytes]:
    """What a function does: its file may have changed since it was read."""
    yield code.co_code
    yield repr((code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)).encode()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _coded(constant)
        else:
            yield repr(sorted(constant) if isinstance(constant, frozenset) else constant).encode()


def _read_by(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Names outside a function that its code reads, and what they mean."""
    names = sorted(set(_names(function.__code__)))
    seen: set[ModuleType] = set()
    pending = [(name, function.__globals__[name]) for name in names if name in function.__globals__]
    while pending:
        name, meant = pending.pop()
        yield name, meant.__name__ if isinstance(meant, ModuleType) else meant
        if isinstance(meant, ModuleType) and not _is_given(meant) and meant not in seen:
            seen.add(meant)
            pending.extend((f"{name}.{part}", getattr(meant, part)) for part in names if hasattr(meant, part))
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)
