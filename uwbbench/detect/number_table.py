"""A table of numbers from CSV or Parquet, as any program may write it, with the place of each row for messages."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.errors import ScoringError
from uwbbench.api.text import printable

LONGEST_CELL = 40


@dataclass(frozen=True)
class NumberTable:
    """Columns of numbers by name.

    Attributes
    ----------
    path : Path
    names : tuple of str
        Of all columns, also those that hold no numbers.
    columns : dict of str to (rows,) array or str
        Numbers, NaN where there is none; or why a column holds none.
    lines : sequence of int
        Line of each row in the file, or its number where the file has no lines.
    unit : {"line", "row"}
    """

    path: Path
    names: tuple[str, ...]
    columns: dict[str, FloatArray | str]
    lines: Sequence[int]
    unit: str

    def __len__(self) -> int:
        return len(self.lines)

    def __getitem__(self, name: str) -> FloatArray:
        """Column as numbers.

        Raises
        ------
        ScoringError
            If it holds something else.
        """
        values = self.columns[name]
        if isinstance(values, str):
            raise ScoringError(values)
        return values

    def place(self, row: int) -> str:
        """File and line of a row."""
        return f"{self.path}: {self.unit} {self.lines[row]}"

    def refuse_infinite(self, names: Sequence[str]) -> None:
        """Refuse infinite numbers in some columns.

        Raises
        ------
        ScoringError
            If there is one; names its place.
        """
        for name in names:
            infinite = np.isinf(self[name])
            if infinite.any():
                row = int(np.argmax(infinite))
                raise ScoringError(f"{self.place(row)}: {name} {self[name][row]:g} is no number to be scored")


def read_table(path: Path, content: bytes) -> NumberTable:
    """Read a table.

    Parameters
    ----------
    path : Path
        Its suffix says which format it is, ``.csv`` or ``.parquet``.
    content : bytes
        Of the file.

    Raises
    ------
    ScoringError
        If it is no such table.
    """
    if not content.strip():
        raise ScoringError(f"{path}: is empty; where nothing was found, the names of the columns stand alone")
    return _parquet(path, content) if path.suffix.lower() == ".parquet" else _csv(path, content)


def _csv(path: Path, content: bytes) -> NumberTable:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScoringError(f"{path}: is not UTF-8 text (byte {error.start}): save it as CSV in UTF-8") from None
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True, strict=True)
    lines: list[int] = []
    rows: list[list[str]] = []
    names: tuple[str, ...] = ()
    try:
        for row in reader:
            if not any(cell.strip() for cell in row):
                continue
            if not names:
                names = _header(path, row, reader.line_num)
                continue
            if len(row) != len(names):
                where = f"{path}: line {reader.line_num}"
                raise ScoringError(f"{where}: has {len(row)} values, the first line names {len(names)} columns")
            lines.append(reader.line_num)
            rows.append(row)
    except csv.Error as error:
        raise ScoringError(f"{path}: line {reader.line_num}: is not CSV: {error}") from None
    columns = {name: _numbers(path, name, [row[at] for row in rows], lines) for at, name in enumerate(names)}
    return NumberTable(path, names, columns, lines, "line")


def _header(path: Path, cells: list[str], line: int) -> tuple[str, ...]:
    """Names of columns, in the first line that holds anything."""
    names = tuple(cell.strip() for cell in cells)
    for separator, called in ((";", "semicolons"), ("\t", "tabs")):
        if len(names) == 1 and separator in names[0]:
            raise ScoringError(f"{path}: line {line}: is separated by {called}: write commas, and points in numbers")
    _distinct(path, names)
    return names


def _distinct(path: Path, names: tuple[str, ...]) -> None:
    for name in names:
        if not name:
            raise ScoringError(f"{path}: column {names.index(name) + 1} has no name")
        if names.count(name) > 1:
            raise ScoringError(f"{path}: column '{printable(name, LONGEST_CELL)}' is there {names.count(name)} times")
        if _is_number(name):
            raise ScoringError(f"{path}: the first line must name the columns, it begins with {names[0]}")


def _numbers(path: Path, name: str, cells: list[str], lines: Sequence[int]) -> FloatArray | str:
    """Numbers of a column; where a cell holds something else, the message about it."""
    try:
        return np.array([cell if cell.strip() else "nan" for cell in cells], dtype=str).astype(np.float64)
    except ValueError:
        at = next(at for at, cell in enumerate(cells) if cell.strip() and not _is_number(cell))
        return f"{path}: line {lines[at]}: {name} must be a number, not '{printable(cells[at], LONGEST_CELL)}'"


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _parquet(path: Path, content: bytes) -> NumberTable:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.ParquetFile(io.BytesIO(content)).read()
    except (pa.ArrowException, OSError) as error:
        raise ScoringError(f"{path}: is not a readable Parquet file: {error}") from error
    names = tuple(table.column_names)
    _distinct(path, names)
    columns: dict[str, FloatArray | str] = {}
    for name in names:
        kind = table.schema.field(name).type
        if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind):
            values = table.column(name).cast(pa.float64(), safe=False)
            columns[name] = np.asarray(values.to_numpy(), dtype=np.float64)
        else:
            columns[name] = f"{path}: column '{name}' must hold numbers, not {kind}"
    return NumberTable(path, names, columns, range(1, table.num_rows + 1), "row")
