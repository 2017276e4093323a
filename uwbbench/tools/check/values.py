"""Results of plugins as named arrays: taken apart, compared bit for bit, and put into one hash."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uwbbench.api.block import Block
from uwbbench.api.detections import Detections
from uwbbench.tools.check.check import Nonconformity

Values = dict[str, NDArray[Any]]
"""Arrays by name: ports of a block, columns of detections, parts of a capture."""


def of_blocks(blocks: Iterable[Block]) -> Values:
    """What consecutive blocks hold, by port; ``detections`` is the frame of each."""
    parts: dict[str, list[NDArray[Any]]] = {}
    detections = []
    for block in blocks:
        held = {
            "frame index": block.frames.index,
            "frames": block.frames.preamble,
            "first_path": block.first_path,
            "noise": block.noise_rms,
            "profile": block.profile,
            "aligned": None if block.aligned is None else block.aligned.magnitude,
            "window_mean": None if block.window_mean is None else block.window_mean.of_frames,
            "window_sd": None if block.window_sd is None else block.window_sd.of_frames,
            "features": block.features,
        }
        for name, array in held.items():
            if array is not None:
                parts.setdefault(name, []).append(array)
        detections.append(block.detections)
    return {name: np.concatenate(arrays) for name, arrays in parts.items()} | of_detections(Detections.join(detections))


def of_detections(found: Detections) -> Values:
    """Columns, with the frame of each detection as ``detections``."""
    return {"detections" if name == "frame" else name: column for name, column in found.columns.items()}


def difference(one: Mapping[str, NDArray[Any]], other: Mapping[str, NDArray[Any]]) -> str:
    """First part that is not bit-equal, and where, in words; empty if all are equal."""
    for name in dict.fromkeys([*one, *other]):
        if name not in one or name not in other:
            return f"'{name}' is there only {'the first' if name in one else 'the second'} time"
        deviation = _difference(one[name], other[name])
        if deviation:
            return f"{name}: {deviation}"
    return ""


def _difference(one: NDArray[Any], other: NDArray[Any]) -> str:
    if one.shape != other.shape:
        return f"shape {one.shape} against {other.shape}"
    if one.dtype != other.dtype:
        return f"{one.dtype} against {other.dtype}"
    if not one.size:
        return ""
    numbers = one.dtype.kind in "fc"
    unequal = (one != other) & ~(np.isnan(one) & np.isnan(other)) if numbers else one != other
    if not unequal.any():
        return ""
    first = tuple(int(axis[0]) for axis in np.nonzero(unequal))
    place = first[0] if len(first) == 1 else first
    return f"{int(unequal.sum())} of {one.size} values, first at {place}: {one[first]!s} against {other[first]!s}"


def same(one: Mapping[str, NDArray[Any]], other: Mapping[str, NDArray[Any]], expected: str) -> None:
    """Raise :class:`Nonconformity` unless both are bit-equal.

    Parameters
    ----------
    one, other : mapping of str to array
        Results of the first and the second time.
    expected : str
        What was expected, for the message.

    Raises
    ------
    Nonconformity
        With the first difference.
    """
    deviation = difference(one, other)
    if deviation:
        raise Nonconformity(expected, deviation)


def digest(values: Mapping[str, NDArray[Any]]) -> str:
    """Hash of names, types, shapes and bits."""
    combined = hashlib.sha256()
    for name, array in values.items():
        combined.update(f"{name} {array.dtype} {array.shape};".encode())
        combined.update(np.ascontiguousarray(array).tobytes())
    return combined.hexdigest()


@contextmanager
def read_only(arrays: Mapping[str, NDArray[Any]]) -> Iterator[None]:
    """Let nobody write into these arrays.

    Raises
    ------
    Nonconformity
        If somebody tried, or did it all the same.
    """
    expected = "input arrays that nobody writes into; copy what you change"
    before = {name: array.copy() for name, array in arrays.items()}
    writable = {name: array.flags.writeable for name, array in arrays.items()}
    for array in arrays.values():
        array.flags.writeable = False
    try:
        yield
    except ValueError as error:
        if "read-only" in str(error) or "not writeable" in str(error):
            raise Nonconformity(expected, f"an attempt to write into an input: ValueError: {error}") from error
        raise
    finally:
        for name, array in arrays.items():
            array.flags.writeable = writable[name]
    same(before, arrays, expected)
