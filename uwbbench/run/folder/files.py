"""Writing files whole or not at all, and turning what the disk says into one clear message."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uwbbench.api.bounds import check_columns
from uwbbench.api.errors import CaptureError, StoreError
from uwbbench.api.text import one_line
from uwbbench.run.folder.identity import plain

if TYPE_CHECKING:
    import pyarrow as pa

_FACTS = b"uwbbench"


@contextmanager
def disk_errors(path: Path, verb: str) -> Iterator[None]:
    """Turn an operating system error into a :class:`StoreError` that names the path.

    What is to be read must be a file or a folder: a device or a pipe may never end.
    """
    try:
        if verb == "read" and path.exists() and not (path.is_file() or path.is_dir()):
            raise StoreError(f"{path}: cannot be read: is neither a file nor a folder")
        yield
    except OSError as error:
        raise StoreError(f"{path}: cannot be {verb}: {one_line(error.strerror or error)}") from error


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a path to write to, and put the file into its place when it is complete and on disk.

    Raises
    ------
    StoreError
        If it cannot be written: the old file, if any, is still there.
    """
    partial = path.with_name(f".{path.name}.part")
    try:
        with disk_errors(path, "written"):
            path.parent.mkdir(parents=True, exist_ok=True)
            yield partial
            with partial.open("rb") as file:
                os.fsync(file.fileno())
            partial.replace(path)
    finally:
        if partial.exists():
            partial.unlink()


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with replacing(path) as partial:
        partial.write_bytes(text.encode("utf-8", "backslashreplace"))


def write_json(path: Path, value: Any) -> None:
    """Write plain values as JSON, whole or not at all."""
    write_text(path, json.dumps(plain(value), indent=2, allow_nan=False) + "\n")


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises
    ------
    StoreError
        If it is missing or broken.
    """
    with disk_errors(path, "read"):
        content = path.read_bytes()
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{path}: is not valid JSON: {error}") from error


def write_parquet(path: Path, table: pa.Table, facts: Any) -> None:
    """Write a table, with plain values about it in the file's own metadata.

    Parameters
    ----------
    path : Path
        Replaced once the file is complete.
    table : pyarrow.Table
    facts : object
        What :func:`~uwbbench.run.folder.identity.plain` can turn into JSON.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    import pyarrow.parquet as pq

    noted = table.replace_schema_metadata({**(table.schema.metadata or {}), _FACTS: json.dumps(plain(facts)).encode()})
    with replacing(path) as partial:
        pq.write_table(noted, partial)


def read_parquet(path: Path) -> tuple[pa.Table, Any]:
    """Read a table and the plain values about it.

    Raises
    ------
    StoreError
        If the file is missing or broken.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with disk_errors(path, "read"):
            # Not read_table(path): that takes "key=value" folders above the file for columns.
            # One thread: the files of a run are many and small, and a thread for each column costs more than it reads.
            file = pq.ParquetFile(path)
            check_columns(path, file.metadata)
            table = file.read(use_threads=False)
    except CaptureError as error:
        raise StoreError(str(error)) from error
    except pa.ArrowException as error:
        raise StoreError(f"{path}: is not a readable Parquet file: {one_line(error)}") from error
    return table, json.loads((table.schema.metadata or {}).get(_FACTS, b"{}"))
