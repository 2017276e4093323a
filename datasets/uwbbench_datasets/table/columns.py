"""The columns that a mapping names, as arrays of one capture in our units."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api import CaptureError, FloatArray, IntArray, nearest
from uwbbench_datasets.table.formats import Recording
from uwbbench_datasets.table.mapping import ANGLE_RAD, LENGTH_M, PoseColumns, SampleColumns, TableMapping


class FrameColumns:
    """The columns of a recording that a mapping names, for the rows of one capture."""

    def __init__(self, recording: Recording, mapping: TableMapping, rows: IntArray | None) -> None:
        self._recording, self._rows = recording, rows
        self._taps: dict[str, list[str]] = {}
        wanted = dict(_scalar_columns(mapping))
        for key, layout in (("preamble", mapping.preamble), ("sts1", mapping.sts1), ("sts2", mapping.sts2)):
            for part in layout.layout if layout else ():
                pattern = str(layout.pattern(part)) if layout else ""
                if "{tap}" in pattern:
                    self._taps[pattern] = _tap_columns(recording, pattern, f"{key}.{part}")
                    wanted.update(dict.fromkeys(self._taps[pattern], key))
                else:
                    wanted[pattern] = f"{key}.{part}"
        require_columns(recording, wanted)
        self._columns = recording.read(list(wanted))

    def _chosen(self, values: np.ndarray) -> np.ndarray:
        return values if self._rows is None else values[self._rows]

    def cells(self, column: str) -> np.ndarray:
        """One value a frame, as stored."""
        values = self._columns[column]
        values = values.ravel() if values.ndim != 1 and values.size == max(values.shape, default=1) else values
        if values.ndim != 1 or (self._rows is not None and self._rows[-1] >= len(values)):
            raise CaptureError(f"column '{column}' has shape {values.shape}; expected one value a frame")
        return self._chosen(values)

    def vector(self, column: str, unit: float = 1.0) -> FloatArray:
        """One number a frame."""
        try:
            return np.asarray(self.cells(column), dtype=np.float64) * unit
        except (TypeError, ValueError) as error:
            raise CaptureError(f"column '{column}' does not hold numbers: {error}") from error

    def pose(self, columns: PoseColumns) -> tuple[FloatArray, FloatArray]:
        """Positions (frames, 3) in metres and headings (frames,) in radians."""
        unit = LENGTH_M[columns.length_unit]
        x, y = self.vector(columns.x, unit), self.vector(columns.y, unit)
        z = np.zeros_like(x) if columns.z is None else self.vector(columns.z, unit)
        return np.stack([x, y, z], axis=1), self.vector(columns.yaw, ANGLE_RAD[columns.angle_unit])

    def samples(self, columns: SampleColumns, where: str) -> np.ndarray:
        """Impulse responses (frames, taps) as complex64, or float32 where they are real."""
        parts = [self._matrix(str(columns.pattern(key)), columns.taps_first, where) for key in columns.layout]
        if len({part.shape for part in parts}) > 1:
            raise CaptureError(f"{where}: {' and '.join(columns.layout)} differ in shape: {[p.shape for p in parts]}")
        first, second = parts[0], parts[-1]
        match columns.layout:
            case ("i", "q"):
                values = first + 1j * second
            case ("magnitude", "phase"):
                values = first * np.exp(1j * second * ANGLE_RAD[columns.phase_unit or "rad"])
            case ("interleaved",):
                if first.shape[1] % 2:
                    raise CaptureError(f"{where}: interleaved I and Q need an even count, found {first.shape[1]}")
                values = first[:, ::2] + 1j * first[:, 1::2]
            case _:
                values = first
        kind = np.float32 if columns.layout == ("real",) else np.complex64
        with np.errstate(over="ignore", invalid="ignore"):  # too large for the format: infinite, so marked invalid
            return np.asarray(values * columns.scale).astype(kind)

    def _matrix(self, pattern: str, taps_first: bool, where: str) -> np.ndarray:
        if pattern in self._taps:
            parts = [_numbers(self.cells(name), f"{where}: column '{name}'") for name in self._taps[pattern]]
            return np.stack(parts, axis=1)
        values = self._columns[pattern]
        label = f"{where}: column '{pattern}'"
        if values.dtype == object:
            values = _stacked(values.ravel(), label)
        if values.ndim == 3 and values.shape[-1] == 2:  # (frames, taps, I and Q)
            values = values.reshape(len(values), -1)
        values = values.T if taps_first else values
        if values.ndim != 2 or (self._rows is not None and self._rows[-1] >= len(values)):
            raise CaptureError(f"{label} has shape {values.shape}; expected (frames, taps), or set taps_first")
        return _numbers(self._chosen(values), label)


def _scalar_columns(mapping: TableMapping) -> Iterable[tuple[str, str]]:
    """Columns with one value a frame that a mapping names, and the key that names each."""
    if mapping.time is not None:
        yield mapping.time.column, "time.column"
    if mapping.material_column is not None:
        yield mapping.material_column, "material_column"
    for key in ("pose", "odometry", "first_path"):
        part = getattr(mapping, key)
        for field, column in part.model_dump().items() if part is not None else ():
            if column is not None and not field.endswith("_unit"):
                yield column, f"{key}.{field}"


def require_columns(recording: Recording, wanted: dict[str, str]) -> None:
    """Check that a recording has all columns that a mapping names.

    Raises
    ------
    CaptureError
        Naming the column, the key of the mapping and the nearest column there is.
    """
    for column, key in wanted.items():
        if column not in recording.names:
            hint = nearest(column, _families(recording.names))
            raise CaptureError(f"{recording.path}: no column '{column}', which the mapping's {key} names.{hint}")


def _tap_columns(recording: Recording, pattern: str, key: str) -> list[str]:
    """Columns of a pattern in the order of their tap numbers."""
    number = re.compile(re.escape(pattern).replace(re.escape("{tap}"), r"(\d+)"))
    columns = {int(hit[1]): name for name in recording.names if (hit := number.fullmatch(name))}
    if not columns:
        hint = nearest(pattern, _families(recording.names))
        raise CaptureError(f"{recording.path}: no columns like '{pattern}', which the mapping's {key} names.{hint}")
    missing = sorted(set(range(min(columns), max(columns))) - set(columns))
    if missing:
        gap = pattern.replace("{tap}", str(missing[0]))
        raise CaptureError(f"{recording.path}: column '{gap}' is missing between others of '{pattern}'")
    return [columns[tap] for tap in sorted(columns)]


def _families(names: Iterable[str]) -> list[str]:
    """Column names for a message, with one pattern in place of a hundred numbered columns."""
    families: dict[str, list[str]] = {}
    for name in names:
        families.setdefault(re.sub(r"\d+(?!.*\d)", "{tap}", name), []).append(name)
    return [name for family, members in families.items() for name in ([family] if len(members) > 3 else members)]


def labels_of(values: np.ndarray, path: Path, column: str) -> list[str]:
    """Values of a column as text, whole numbers without a decimal point.

    Parameters
    ----------
    values : array
        Cells of the column as stored: numbers, text or bytes, one for each row.
    path : Path
        File of the column, for messages.
    column : str
        Name of the column, for messages.

    Raises
    ------
    CaptureError
        If a row has no value.
    """
    labels = []
    for row, value in enumerate(values.ravel().tolist()):
        if value is None or value != value or value == "":  # NaN
            raise CaptureError(f"{path}: column '{column}' is empty in row {row + 1}")
        text = value.decode() if isinstance(value, bytes) else value
        labels.append(str(int(text)) if isinstance(text, float) and text.is_integer() else str(text).strip())
    return labels


def _numbers(values: np.ndarray, label: str) -> np.ndarray:
    """Values as double-precision real or complex numbers; text such as ``1+2i`` is read."""
    try:
        if values.dtype.kind in "OUS":
            values = np.array([_number(str(value)) for value in values.ravel()]).reshape(values.shape)
        return values.astype(np.complex128 if values.dtype.kind == "c" else np.float64)
    except (TypeError, ValueError) as error:
        raise CaptureError(f"{label} does not hold numbers: {error}") from error


def _number(text: str) -> complex:
    return complex(re.sub(r"\s", "", text).replace("i", "j").replace("jnf", "inf"))


def _stacked(cells: Sequence[Any] | np.ndarray, label: str) -> np.ndarray:
    """Array (frames, values) of cells that are arrays, or their text such as ``[1 2 3]``."""
    rows = [
        np.array([_number(item) for item in re.split(r"[,;\s]+", cell.strip("[]() \t"))])
        if isinstance(cell, str)
        else np.ravel(cell)
        for cell in cells
    ]
    lengths = sorted({len(row) for row in rows})
    if len(lengths) > 1:
        raise CaptureError(f"{label}: frames differ in length ({lengths[0]} to {lengths[-1]} values)")
    values = np.stack(rows) if rows else np.empty((0, 0))
    return values.real if values.dtype.kind == "c" and not values.imag.any() else values
