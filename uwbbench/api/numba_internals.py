"""All that uwbbench uses of numba beside its documented interface.

numba may change any of this from one version to the next; the upper bound in ``pyproject.toml`` is the newest one that
was tried. Nothing else imports from ``numba.core``, ``numba.np`` or their like.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.event import Listener, install_listener
from numba.core.serialize import dumps
from numba.np.unsafe.ndarray import to_fixed_tuple

_dumps: Any = dumps  # numba's functions are not typed
_rebuild: Any = CompileResult._rebuild

as_tuple: Any = to_fixed_tuple
"""``as_tuple(array, length)``: the first values of an array (n,) as a tuple, in compiled code; the length is fixed."""


class MachineCode(_Cache):
    """Where numba looks for a function's machine code before it compiles it, and leaves it afterwards.

    A subclass says where that is. A key names argument types and processor, not what the function does.
    """

    cache_path = ""

    @abstractmethod
    def load(self, key: tuple[Any, ...]) -> Any:
        """Entry of a key, or None."""

    @abstractmethod
    def save(self, key: tuple[Any, ...], entry: object) -> None:
        """Keep an entry."""

    @abstractmethod
    def refuse(self, reason: str) -> None:
        """Machine code that only this process can run is not kept."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Compiled function for these argument types, or None."""
        target_context.refresh()
        entry = self.load((sig, target_context.codegen().magic_tuple()))
        return None if entry is None else _rebuild(target_context, *entry)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled for these argument types."""
        if data.lifted:
            self.refuse("it leaves machine code for Python")
        elif data.library.has_dynamic_globals:
            self.refuse("it holds addresses, as of a large global array")
        else:
            self.save((sig, data.codegen.magic_tuple()), data._reduce())

    def enable(self) -> None:
        """Nothing: it always is."""

    def disable(self) -> None:
        """Nothing: it never is."""


def keep(dispatcher: Any, code: MachineCode) -> None:
    """Have a compiled function look for its machine code, and leave it, in one place."""
    dispatcher._cache = code


def pickled(entry: object) -> bytes:
    """Machine code and argument types as ``pickle.loads`` reads them."""
    return bytes(_dumps(entry))


def options_of(dispatcher: Any) -> dict[str, Any]:
    """How a function is compiled."""
    return dict(dispatcher.targetoptions)


class CompileCounts(NamedTuple):
    """How often functions were made ready to run in this process.

    Attributes
    ----------
    fresh : int
        Compiled here, once for each combination of argument types.
    loaded : int
        Read from disk.
    """

    fresh: int
    loaded: int


def counts_of(dispatcher: Any) -> CompileCounts:
    """How often one function was compiled, and loaded, so far."""
    stats = dispatcher.stats
    return CompileCounts(fresh=sum(stats.cache_misses.values()), loaded=sum(stats.cache_hits.values()))


@contextmanager
def on_compiling(notice: Callable[[], None]) -> Iterator[None]:
    """Call something whenever a function is compiled for new types, or its machine code is loaded.

    Parameters
    ----------
    notice : callable
    """

    class Noticing(Listener):
        def on_start(self, event: object) -> None:  # noqa: ARG002  # the base class names it
            notice()

        def on_end(self, event: object) -> None:
            pass

    with install_listener("numba:compiler_lock", Noticing()):  # who compiles or loads takes the compiler's lock
        yield
