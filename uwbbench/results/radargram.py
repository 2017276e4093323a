"""The samples of a capture over time and range, and as a picture where the capture is at hand.

A run folder holds no samples. The capture is opened again by its dataset and name; its content must be what the run
saw, by its hash. No detector runs: delays count from what the capture says of itself.
"""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray, IntArray
from uwbbench.api.block import Block
from uwbbench.api.capture import Capture
from uwbbench.api.errors import CaptureError, UwbbenchError
from uwbbench.api.interruption import by_plugin
from uwbbench.api.radar import Radar
from uwbbench.config.source import CaptureRef
from uwbbench.results.delay import delay_of_range, zero_tap

COLUMNS, ROWS = 480, 180
FLOOR_DB = -50.0
MOST_SAMPLES = 200_000_000
"""A capture with more samples is not read for a picture."""


def reopened(used: Mapping[str, Any], name: str, sha256: str, roots: Sequence[Path]) -> Capture:
    """Capture of a run, opened again.

    Parameters
    ----------
    used : mapping
        The dataset as the manifest records it: ``use`` and ``params``.
    name : str
        Of the capture.
    sha256 : str
        Of the content that the run saw.
    roots : sequence of Path
        Folders to search.

    Raises
    ------
    CaptureError
        If it is not at hand, has other content, or is too large to be read for a picture.
    """
    try:
        capture = CaptureRef(used["use"], used["params"], tuple(map(str, roots)), name).open()
        small = len(capture) * capture.radar.taps <= MOST_SAMPLES
        same = small and capture.sha256 == sha256
    except UwbbenchError as error:
        raise CaptureError(str(error)) from error
    except BaseException as error:  # an adapter may raise anything
        if not by_plugin(error):
            raise
        raise CaptureError(f"capture '{name}' cannot be opened: {type(error).__name__}: {error}") from error
    if not small:
        raise CaptureError(f"capture '{name}' is too large to be read for a picture")
    if not same:
        raise CaptureError(f"capture '{name}' has other content than the one that the run saw")
    return capture


def picture(capture: Capture) -> tuple[str, float]:
    """PNG of a capture as a ``data:`` address, dark where the amplitude is high, and the range at its upper edge.

    Time runs from left to right over all frames, range from the bottom up; 50 dB from black to white.
    """
    range_m = np.linspace(0.0, capture.radar.window_m, ROWS)
    chosen = np.unique(np.linspace(0, len(capture) - 1, min(COLUMNS, len(capture))).astype(np.int64))
    blocks = (Block(capture.frames(frame, frame + 1)) for frame in chosen.tolist())
    level_db, _ = levels(blocks, capture.radar, range_m, chosen, FLOOR_DB)
    reached = np.flatnonzero(np.isfinite(level_db).any(axis=0))
    top = int(reached[-1]) + 1 if len(reached) else ROWS  # the taps end before the window where delays start late
    level_db, far_m = level_db[:, :top], float(range_m[top - 1])
    grey = np.round(255 * np.nan_to_num(level_db, nan=FLOOR_DB) / FLOOR_DB).astype(np.uint8)
    return "data:image/png;base64," + base64.b64encode(_png(grey.T[::-1])).decode(), far_m


def levels(
    blocks: Iterable[Block], radar: Radar, range_m: FloatArray, chosen: IntArray, floor_db: float
) -> tuple[FloatArray, str]:
    """Amplitude over frames and ranges, each frame shifted to where its delays count from.

    Parameters
    ----------
    blocks : iterable of Block
        Blocks that hold the chosen frames.
    radar : Radar
    range_m : (ranges,) array
        Ranges on boresight.
    chosen : (columns,) int array
        Frames, increasing.
    floor_db : float
        Nothing is lower.

    Returns
    -------
    level_db : (columns, ranges) array
        Below the strongest of all; NaN in invalid frames, and where the taps do not reach.
    origin : str
        What delays count from.
    """
    offset = delay_of_range(radar, range_m) / radar.sample_interval_s
    columns = []
    origin = ""
    for block in blocks:
        zero, origin = zero_tap(block, radar)
        for row in np.flatnonzero(np.isin(block.frames.index, chosen)):
            amplitude = block.frames.amplitude[row] if block.frames.valid[row] else np.full(radar.taps, np.nan)
            columns.append(np.interp(offset + zero[row], np.arange(radar.taps), amplitude, left=np.nan, right=np.nan))
    image = np.array(columns)
    strongest = float(np.max(image, initial=0.0, where=np.isfinite(image))) or 1.0
    with np.errstate(divide="ignore"):
        return np.maximum(20 * np.log10(image / strongest), floor_db), origin


def _png(grey: np.ndarray[Any, np.dtype[np.uint8]]) -> bytes:
    """Image (rows, columns) of 8 bits a pixel, after the PNG specification (ISO/IEC 15948), sections 5 and 11."""
    rows, columns = grey.shape

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    lines = np.concatenate([np.zeros((rows, 1), np.uint8), grey], axis=1)  # each line starts with its filter: none
    data = zlib.compress(lines.tobytes(), 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
