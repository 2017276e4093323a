"""Recordings in a device's own format: which ones a dataset names, and what all their readers need."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import Any

from uwbbench.api import CaptureError, Dataset, FloatArray


def list_recordings(dataset: Dataset[Any], patterns: Iterable[str]) -> dict[str, str]:
    """Recordings of a dataset by capture name, without reading any.

    Parameters
    ----------
    dataset : Dataset
        Gives the folders to search.
    patterns : iterable of str
        Paths or glob patterns below the dataset's folder. A plain path is not looked up: opening it shows whether it
        is there. Of a glob pattern, the first folder with a match wins.

    Returns
    -------
    dict of str to str
        Paths for :meth:`Dataset.file`, by the path without its suffix.

    Raises
    ------
    CaptureError
        If a pattern is empty, or a glob pattern is malformed, matches nothing or leads out of the folders.
    """
    paths: list[str] = []
    for pattern in patterns:
        if not PurePosixPath(pattern).name:
            raise CaptureError(f"'{pattern}' names no file below the dataset's folder")
        paths += _matches(dataset, pattern) if any(mark in pattern for mark in "*?[") else [pattern]
    return {PurePosixPath(path).with_suffix("").as_posix(): path for path in paths}


def _matches(dataset: Dataset[Any], pattern: str) -> list[str]:
    if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
        raise CaptureError(f"pattern '{pattern}' must stay below the dataset's folder")
    folders = [folder for root in dataset.roots for folder in (root / dataset.card.folder, root)]
    for folder in folders:
        try:
            hits = sorted(hit.relative_to(folder).as_posix() for hit in folder.glob(pattern) if hit.is_file())
        except ValueError as error:
            raise CaptureError(f"pattern '{pattern}': {error}") from error
        if hits:
            return hits
    raise CaptureError(f"no file matches '{pattern}' in {', '.join(map(str, folders)) or 'no folder at all'}")


def content(path: Path) -> bytes:
    """All bytes of a file.

    Raises
    ------
    CaptureError
        If it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise CaptureError(f"{path}: cannot be read: {error.strerror}") from error


def mean_frame_rate_hz(timestamp_s: FloatArray, path: Path) -> float:
    """Frames a second, from the first to the last timestamp (frames,).

    Raises
    ------
    CaptureError
        If there are fewer than two distinct times: one frame has no rate.
    """
    if len(timestamp_s) < 2 or timestamp_s[-1] <= timestamp_s[0]:
        raise CaptureError(f"{path}: {len(timestamp_s)} frames at one time; a frame rate needs two at different times")
    return float((len(timestamp_s) - 1) / (timestamp_s[-1] - timestamp_s[0]))
