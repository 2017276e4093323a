"""Poses and maps on disk: a table of poses, and a file of named arrays in which nothing but arrays is read."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uwbbench.api.arrays import FloatArray
from uwbbench.api.bounds import check_unfolded
from uwbbench.api.errors import CaptureError, StoreError
from uwbbench.api.mapper import LANDMARK_KINDS, Grid, Landmarks, Map, Mapped, Poses
from uwbbench.run.folder.files import disk_errors, read_parquet, replacing, write_parquet

_POSE = ("x_m", "y_m", "yaw_rad")
_COVARIANCE = tuple((row, column) for row in range(3) for column in range(row, 3))
"""Upper triangle, row after row, as ``covariance_ROW_COLUMN``."""

_LANDMARKS = {"identity": "i", "kind": "i", "a": "f", "b": "f", "covariance": "f", "support": "i"}
_SHAPES: Mapping[str, tuple[str, tuple[int | None, ...]]] = {
    **{
        f"landmark_{name}": (kind, (None, 2, 2) if name == "covariance" else (None,))
        for name, kind in _LANDMARKS.items()
    },
    "segments_m": ("f", (None, 2, 2)),
    "points_m": ("f", (None, 2)),
}
_GRID: Mapping[str, tuple[str, tuple[int | None, ...]]] = {
    "grid_origin_m": ("f", (2,)),
    "grid_cell_m": ("f", ()),
    "grid_log_odds": ("f", (None, None)),
}
"""Kind of number and shape of each array of a map, and of those of its grid, which need not be there."""


def write_mapped(poses: Path, map_: Path, made: Mapped, time_s: FloatArray) -> None:
    """Store poses and map of a mapper.

    Parameters
    ----------
    poses, map_ : Path
        A file each.
    made : Mapped
    time_s : (steps,) array
        Of the run.
    """
    write_poses(poses, made, time_s)
    write_map(map_, made.map)


def read_mapped(poses: Path, map_: Path) -> Mapped:
    """Stored poses and map.

    Raises
    ------
    StoreError
        As :func:`read_poses` and :func:`read_map`.
    """
    on_the_way, smoothed = read_poses(poses)
    return Mapped(on_the_way, read_map(map_), smoothed)


def write_poses(path: Path, mapped: Mapped, time_s: FloatArray) -> None:
    """Store the poses of a run, those handed out on the way and the smoothed ones, in one table.

    Parameters
    ----------
    path : Path
    mapped : Mapped
    time_s : (steps,) array
        Of the run.
    """
    import pyarrow as pa

    parts = [mapped.poses] if mapped.smoothed is None else [mapped.poses, mapped.smoothed]
    known = [part.covariance is not None for part in parts]
    poses = np.concatenate([part.pose for part in parts])
    index = np.concatenate([part.index for part in parts])
    columns: dict[str, Any] = {
        "smoothed": np.repeat(np.arange(len(parts)) == 1, [len(part) for part in parts]),
        "index": index,
        "time_s": time_s[index],
    }
    columns |= {name: poses[:, place] for place, name in enumerate(_POSE)}
    if any(known):
        unknown = [np.full((len(part), 3, 3), np.nan) for part in parts]
        spread = [
            none if part.covariance is None else part.covariance for part, none in zip(parts, unknown, strict=True)
        ]
        every = np.concatenate(spread)
        columns |= {f"covariance_{row}_{column}": every[:, row, column] for row, column in _COVARIANCE}
    write_parquet(path, pa.table(columns), {"covariance": known})


def read_poses(path: Path) -> tuple[Poses, Poses | None]:
    """Poses handed out on the way, and the smoothed ones where there are any.

    Raises
    ------
    StoreError
        If the file is missing, broken or no table of poses.
    """
    table, facts = read_parquet(path)
    try:
        names = ["smoothed", "index", *_POSE]
        known = [bool(one) for one in facts["covariance"]]
        if any(known):
            names += [f"covariance_{row}_{column}" for row, column in _COVARIANCE]
        columns = {name: table.column(name).to_numpy() for name in names}
        smoothed, index = columns["smoothed"].astype(bool), columns["index"].astype(np.int64)
        pose = np.column_stack([columns[name] for name in _POSE]).astype(np.float64)
        covariance = np.full((len(index), 3, 3), np.nan)
        for row, column in _COVARIANCE if any(known) else ():
            covariance[:, row, column] = covariance[:, column, row] = columns[f"covariance_{row}_{column}"]
        parts = [
            Poses(index[rows], pose[rows], covariance[rows] if sure else None)
            for rows, sure in zip((~smoothed, smoothed), known, strict=False)
        ]
        return parts[0], parts[1] if len(parts) > 1 else None
    except (KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
        raise StoreError(f"{path}: is no table of poses: {type(error).__name__}: {error}") from error


def write_map(path: Path, found: Map) -> None:
    """Store a map as named arrays.

    Parameters
    ----------
    path : Path
    found : Map
    """
    arrays: dict[str, Any] = {f"landmark_{name}": getattr(found.landmarks, name) for name in _LANDMARKS}
    arrays |= {"segments_m": found.segments_m, "points_m": found.points_m}
    if found.grid is not None:
        arrays |= {f"grid_{name}": getattr(found.grid, name) for name in ("origin_m", "cell_m", "log_odds")}
    kinds = {name: np.int64 if kind == "i" else np.float64 for name, (kind, _) in {**_SHAPES, **_GRID}.items()}
    with replacing(path) as partial, partial.open("wb") as file:
        whole: dict[str, Any] = {name: np.asarray(array, kinds[name]) for name, array in arrays.items()}
        np.savez_compressed(file, **whole)


def read_map(path: Path) -> Map:
    """Stored map. Its arrays are read as numbers alone: no file can make a program out of them.

    Raises
    ------
    StoreError
        If the file is missing or broken, or its arrays are not those of a map.
    """
    try:
        with disk_errors(path, "read"), zipfile.ZipFile(path) as archive:
            check_unfolded(str(path), sum(part.file_size for part in archive.infolist()), path.stat().st_size)
        with disk_errors(path, "read"), path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            expected = {**_SHAPES, **(_GRID if any(name in stored for name in _GRID) else {})}
            missing = [name for name in expected if name not in stored]
            if missing:
                raise StoreError(f"{path}: is no map: it has no array '{missing[0]}'")
            arrays = {name: _array(path, name, stored[name], *expected[name]) for name in expected}
    except (ValueError, KeyError, EOFError, RuntimeError, TypeError, MemoryError) as error:
        raise StoreError(f"{path}: is not a readable map: {type(error).__name__}: {error}") from error
    except (zipfile.BadZipFile, zlib.error) as error:
        raise StoreError(f"{path}: is damaged: {error}") from error
    except CaptureError as error:
        raise StoreError(str(error)) from error
    columns = [arrays[f"landmark_{name}"] for name in _LANDMARKS]
    if len({len(column) for column in columns}) > 1:
        raise StoreError(f"{path}: is no map: the columns of its landmarks differ in length")
    kind = arrays["landmark_kind"]
    if len(kind) and not (kind.min() >= 0 and kind.max() < len(LANDMARK_KINDS)):
        raise StoreError(f"{path}: is no map: landmarks are of the kinds 0 to {len(LANDMARK_KINDS) - 1}")
    grid = None
    if "grid_cell_m" in arrays:
        grid = Grid(arrays["grid_origin_m"], float(arrays["grid_cell_m"]), arrays["grid_log_odds"])
    return Map(Landmarks(*columns), arrays["segments_m"], arrays["points_m"], grid)


def _array(path: Path, name: str, array: Any, kind: str, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Array of a map, refused unless it is of its kind of number and shape."""
    fits = array.ndim == len(shape) and all(want in (None, size) for want, size in zip(shape, array.shape, strict=True))
    if array.dtype.kind != kind or not fits:
        wanted = f"{'whole' if kind == 'i' else 'real'} numbers of shape {_shape(shape)}"
        raise StoreError(f"{path}: is no map: '{name}' must be {wanted}, not {array.dtype} of {_shape(array.shape)}")
    return np.asarray(array, np.int64 if kind == "i" else np.float64)


def _shape(sizes: tuple[int | None, ...]) -> str:
    return f"({', '.join('n' if size is None else str(size) for size in sizes)})"
