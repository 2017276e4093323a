"""Detections that another program has written into a file, checked against the capture that they are of.

Conventions
-----------
* A table with one row a detection, CSV or Parquet. Columns have the names and units of
  :data:`uwbbench.api.detections.COLUMNS`, which ``uwbbench detect`` writes; ``frame`` and one of ``range_m`` and
  ``delay_s`` are enough. Other columns are not read, and a note says so. Frames count from 0.
* CSV is UTF-8 with commas and points; spaces behind commas, Windows line ends, a byte order mark and lines without any
  value are fine. An empty cell and NaN are the same: not known.
* Rows in another order than that of frames are sorted, those of one frame staying in their order, and a note says so.
  Equal rows are refused: they come from a file that was appended to, and would be counted as false.
* ``cluster`` and ``track`` are whole numbers; a row without one, or with -1, belongs to none. A track has one row a
  frame: two are refused.
* Where ``range_m`` is not known it follows from ``delay_s``, which counts as in the capture (from transmission or from
  the direct path), by the exact geometry, at ``azimuth_rad`` or else straight ahead.
* ``NAME.frames.csv`` or ``.parquet`` beside ``NAME.csv`` lists the frames that were processed (``frame``) and may say
  how long each took (``time_us``). Without it every valid frame counts as processed, so that a frame without a row is
  one in which nothing was found.
* Frames with a sample that is not finite are no detector's affair: their rows are left out, with a note.
"""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.arrays import BoolArray, FloatArray, IntArray
from uwbbench.api.capture import Capture
from uwbbench.api.detections import COLUMNS, Detections
from uwbbench.api.errors import ScoringError
from uwbbench.api.frames import BATCH_FRAMES
from uwbbench.api.geometry import SPEED_OF_LIGHT_M_S, bistatic_range, direction
from uwbbench.api.radar import Radar
from uwbbench.config.identity import RESULTS_FILE
from uwbbench.detect.number_table import NumberTable, read_table

SUFFIXES = (".csv", ".parquet")
FRAMES_COLUMNS = ("frame", "time_us")

FAR_BEYOND = 2.0
"""A range this many times the radar's window is in another unit, whatever the others are."""
SMALLEST_M = 1e-3
"""Ranges that all lie below are in another unit."""


@dataclass(frozen=True)
class ResultsFile:
    """What a results file holds.

    Attributes
    ----------
    detections : Detections
        With the processed frames and notes.
    times_us : (processed frames,) array or None
        Time of each frame as the program reports it; None where it does not.
    sha256 : str
        Of the files behind it.
    """

    detections: Detections
    times_us: FloatArray | None
    sha256: str


def read_results(path: Path, capture: Capture) -> ResultsFile:
    """Read a results file, and the list of its frames where that lies beside it.

    Parameters
    ----------
    path : Path
        CSV or Parquet, by its suffix.
    capture : Capture
        That the detections are of.

    Raises
    ------
    ScoringError
        If something in it cannot be right; the message names file, line, what was found and what was expected.
    """
    contents = _contents(path)
    table, *listed = [read_table(one, content) for one, content in contents.items()]
    _known_names(table, COLUMNS, 0.8)
    if "frame" not in table.names:
        raise ScoringError(f"{path}: column 'frame' is missing.{_instead('frame', table.names)}")
    if not {"range_m", "delay_s"} & set(table.names):
        near = _instead("range_m", table.names)
        raise ScoringError(f"{path}: neither 'range_m' (in metres) nor 'delay_s' (in seconds) is there.{near}")
    given = [name for name in table.names if name in COLUMNS]
    table.refuse_infinite(given)
    frame = _frames(table, capture)
    _refuse_repeated(table, given)
    # Empty columns are those that no stage of a detector computed.
    columns = {name: table[name] for name in given if name != "frame" and not np.isnan(table[name]).all()}
    notes = [f"column '{name}' is not read" for name in table.names if name not in COLUMNS]
    columns |= {name: _numbers(table, name) for name in ("cluster", "track") if name in columns}
    if "track" in columns:
        _refuse_split(table, frame, columns["track"])
    columns["range_m"] = _ranges(table, columns, capture.radar, notes)
    valid = np.concatenate([np.empty(0, bool), *(block.valid for block in capture.blocks(BATCH_FRAMES))])
    processed, times_us = np.flatnonzero(valid), None
    if listed:
        processed, times_us = _processed(listed[0], table, frame, capture, valid)
    return ResultsFile(_detections(frame, columns, processed, valid, notes), times_us, _sha256(contents))


def _detections(
    frame: IntArray, columns: dict[str, FloatArray], processed: IntArray, valid: BoolArray, notes: list[str]
) -> Detections:
    """Rows of valid frames in the order of frames, with notes about the others.

    Parameters
    ----------
    frame : (n,) int array
    columns : dict of str to (n,) arrays
    processed : (m,) int array
    valid : (frames,) bool array
    notes : list of str
        What is to be said already.
    """
    if (np.diff(frame) < 0).any():
        notes.append("rows were not in the order of frames: sorted; those of one frame stay in their order")
    order = np.argsort(frame, kind="stable")
    order = order[valid[frame[order]]]
    if len(order) < len(frame):
        notes.append(f"{len(frame) - len(order)} rows left out: a sample of their frame is not finite")
    kept: dict[str, Any] = {name: values[order] for name, values in columns.items()}
    return Detections(frame[order], processed=processed, notes=[f"{RESULTS_FILE}: {one}" for one in notes], **kept)


def content_of(path: Path) -> str:
    """SHA-256 of a results file and of its list of frames.

    Raises
    ------
    ScoringError
        If one of them cannot be read.
    """
    return _sha256(_contents(path))


def _contents(path: Path) -> dict[Path, bytes]:
    """Content of a results file and, where it lies beside it, of the list of its frames."""
    if path.suffix.lower() not in SUFFIXES:
        raise ScoringError(f"{path}: the suffix decides the format; expected {' or '.join(SUFFIXES)}")
    lists = [one for suffix in SUFFIXES if (one := path.with_name(f"{path.stem}.frames{suffix}")).is_file()]
    if len(lists) > 1:
        raise ScoringError(f"{lists[0]}: {lists[1].name} lies beside it; keep one of them")
    contents = {}
    for one in (path, *lists):
        if one.exists() and not one.is_file():
            raise ScoringError(f"{one}: cannot be read: is no file")
        try:
            contents[one] = one.read_bytes()
        except OSError as error:
            raise ScoringError(f"{one}: cannot be read: {error.strerror or error}") from error
    return contents


def _sha256(contents: Mapping[Path, bytes]) -> str:
    parts = [part for path, content in contents.items() for part in (path.suffix.lower().encode(), content)]
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


def _known_names(table: NumberTable, known: Sequence[str], cutoff: float) -> None:
    """Refuse a column whose name is nearly one that is missing."""
    for name in table.names:
        near = _near(name, [one for one in known if one not in table.names], cutoff)
        if name not in known and near:
            raise ScoringError(f"{table.path}: no column is called '{name}'. Did you mean '{near}'?")


def _instead(missing: str, names: Sequence[str]) -> str:
    near = _near(missing, names, 0.6)
    return f" Is '{near}' meant to be '{missing}'?" if near else f" Found: {', '.join(names)}."


def _near(name: str, known: Sequence[str], cutoff: float) -> str:
    """Nearest known name, whatever its case and with spaces for underlines; empty where none is near."""
    simple = {one.lower().replace(" ", "_"): one for one in known}
    near = difflib.get_close_matches(name.lower().replace(" ", "_"), simple, n=1, cutoff=cutoff)
    return simple[near[0]] if near else ""


def _frames(table: NumberTable, capture: Capture) -> IntArray:
    """Column ``frame``, every value a frame of the capture."""
    values, frames = table["frame"], len(capture)
    whole = np.isfinite(values) & (values == np.floor(values))
    if not whole.all():
        row = int(np.argmin(whole))
        shown = "is missing" if np.isnan(values[row]) else f"{values[row]:g} is not a whole number"
        raise ScoringError(f"{table.place(row)}: frame {shown}")
    outside = (values < 0) | (values >= frames)
    if outside.any():
        row = int(np.argmax(outside))
        from_one = " Do they count from 1 there?" if values.min() == 1 and values.max() == frames else ""
        raise ScoringError(
            f"{table.place(row)}: frame {values[row]:.0f}, but capture '{capture.name}' has {frames} frames, from 0 to "
            f"{frames - 1}.{from_one}"
        )
    return values.astype(np.int64)


def _numbers(table: NumberTable, name: str) -> FloatArray:
    """Column of whole numbers, -1 where there is none."""
    values = np.nan_to_num(table[name], nan=-1.0)
    whole = (values == np.floor(values)) & (values >= -1)
    if not whole.all():
        row = int(np.argmin(whole))
        raise ScoringError(
            f"{table.place(row)}: {name} {values[row]:g}: expected a whole number from 0, or -1 for none"
        )
    return values


def _refuse_split(table: NumberTable, frame: IntArray, track: FloatArray) -> None:
    """Refuse a track that is in two places at once."""
    rows = np.flatnonzero(track >= 0)
    _, first, which = np.unique(np.stack([frame[rows], track[rows]]), axis=1, return_index=True, return_inverse=True)
    again = rows[first[which.ravel()] != np.arange(len(rows))]
    if len(again):
        row = int(again[0])
        raise ScoringError(f"{table.place(row)}: track {track[row]:.0f} has another row in frame {frame[row]} already")


def _refuse_repeated(table: NumberTable, given: Sequence[str]) -> None:
    """Refuse rows that are equal in every column that is read."""
    values = np.stack([table[name] for name in given], axis=1) + 0.0  # no -0
    rows = np.where(np.isnan(values), np.nan, values).view(np.dtype((np.void, values.dtype.itemsize * len(given))))
    _, first, which = np.unique(rows.ravel(), return_index=True, return_inverse=True)
    repeated = np.flatnonzero(first[which] != np.arange(len(table)))
    if len(repeated):
        row, before = int(repeated[0]), int(first[which[repeated[0]]])
        more = f"; {len(repeated) - 1} more rows repeat others" if len(repeated) > 1 else ""
        raise ScoringError(f"{table.place(row)}: repeats {table.unit} {table.lines[before]}{more}")


def _ranges(table: NumberTable, columns: dict[str, FloatArray], radar: Radar, notes: list[str]) -> FloatArray:
    """Range of each row, checked for its unit, as are delay and azimuth."""
    rows = len(table)
    unknown = np.full(rows, np.nan)
    range_m, delay_s = columns.get("range_m", unknown), columns.get("delay_s", unknown)
    neither = np.isnan(range_m) & np.isnan(delay_s)
    if neither.any():
        where = table.place(int(np.argmax(neither)))
        raise ScoringError(f"{where}: neither range nor delay; a frame in which nothing was found has no row")
    window_s = 2 * radar.window_m / SPEED_OF_LIGHT_M_S
    _right_unit(table, "range_m", range_m, radar.window_m, "m", notes)
    _right_unit(table, "delay_s", delay_s, window_s, "s", notes)
    azimuth_rad = columns.get("azimuth_rad", unknown)
    if (np.abs(azimuth_rad) > 2 * np.pi).any():
        row = int(np.nanargmax(np.abs(azimuth_rad)))
        raise ScoringError(f"{table.place(row)}: azimuth_rad {azimuth_rad[row]:g} is more than a turn: radians?")
    towards = direction(np.nan_to_num(azimuth_rad, nan=0.0))
    from_delay = bistatic_range(radar.excess_m(np.nan_to_num(delay_s)), towards, radar.baseline_m)
    return np.where(np.isnan(range_m), np.where(np.isnan(delay_s), np.nan, from_delay), range_m)


def _right_unit(table: NumberTable, name: str, values: FloatArray, window: float, unit: str, notes: list[str]) -> None:
    """Refuse values that can only be in another unit; a note where some lie outside what the radar sees.

    Parameters
    ----------
    table : NumberTable
        For messages.
    name : str
        Column.
    values : (n,) array
        NaN where not known.
    window : float
        Largest value that the radar's taps can hold.
    unit : {"m", "s"}
    notes : list of str
        A note is added to.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return
    asked = {"m": "metres?", "s": "seconds?"}[unit]
    if unit == "m" and (known < 0).any():
        row = int(np.nanargmin(values))
        raise ScoringError(f"{table.place(row)}: {name} {values[row]:g} is negative")
    beyond = known > window
    largest = int(np.nanargmax(values))
    if 2 * beyond.sum() > len(known) or known.max() > FAR_BEYOND * window:
        raise ScoringError(
            f"{table.place(largest)}: {name} {values[largest]:g}: {asked} {int(beyond.sum())} of {len(known)} lie "
            f"beyond the radar's window of {window:.3g} {unit}, half of all beyond {np.median(known):.3g}"
        )
    if unit == "m" and known.max() < SMALLEST_M:
        raise ScoringError(
            f"{table.place(largest)}: {name} {values[largest]:g}: {asked} None of {len(known)} reaches "
            f"{SMALLEST_M:g} m; the radar's window is {window:.3g} m"
        )
    if beyond.any():
        notes.append(f"{int(beyond.sum())} of {len(known)} values of {name} lie beyond the radar's window")


def _processed(
    listed: NumberTable, table: NumberTable, frame: IntArray, capture: Capture, valid: BoolArray
) -> tuple[IntArray, FloatArray | None]:
    """Frames of the list that are valid, and the time of each where the list has them.

    Parameters
    ----------
    listed : NumberTable
        The list of frames.
    table : NumberTable
        The detections, for messages.
    frame : (n,) int array
        Frame of each detection.
    capture : Capture
    valid : (frames,) bool array
    """
    _known_names(listed, FRAMES_COLUMNS, 0.6)
    if "frame" not in listed.names:
        raise ScoringError(f"{listed.path}: column 'frame' is missing.{_instead('frame', listed.names)}")
    listed.refuse_infinite([name for name in listed.names if name in FRAMES_COLUMNS])
    frames = _frames(listed, capture)
    unique, counts = np.unique(frames, return_counts=True)
    if (counts > 1).any():
        raise ScoringError(f"{listed.path}: frame {unique[np.argmax(counts > 1)]} is listed twice")
    unlisted = ~np.isin(frame, frames)
    if unlisted.any():
        row = int(np.argmax(unlisted))
        raise ScoringError(f"{table.place(row)}: frame {frame[row]} has a detection, but {listed.path.name} lacks it")
    order = np.argsort(frames)
    order = order[valid[frames[order]]]
    if "time_us" not in listed.names:
        return frames[order], None
    times_us = listed["time_us"]
    wrong = ~(times_us >= 0)
    if wrong.any():
        row = int(np.argmax(wrong))
        shown = "is missing" if np.isnan(times_us[row]) else f"{times_us[row]:g} is negative"
        raise ScoringError(f"{listed.place(row)}: time_us {shown}")
    return frames[order], times_us[order]
