"""Files that a glob pattern matches, found without looking at more of the disk than a recording can be on."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

from uwbbench.api import CaptureError

MOST_SEEN = 200_000
"""Files and folders that are looked at for one pattern."""
_MAGIC = re.compile(r"[*?[]")


def matching_files(folder: Path, pattern: str) -> list[str]:
    """Files that a pattern matches.

    As :func:`glob.glob` finds them: ``**`` is any number of folders, and what is hidden is passed over.

    Parameters
    ----------
    folder : Path
        Where a relative pattern begins.
    pattern : str

    Returns
    -------
    list of str
        Sorted; relative to the folder unless the pattern is absolute.

    Raises
    ------
    CaptureError
        If it takes a look at more than :data:`MOST_SEEN` files and folders.
    """
    wanted = Path(pattern)
    found = _Search(folder, pattern).below(wanted.anchor, wanted.parts[1:] if wanted.anchor else wanted.parts)
    return sorted({path for path in found if (folder / path).is_file()})


class _Search:
    """One search, which counts what it looks at."""

    def __init__(self, folder: Path, pattern: str) -> None:
        self.folder, self.pattern, self.seen = folder, pattern, 0

    def below(self, place: str, parts: tuple[str, ...]) -> Iterator[str]:
        """Paths below a folder that match the rest of the pattern."""
        if not parts:
            yield place
        elif parts[0] == "**":
            yield from self.below(place, parts[1:] or ("*",))
            for entry in self._entries(place):
                if not entry.name.startswith(".") and _is_folder(entry):
                    yield from self.below(os.path.join(place, entry.name), parts)  # noqa: PTH118
        elif _MAGIC.search(parts[0]):
            for entry in self._entries(place):
                hidden = entry.name.startswith(".") and not parts[0].startswith(".")
                if not hidden and fnmatchcase(entry.name, parts[0]):
                    yield from self.below(os.path.join(place, entry.name), parts[1:])  # noqa: PTH118
        else:
            yield from self.below(os.path.join(place, parts[0]), parts[1:])  # noqa: PTH118

    def _entries(self, place: str) -> Iterator[os.DirEntry[str]]:
        try:
            with os.scandir(self.folder / place) as entries:
                for entry in entries:
                    self.seen += 1
                    if self.seen > MOST_SEEN:
                        raise CaptureError(
                            f"'{self.pattern}': more than {MOST_SEEN} files and folders would have to be looked at in "
                            f"{self.folder / Path(self.pattern).anchor}; name the folder of the recordings"
                        )
                    yield entry
        except OSError:  # no folder, or none that may be looked into
            return


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link that leads back to itself
        return False
