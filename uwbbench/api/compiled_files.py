"""Files of machine code, kept from one process to the next.

Compiled functions are kept beside their source, in ``__pycache__``, where that can be written, else in
``uwbbench/compiled`` in the user's cache folder; both are read. The environment variable ``UWBBENCH_CACHE_DIR`` names
one folder that is used instead. Where none can be written, functions are compiled in memory, in each process anew.

One file holds one function for one combination of argument types, processor, and version of Python and numba. Its name
carries a hash of the sources it was made from: its own, those of the compiled functions that it calls, and the
constants that it reads. Files appear whole or not at all and are never changed, so that any number of processes may
start at once; a file that is damaged is noticed by its checksum and made again.

The files are pickled machine code, as numba writes them: whoever can write to the folder decides what is executed. A
folder is therefore used only if it belongs to this user, to root or to the owner of the source, and not everyone can
write to it.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import logging
import os
import pickle
import stat
import sys
import uuid
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from types import CodeType
from typing import Any

import numba
import numpy as np
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.extending import _Intrinsic
from numba.core.serialize import dumps
from numba.extending import is_jitted

from uwbbench.api.errors import ConfigError

VARIABLE = "UWBBENCH_CACHE_DIR"
_DIGEST_BYTES = hashlib.sha256().digest_size
_log = logging.getLogger("uwbbench")
_told: set[str] = set()


class _Locator(_CacheLocator):
    """Tells numba nothing but the first folder: which are used, and what makes a file stale, is decided here."""

    def __init__(self, source: str) -> None:
        self._py_file = source

    def get_cache_path(self) -> str:
        folders = folders_of(Path(self._py_file))
        return str(folders[0]) if folders else ""

    def ensure_cache_path(self) -> None:
        """Nothing: a folder is made when the first file is written."""

    def get_source_stamp(self) -> None:
        """Nothing: the stamp is part of the name of each file."""

    def get_disambiguator(self) -> str:
        return ""

    @classmethod
    def from_function(cls, function: Callable[..., object], source: str) -> _Locator:  # noqa: ARG003
        return cls(source)


class _Code(CompileResultCacheImpl):
    _locator_classes: list[Any] = [_Locator]  # noqa: RUF012  # as numba declares it


class CompiledFiles(FunctionCache):
    """The files of one function, as numba asks for them.

    Parameters
    ----------
    function : callable
    options : mapping
        How it is compiled.

    Raises
    ------
    ConfigError
        If the folder that the environment names is not safe.
    """

    _impl_class = _Code

    def __init__(self, function: Callable[..., object], options: Mapping[str, object]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._cache_file: Any = _Files(function, options)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Compiled function for these argument types, or None."""
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception as error:  # noqa: BLE001  # whatever is wrong with what was kept, it can be compiled again
            _tell(f"kept machine code of {self._py_func.__qualname__} cannot be used ({error!r}) and is compiled again")
            return None


class _Files:
    """Saving, loading and removing, each entry a file."""

    def __init__(self, function: Callable[..., object], options: Mapping[str, object]) -> None:
        self._function = function
        self._options = options
        self._folders = folders_of(Path(inspect.getfile(function)))
        name = f"{function.__module__}.{function.__qualname__}".replace("<", "").replace(">", "")
        self._stem = f"{name}.{sys.implementation.cache_tag}-"

    @cached_property
    def _stamp(self) -> str:
        """Hash of all that the machine code depends on; asked for late, when all callees are defined."""
        digest = hashlib.sha256(repr([numba.__version__, sorted(self._options.items())]).encode())
        for part in sorted(_origins(self._function)):
            digest.update(hashlib.sha256(part).digest())
        return digest.hexdigest()[:16]

    def _name(self, key: object) -> str:
        return f"{self._stem}{self._stamp}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.kernel"

    def load(self, key: object) -> Any:
        """Entry of a key, or None."""
        for folder in self._folders:
            path = folder / self._name(key)
            try:
                content = path.read_bytes()
            except OSError:  # not there, or not for us
                continue
            digest, data = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
            if hashlib.sha256(data).digest() != digest:
                _tell(f"{path} is damaged, and made again")
                continue
            found, entry = pickle.loads(data)  # noqa: S301  # from a folder that was found safe
            if found == key:
                return entry
        return None

    def save(self, key: object, entry: object) -> None:
        """Keep an entry, in the first folder that can be written."""
        data: bytes = dumps((key, entry))  # type: ignore[no-untyped-call]
        problems = []
        for folder in self._folders:
            path = folder / self._name(key)
            partial = path.with_suffix(f".{uuid.uuid4().hex}.part")
            try:
                folder.mkdir(mode=0o755, parents=True, exist_ok=True)
                partial.touch(mode=0o644, exist_ok=False)  # whatever the umask, nobody else may change it
                partial.write_bytes(hashlib.sha256(data).digest() + data)
                partial.replace(path)
            except OSError as error:
                problems.append(f"{folder} ({error.strerror})")
            else:
                self._remove(folder, stale=True)
                return
            finally:
                with contextlib.suppress(OSError):
                    partial.unlink(missing_ok=True)
        where = " and ".join(problems) or "no safe folder"
        _tell(f"machine code is not kept, as {where} cannot be written; set {VARIABLE} to a folder that can")

    def flush(self) -> None:
        """Forget all entries of this function."""
        for folder in self._folders:
            self._remove(folder, stale=False)

    def _remove(self, folder: Path, *, stale: bool) -> None:
        """Remove this function's entries; the stale ones alone are those of other sources."""
        for path in folder.glob(f"{self._stem}*.kernel"):
            if not (stale and path.name.startswith(self._stem + self._stamp)):
                with contextlib.suppress(OSError):  # another process was faster, or it is not ours
                    path.unlink()


def _tell(text: str) -> None:
    """Log a warning, once in a process."""
    if text not in _told:
        _told.add(text)
        _log.warning("%s", text)


def _origins(function: Callable[..., object]) -> set[bytes]:
    """Sources of a function and of all compiled functions that it reaches, and the constants that they read."""
    found: set[bytes] = set()
    pending: list[Any] = [function]
    seen: set[int] = set()
    while pending:
        here = pending.pop()
        if id(here) in seen:
            continue
        seen.add(id(here))
        found.add(Path(inspect.getfile(here)).read_bytes())
        for name, value in _read_by(here):
            if is_jitted(value):
                pending.append(value.py_func)
            elif isinstance(value, _Intrinsic):
                found.add(Path(inspect.getfile(value._defn)).read_bytes())
            elif isinstance(value, np.ndarray):
                found.add(f"{name} {value.dtype} {value.shape} ".encode() + value.tobytes())
            elif isinstance(value, bool | int | float | complex | str | tuple | np.generic):
                found.add(f"{name} {value!r}".encode())
    return found


def _read_by(function: Any) -> Iterator[tuple[str, Any]]:
    """Names outside a function that its code reads, and their values."""
    names = set(_names(function.__code__))
    for name in names & function.__globals__.keys():
        value = function.__globals__[name]
        yield name, value
        if inspect.ismodule(value):
            yield from ((f"{name}.{part}", getattr(value, part)) for part in names if hasattr(value, part))
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def folders_of(source: Path) -> tuple[Path, ...]:
    """Folders that machine code of a source file is read from and, the first that can be, written to.

    Raises
    ------
    ConfigError
        If the folder that the environment names is not safe.
    """
    named = os.environ.get(VARIABLE)
    if named:
        folder = Path(named)
        if not _safe(folder, source):
            raise ConfigError(
                f"{VARIABLE}: {folder} belongs to another user, or everyone can write to it; its files are executed, "
                "so name a folder of your own"
            )
        return (folder,)
    folders = [source.parent / "__pycache__"]
    with contextlib.suppress(RuntimeError):  # a user without a home
        folders.append(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "uwbbench" / "compiled")
    return tuple(folder for folder in folders if _safe(folder, source))


def _safe(folder: Path, source: Path) -> bool:
    """Whether nobody but this user, root and the owner of the source can put files into a folder."""
    try:
        facts = folder.stat()
    except OSError:  # not there yet, or closed to us: nothing is read from it
        return True
    if not hasattr(os, "getuid"):
        return True
    return facts.st_uid in (0, os.getuid(), source.stat().st_uid) and not facts.st_mode & stat.S_IWOTH
