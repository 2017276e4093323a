"""Captures that were made, not read, handed to other processes as a file that they map.

A capture is simulated once for all detectors, whose processes would else each do so. The file is written and read by
processes of one run, and ends with it.
"""

from __future__ import annotations

import mmap
import pickle
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.capture import Capture
from uwbbench.api.drive import Drive
from uwbbench.run.crew.messages import LENGTH

_ALIGNED = 64


def hand_over(opened: Capture | Drive, file: Path) -> bool:
    """Write a capture, or a run, whose samples lie in memory; others are opened again.

    Parameters
    ----------
    opened : Capture or Drive
    file : Path
        New file.

    Returns
    -------
    bool
        Whether it was written.
    """
    if not all(_in_memory(capture.preamble) for capture in _captures(opened)):
        return False
    buffers: list[pickle.PickleBuffer] = []
    frame = pickle.dumps(opened, protocol=5, buffer_callback=buffers.append)
    parts = [one.raw() for one in buffers]
    head = pickle.dumps([len(frame), *(part.nbytes for part in parts)])
    with file.open("xb") as out:
        out.write(LENGTH.pack(len(head)) + head + frame)
        for part in parts:
            out.write(bytes(-out.tell() % _ALIGNED))
            out.write(part)
    return True


def taken(file: Path) -> Any:
    """The capture, or run, that another process of this run has written; its samples are read where they lie.

    Parameters
    ----------
    file : Path
    """
    with file.open("rb") as source:
        mapped = memoryview(mmap.mmap(source.fileno(), 0, access=mmap.ACCESS_READ))
    start = LENGTH.size
    stop = start + LENGTH.unpack(mapped[:start])[0]
    frame_size, *sizes = pickle.loads(mapped[start:stop])  # noqa: S301 - of a process of this run
    frame, at, parts = mapped[stop : stop + frame_size], stop + frame_size, []
    for size in sizes:
        at += -at % _ALIGNED
        parts.append(mapped[at : at + size])
        at += size
    return pickle.loads(frame, buffers=parts)  # noqa: S301 - of a process of this run


def _captures(opened: Capture | Drive) -> tuple[Capture, ...]:
    return tuple(opened.captures) if isinstance(opened, Drive) else (opened,)


def _in_memory(samples: Any) -> bool:
    while type(samples) is np.ndarray and isinstance(samples.base, np.ndarray):
        samples = samples.base
    return type(samples) is np.ndarray and not isinstance(samples.base, mmap.mmap)
