"""Writing a site into a folder that holds nothing else of worth.

Conventions
-----------
* A site is written into a folder that is new, empty, or made by this command before, as a marker in it says.
* Only files that the marker lists are replaced or removed. Anything else there, such as a CNAME, stays; where it
  is in the way of a page, nothing is written.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from uwbbench.api.errors import StoreError
from uwbbench.run.folder.files import disk_errors, read_json, write_json, write_text

MARKER = "uwbbench-site.json"
GENERATOR = "uwbbench leaderboard"


def check_site(folder: Path) -> set[str]:
    """Files of an earlier site in a folder.

    Returns
    -------
    set of str
        Addresses; none where the folder is new or empty.

    Raises
    ------
    StoreError
        If the folder holds something else, or is none.
    """
    with disk_errors(folder, "read"):
        if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
            return set()
        if not (folder / MARKER).is_file():
            raise StoreError(f"{folder}: exists and is no site that 'uwbbench leaderboard' made; give another folder")
    marker = read_json(folder / MARKER)
    listed = marker.get("files") if isinstance(marker, dict) and marker.get("generator") == GENERATOR else None
    if not isinstance(listed, list) or not all(isinstance(name, str) and _plain(name) for name in listed):
        raise StoreError(f"{folder / MARKER}: is no list of the files of a site; it was edited")
    return set(listed)


def write_site(folder: Path, files: Mapping[str, str]) -> None:
    """Write a site, and remove pages of an earlier one that are gone.

    Parameters
    ----------
    folder : Path
    files : mapping of str to str
        Text of each file, by its address.

    Raises
    ------
    StoreError
        If the folder holds something else, or a file cannot be written.
    """
    before = check_site(folder)
    for name in files:
        target = folder / name
        with disk_errors(target, "read"):
            if target.is_symlink() or target.parent.is_symlink() or (target.exists() and name not in before):
                raise StoreError(f"{target}: was not made by 'uwbbench leaderboard'; nothing was written")
    # Listed before they are there: after a crash they can be replaced.
    write_json(folder / MARKER, {"generator": GENERATOR, "files": sorted(before | set(files))})
    for name, text in files.items():
        write_text(folder / name, text)
    for name in sorted(before - set(files)):
        old = folder / name
        if not old.parent.is_symlink():
            with disk_errors(old, "removed"):
                old.unlink(missing_ok=True)
    write_json(folder / MARKER, {"generator": GENERATOR, "files": sorted(files)})


def _plain(name: str) -> bool:
    """Whether an address is one that a site has: no way out of the folder."""
    path = PurePosixPath(name)
    return not path.is_absolute() and 1 <= len(path.parts) <= 2 and ".." not in path.parts and "\\" not in name
