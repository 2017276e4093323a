"""Samples of a file that is larger than the memory."""

from __future__ import annotations

import mmap
from pathlib import Path
from typing import Any

import numpy as np


class MappedSamples:
    """Samples (frames, taps) read where they lie in a file, in bounded memory.

    What is sliced is a view of the mapped file, not a copy. Once more than ``kept_bytes`` were handed out the pages go
    back to the system; a view that is still in use reads them again.

    Parameters
    ----------
    path : Path
    dtype : dtype
    offset : int
        Byte in the file of the first sample.
    shape : tuple of int
        Frames and taps; at least one sample.
    """

    kept_bytes = 1 << 25

    def __init__(self, path: Path, dtype: np.dtype[Any], offset: int, shape: tuple[int, ...]) -> None:
        with path.open("rb") as file:
            self._memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._samples: Any = np.frombuffer(self._memory, dtype, shape[0] * shape[1], offset).reshape(shape)
        self._handed_out = 0

    @property
    def shape(self) -> tuple[int, ...]:
        """Frames and taps."""
        shape: tuple[int, ...] = self._samples.shape
        return shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """As stored."""
        dtype: np.dtype[Any] = self._samples.dtype
        return dtype

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any, /) -> Any:
        part = self._samples[key]
        self._handed_out += part.nbytes
        if self._handed_out > self.kept_bytes and hasattr(mmap, "MADV_DONTNEED"):  # systems without it decide alone
            self._memory.madvise(mmap.MADV_DONTNEED)
            self._handed_out = 0
        return part

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.array(self._samples, dtype=dtype, copy=copy)
