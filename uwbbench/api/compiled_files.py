"""Files of machine code, kept from one process to the next.

Compiled functions are kept beside their source, in ``__pycache__``, where that can be written, else in
``uwbbench/compiled`` in the user's cache folder; both are read. The environment variable ``UWBBENCH_CACHE_DIR`` names
one folder that is used instead. Where none can be written, functions are compiled in memory, in each process anew.

One file holds one function for one combination of argument types, processor, and versions of Python, numpy and numba.
Its name carries two hashes, of all that the function was made from and of its argument types, as
:mod:`uwbbench.api.compiled_origin` says. Files appear whole or not at all and are never changed, so that any number of
processes may start at once; a file that is damaged is noticed by its checksum and made again.

The files are pickled machine code, as numba writes them: whoever can write to the folder decides what is executed. A
folder is therefore used only if it belongs to this user, to root or to the owner of the source, and nobody else can
write to it; one that is missing is made so. Both hold when a file is read or written, and for the file itself: what was
safe, or missing, when the program started need not be so now. The private group that some systems give to each user is
the user.
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
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

from uwbbench.api.compiled_origin import origin_of_function, origin_of_types
from uwbbench.api.errors import ConfigError
from uwbbench.api.numba_internals import MachineCode, pickled

VARIABLE = "UWBBENCH_CACHE_DIR"
_DIGEST_BYTES = hashlib.sha256().digest_size
_log = logging.getLogger("uwbbench")
_warned: set[str] = set()


class CompiledFiles(MachineCode):
    """The files of one function.

    Parameters
    ----------
    function : callable
    options : dict
        How it is compiled.

    Raises
    ------
    ConfigError
        If the folder that the environment names is not safe.
    """

    def __init__(self, function: Callable[..., object], options: dict[str, Any]) -> None:
        self._function = function
        self._options = options
        self._source = Path(inspect.getfile(function))
        self._folders = folders_of(self._source)
        name = f"{function.__module__}.{function.__qualname__}".replace("<", "").replace(">", "")
        self._stem = f"{name}.{sys.implementation.cache_tag}-"

    @cached_property
    def _stamp(self) -> str:
        return origin_of_function(self._function, self._options)

    def _name(self, key: object) -> str:
        return f"{self._stem}{self._stamp}-{origin_of_types(key)}.kernel"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Compiled function for these argument types, or None."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # noqa: BLE001  # whatever is wrong with what was kept, it can be compiled again
            name = self._function.__qualname__
            _warn_once(f"kept machine code of {name} cannot be used ({error!r}) and is compiled again")
            return None

    def refuse(self, reason: str) -> None:
        """Say that machine code is not kept."""
        _warn_once(f"machine code of {self._function.__qualname__} is not kept, as {reason}")

    def load(self, key: tuple[Any, ...]) -> Any:
        """Entry of a key, or None."""
        for folder in self._folders:
            path = folder / self._name(key)
            try:
                content = _safe_content(path, self._source)
            except PermissionError as error:
                _warn_once(f"{error}: machine code in it is not used")
                continue
            except OSError:  # not there, or not for us
                continue
            digest, data = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
            if hashlib.sha256(data).digest() != digest:
                _warn_once(f"{path} is damaged, and made again")
                continue
            stored_key, entry = pickle.loads(data)  # noqa: S301  # from a folder that was found safe
            if stored_key == key:
                return entry
        return None

    def save(self, key: tuple[Any, ...], entry: object) -> None:
        """Keep an entry, in the first folder that can be written."""
        data = pickled((key, entry))
        problems = []
        for folder in self._folders:
            path = folder / self._name(key)
            partial = path.with_suffix(f".{uuid.uuid4().hex}.part")
            try:
                _make(folder)
                _refuse_open(folder, folder.stat(), self._source)
                partial.touch(mode=0o644, exist_ok=False)  # whatever the umask, nobody else may change it
                partial.write_bytes(hashlib.sha256(data).digest() + data)
                partial.replace(path)
            except OSError as error:
                problems.append(f"{folder} ({error.strerror or error})")
            else:
                self._remove(folder, stale=True)
                return
            finally:
                with contextlib.suppress(OSError):
                    partial.unlink(missing_ok=True)
        where = " and ".join(problems) or "no safe folder"
        _warn_once(f"machine code is not kept, as {where} cannot be written; set {VARIABLE} to a folder that can")

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


def _warn_once(text: str) -> None:
    """Log a warning, once in a process."""
    if text not in _warned:
        _warned.add(text)
        _log.warning("%s", text)


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
                f"{VARIABLE}: {folder} belongs to another user, or others can write to it; its files are executed, "
                "so name a folder of your own, that you alone can write to"
            )
        return (folder,)
    folders = [source.parent / "__pycache__"]
    with contextlib.suppress(RuntimeError):  # a user without a home
        folders.append(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "uwbbench" / "compiled")
    return tuple(folder for folder in folders if _safe(folder, source))


def _safe(folder: Path, source: Path) -> bool:
    """Whether nobody but this user, root and the owner of the source can put files into a folder."""
    try:
        _refuse_open(folder, folder.stat(), source)
    except PermissionError:
        return False
    except OSError:  # not there yet, or closed to us: nothing is read from it
        return True
    return True


def _safe_content(path: Path, source: Path) -> bytes:
    """Content of a file that nobody but these can have written, in a folder that nobody but these can write to.

    Raises
    ------
    PermissionError
        If others can.
    OSError
        If it cannot be read.
    """
    if not hasattr(os, "getuid"):
        return path.read_bytes()
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        _refuse_open(path.parent, os.fstat(folder), source)
        with open(os.open(path.name, os.O_RDONLY | os.O_NOFOLLOW, dir_fd=folder), "rb") as file:  # noqa: PTH123
            _refuse_open(path, os.fstat(file.fileno()), source)
            return file.read()
    finally:
        os.close(folder)


def _refuse_open(path: Path, facts: os.stat_result, source: Path) -> None:
    """Refuse a file or folder that others than this user, root and the owner of the source can write to.

    Raises
    ------
    PermissionError
        If they can.
    """
    if not hasattr(os, "getuid"):
        return
    theirs = facts.st_uid not in (0, os.getuid(), source.stat().st_uid)
    of_group = facts.st_mode & stat.S_IWGRP and not _private(facts.st_gid)
    if theirs or of_group or facts.st_mode & stat.S_IWOTH:
        raise PermissionError(f"{path} belongs to another user, or others can write to it")


def _private(group: int) -> bool:
    """Whether a group is the one that a system makes for this user alone: of the same name, and without members."""
    import grp
    import pwd

    try:
        user, members = pwd.getpwuid(os.getuid()), grp.getgrgid(group)
    except KeyError:  # of no name here
        return False
    return user.pw_gid == group and user.pw_name == members.gr_name and set(members.gr_mem) <= {user.pw_name}


def _make(folder: Path) -> None:
    """Make a folder, and those above it that are missing, that this user alone can write to, whatever the umask."""
    if not folder.is_dir():
        _make(folder.parent)
        folder.mkdir(mode=0o755, exist_ok=True)
