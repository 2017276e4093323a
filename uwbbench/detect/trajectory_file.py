"""Poses that another program has written into a file, checked against the run that they are of.

Conventions
-----------
* Times are those of the run's clock. A pose belongs to the step that is nearest in time, if that is within half of the
  median time between steps; other poses are left out, with a note. Of several poses of one step the nearest in time
  counts, so that a program may answer more often, or less, than the robot's clock ticks.
* The frame is the program's own: scorings lay it over the truth's, as that of any mapper.
* There is no map, and no covariance.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from uwbbench.api.detections import Detections
from uwbbench.api.drive import Drive
from uwbbench.api.errors import ScoringError
from uwbbench.api.mapper import Map, Mapped, Poses
from uwbbench.config.identity import RESULTS_FILE
from uwbbench.detect.results_file import ResultsFile
from uwbbench.detect.tum import read_tum


def read_trajectory(path: Path, drive: Drive) -> ResultsFile:
    """Read the trajectory of a run.

    Parameters
    ----------
    path : Path
        TUM file.
    drive : Drive

    Raises
    ------
    ScoringError
        If something in it cannot be right, or no pose is of a time of the run.
    """
    content = _content(path)
    time_s, pose = read_tum(path, content)
    clock_s = drive.time_s
    step = np.searchsorted((clock_s[:-1] + clock_s[1:]) / 2, time_s)
    tick_s = np.median(np.diff(clock_s)) if len(clock_s) > 1 else 1 / drive.radar.frame_rate_hz
    apart_s = np.abs(time_s - clock_s[step])
    near = apart_s <= tick_s / 2
    if not near.any():
        raise ScoringError(
            f"{path}: no pose is of a time of run '{drive.name}': its clock goes from {clock_s[0]:g} to "
            f"{clock_s[-1]:g} s, the file's from {time_s[0]:g} to {time_s[-1]:g} s"
        )
    order = np.lexsort((apart_s, step))
    order = order[near[order]]
    index, first = np.unique(step[order], return_index=True)
    kept = order[first]
    notes = []
    if len(kept) < len(time_s):
        left_out = f"{len(time_s) - len(kept)} of {len(time_s)} poses left out"
        notes.append(f"{RESULTS_FILE}: {left_out}: no step is near, or another pose is nearer to it")
    mapped = Mapped(Poses(index, pose[kept]), Map())
    found = Detections.empty(processed=index, notes=notes).annotated(mapped=mapped)
    return ResultsFile(found, None, hashlib.sha256(content).hexdigest())


def content_of(path: Path) -> str:
    """SHA-256 of a trajectory file.

    Raises
    ------
    ScoringError
        If it cannot be read.
    """
    return hashlib.sha256(_content(path)).hexdigest()


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ScoringError(f"{path}: cannot be read: {error.strerror or error}") from error
