"""Named columns of CSV, Parquet, NPZ, MAT and HDF5 files as arrays.

A column is one value or one array a frame. Fields of MATLAB structures are named ``structure.field``, arrays in HDF5
groups ``group/array``.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api import CaptureError, check_columns, check_unfolded, in_child, nearest

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Recording:
    """An opened table.

    Attributes
    ----------
    path : Path
    names : tuple of str
        Its columns.
    """

    path: Path
    names: tuple[str, ...]
    _read: Callable[[list[str]], Columns]

    def read(self, names: Sequence[str]) -> Columns:
        """Columns by name, as arrays whose first axis is usually the frame.

        Raises
        ------
        CaptureError
            If the file is damaged.
        """
        try:
            return self._read(list(dict.fromkeys(names)))
        except CaptureError:
            raise
        except Exception as error:  # each format's library raises what it likes on a damaged file
            raise CaptureError(f"{self.path}: cannot be read: {error}") from error


def open_recording(path: Path, delimiter: str = ",") -> Recording:
    """Open a table; the suffix of its name gives the format.

    Raises
    ------
    CaptureError
        If the format is unknown or the file damaged.
    """
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        raise CaptureError(f"{path}: '{suffix}' is no format of a table.{nearest(suffix, _FORMATS)}")
    try:
        names, read = _FORMATS[suffix](path, delimiter)
    except CaptureError:
        raise
    except Exception as error:  # each format's library raises what it likes on a damaged file
        raise CaptureError(f"{path}: not a readable {suffix} file: {type(error).__name__}: {error}") from error
    return Recording(path, tuple(names), read)


_Opened = tuple[Sequence[str], Callable[[list[str]], Columns]]


def _open_csv(path: Path, delimiter: str) -> _Opened:
    import pandas as pd

    names = [str(name) for name in pd.read_csv(path, sep=delimiter, nrows=0, skipinitialspace=True).columns]

    def read(wanted: list[str]) -> Columns:
        table = pd.read_csv(path, sep=delimiter, usecols=wanted, skipinitialspace=True, low_memory=False)
        return {name: table[name].to_numpy() for name in wanted}

    return names, read


def _open_parquet(path: Path, _: str) -> _Opened:
    """In a child, as the library ends its process over some damaged files."""
    from pyarrow import parquet  # here, so that not each child has to

    def names() -> list[str]:
        file = parquet.ParquetFile(path)
        check_columns(path, file.metadata)
        return list(file.schema_arrow.names)

    def read(wanted: list[str]) -> Columns:
        table = parquet.ParquetFile(path).read(columns=wanted, use_threads=False).to_pandas(use_threads=False)
        return {name: table[name].to_numpy() for name in wanted}

    return in_child(path, names), lambda wanted: in_child(path, lambda: read(wanted))


def _open_npz(path: Path, _: str) -> _Opened:
    def read(wanted: list[str]) -> Columns:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in wanted}

    with zipfile.ZipFile(path) as archive:
        check_unfolded(str(path), sum(part.file_size for part in archive.infolist()), path.stat().st_size)
    with np.load(path, allow_pickle=False) as file:
        return list(file.files), read


def _open_mat(path: Path, _: str) -> _Opened:
    """MATLAB 5 to 7.2 through scipy; 7.3 is HDF5 with MATLAB's conventions."""
    import h5py
    import scipy.io  # here, so that not each child has to  # noqa: F401

    if h5py.is_hdf5(path):
        return _open_mat73(path)
    flat = in_child(path, lambda: _variables(path))
    return list(flat), lambda wanted: {name: flat[name] for name in wanted}


def _variables(path: Path) -> Columns:
    """All that a MATLAB 5 file holds."""
    from scipy.io import loadmat

    flat: Columns = {}
    for name, value in loadmat(path).items():
        if not name.startswith("__"):
            _flatten(name, value, flat)
    return flat


def _flatten(name: str, value: Any, into: Columns) -> None:
    """Fields of a structure as columns; cells and text as plain objects."""
    array = np.asarray(value)
    if array.dtype.names and array.size == 1:
        for field in array.dtype.names:
            _flatten(f"{name}.{field}", array[field].item(), into)
    elif array.dtype == object:
        cells = [np.asarray(cell) for cell in array.ravel()]
        into[name] = np.array([cell.item() if cell.size == 1 else cell for cell in cells], dtype=object)
    else:
        into[name] = array


def _open_mat73(path: Path) -> _Opened:
    import h5py

    def plain(file: Any, item: Any) -> np.ndarray:
        values = _sound(path, item)[()]
        if h5py.check_ref_dtype(item.dtype):  # a cell array
            cells = [plain(file, file[reference]) for reference in np.ravel(values)]
            return np.array([cell.item() if cell.size == 1 else cell for cell in cells], dtype=object)
        if item.attrs.get("MATLAB_class") == b"char":
            return np.array("".join(chr(code) for code in np.ravel(values)))
        if values.dtype.names == ("real", "imag"):
            values = values["real"] + 1j * values["imag"]
        return np.asarray(values).T  # MATLAB stores columns first

    def read(wanted: list[str]) -> Columns:
        with h5py.File(path, "r") as file:
            return {name: plain(file, file[name.replace(".", "/")]) for name in wanted}

    names = [name.replace("/", ".") for name in _arrays_in(path) if not name.startswith("#")]
    return names, lambda wanted: in_child(path, lambda: read(wanted))


def _open_hdf5(path: Path, _: str) -> _Opened:
    import h5py

    def read(wanted: list[str]) -> Columns:
        with h5py.File(path, "r") as file:
            items = {name: _sound(path, file[name]) for name in wanted}
            return {
                name: np.asarray(item.asstr()[()] if h5py.check_string_dtype(item.dtype) else item[()])
                for name, item in items.items()
            }

    return _arrays_in(path), lambda wanted: in_child(path, lambda: read(wanted))


def _arrays_in(path: Path) -> list[str]:
    """Arrays of an HDF5 file by path; links out of the file are not followed."""
    import h5py

    def found() -> list[str]:
        names: list[str] = []
        with h5py.File(path, "r") as file:
            file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        return names

    return in_child(path, found)


def _sound(path: Path, item: Any) -> Any:
    """An array of an HDF5 file that lies in it and is not far larger than it."""
    if item.external or item.is_virtual:
        raise CaptureError(f"{path}: {item.name}: the array lies in another file; it must lie in this one")
    stored = path.stat().st_size if item.chunks is None else item.id.get_storage_size()
    check_unfolded(f"{path}: {item.name}", item.size * item.dtype.itemsize, stored)
    return item


_FORMATS: dict[str, Callable[[Path, str], _Opened]] = {
    ".csv": _open_csv,
    ".tsv": _open_csv,
    ".txt": _open_csv,
    ".parquet": _open_parquet,
    ".npz": _open_npz,
    ".mat": _open_mat,
    ".h5": _open_hdf5,
    ".hdf5": _open_hdf5,
}
