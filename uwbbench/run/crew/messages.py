"""What processes of a run send each other: length and content over a socket.

A worker has run plugins, so that nothing that it sends may make its reader do more than take it in: :func:`unpacked`
makes arrays, numbers, texts and the data classes of uwbbench, and calls what makes these alone.
"""

from __future__ import annotations

import io
import pickle
import socket
import struct
from typing import Any

LENGTH = struct.Struct("<Q")
LARGEST_BYTES = 4 << 30
"""Of one message: more than any detector's detections take."""

GAVE, RAISED = b"+", b"-"
"""First byte of an answer."""

_ARRAYS = {
    ("numpy", "dtype"),
    ("numpy", "ndarray"),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.multiarray", "scalar"),
    ("numpy._core.numeric", "_frombuffer"),
    ("numpy.core.multiarray", "_reconstruct"),
    ("numpy.core.multiarray", "scalar"),
    ("numpy.core.numeric", "_frombuffer"),
}
_PLAIN = {("builtins", name) for name in ("set", "frozenset", "complex", "bytearray", "slice", "range")} | {
    ("collections", "Counter"),
    ("collections", "OrderedDict"),
}
_OURS = ("uwbbench.api.", "uwbbench.measure.", "uwbbench.run.")


class Refused(Exception):
    """A message that holds more than data."""


class _Data(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in _ARRAYS | _PLAIN:
            return super().find_class(module, name)
        if module.startswith(_OURS):
            found = super().find_class(module, name)
            if isinstance(found, type) and hasattr(found, "__dataclass_fields__" if name != "Detections" else "take"):
                return found
        raise Refused(f"a message of a worker names {module}.{name}, which is no data")


def packed(value: object) -> bytes:
    """Value as a message."""
    return pickle.dumps(value, protocol=5)


def unpacked(message: bytes) -> Any:
    """Value of a message from a process that has run plugins.

    Raises
    ------
    Refused
        If it holds anything but data.
    """
    try:
        return _Data(io.BytesIO(message)).load()
    except Refused:
        raise
    except Exception as error:  # whatever a broken pickle leads to
        raise Refused(f"a message of a worker cannot be read ({type(error).__name__})") from error


def send(channel: socket.socket, message: bytes) -> None:
    """Send one message."""
    channel.sendall(LENGTH.pack(len(message)) + message)


def receive(channel: socket.socket) -> bytes | None:
    """Next message; None where the other side has ended."""
    head = _exactly(channel, LENGTH.size)
    if head is None:
        return None
    return _exactly(channel, LENGTH.unpack(head)[0])


def _exactly(channel: socket.socket, size: int) -> bytes | None:
    parts = bytearray()
    while len(parts) < size:
        part = channel.recv(min(size - len(parts), 1 << 20))
        if not part:
            return None
        parts += part
    return bytes(parts)
