"""Files that a host lists at a pinned commit, and the record of the hashes that their first download showed."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from uwbbench.api.dataset import DatasetFile, DatasetFolder
from uwbbench.api.errors import CaptureError

RECORD = "hashes.json"
"""Beside the files: path below the dataset's folder, and the SHA-256 of what the first download brought."""


def read_listing(text: bytes, folder: DatasetFolder) -> list[DatasetFile]:
    """Wanted files of a folder as its host lists them.

    Parameters
    ----------
    text : bytes
        Answer of GitHub's contents API for a folder: a JSON list of objects with ``type``, ``name``, ``size``, ``sha``
        and ``download_url`` (https://docs.github.com/rest/repos/contents).
    folder : DatasetFolder

    Raises
    ------
    CaptureError
        If it is no such list, holds a name that leads elsewhere, or none of the files wanted.
    """
    try:
        entries = json.loads(text)
        files = [_file(one, folder) for one in entries if one["type"] == "file"]
    except (ValueError, TypeError, KeyError) as error:
        raise CaptureError(f"'{folder.name}': {folder.listing} sent no list of files ({error!r})") from error
    wanted = [file for file in files if file.path.endswith(folder.suffixes)]
    if not wanted:
        raise CaptureError(f"'{folder.name}': {folder.listing} lists no file that ends in {', '.join(folder.suffixes)}")
    return wanted


def _file(entry: dict[str, Any], folder: DatasetFolder) -> DatasetFile:
    name = entry["name"]
    if Path(name).name != name or name in (".", "..", RECORD):
        raise ValueError(f"the file name '{name}' is not allowed")
    return DatasetFile(f"{folder.name}/{name}", "", entry["download_url"], int(entry["size"]), entry["sha"])


def with_recorded(file: DatasetFile, target: Path) -> DatasetFile:
    """File with the hash that its first download showed, where there was one.

    Raises
    ------
    CaptureError
        If the record is damaged.
    """
    return replace(file, sha256=_read_record(target).get(file.path, ""))


def record(file: DatasetFile, target: Path) -> None:
    """Check what a first download brought against size and git hash of the commit, and record its SHA-256.

    Git's hash of a file is the SHA-1 of ``blob SIZE``, a zero byte and the content (Pro Git, 2nd ed., section 10.2).

    Raises
    ------
    CaptureError
        If it is not the file of that commit; names both sizes, or both hashes. It is then removed.
    """
    place = target / file.path
    content = place.read_bytes()
    found = hashlib.sha1(b"blob %d\0" % len(content) + content, usedforsecurity=False).hexdigest()
    if (len(content), found) != (file.size, file.git_sha1):
        place.unlink()
        raise CaptureError(
            f"'{file.path}': what {file.url} sent is not the file of that commit: {len(content)} bytes with git hash "
            f"{found} instead of {file.size} with {file.git_sha1}; it was not kept"
        )
    hashes = _read_record(target) | {file.path: hashlib.sha256(content).hexdigest()}
    written = target / f"{RECORD}.new"
    written.write_text(json.dumps(hashes, indent=2, sort_keys=True) + "\n")
    written.replace(target / RECORD)


def _read_record(target: Path) -> dict[str, str]:
    try:
        hashes = json.loads((target / RECORD).read_text())
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise CaptureError(
            f"{target / RECORD}: cannot be read ({error}); delete it to record the hashes anew"
        ) from error
    if not isinstance(hashes, dict) or not all(isinstance(value, str) for value in hashes.values()):
        raise CaptureError(f"{target / RECORD}: not a mapping of paths to hashes; delete it to record them anew")
    return hashes
