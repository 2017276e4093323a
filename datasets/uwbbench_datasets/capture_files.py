"""Capture files of one's own, by path or glob pattern."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import ClassVar

from pydantic import Field

from uwbbench.api import Capture, CaptureError, Card, Dataset, Params, list_receivers, nearest, open_capture
from uwbbench_datasets.matching import matching_files


def find_files(patterns: Iterable[str], folders: Sequence[Path]) -> list[Path]:
    """Files that patterns match, each once, in the order of the patterns.

    Parameters
    ----------
    patterns : iterable of str
        Paths or glob patterns; ``**`` stands for any number of folders. A relative one is tried in each folder in
        turn, and the first folder with a match wins.
    folders : sequence of Path

    Returns
    -------
    list of Path
        Absolute paths; the matches of one pattern are sorted.

    Raises
    ------
    CaptureError
        If a pattern matches no file; names the pattern and the folders that were searched.
    """
    paths: dict[Path, None] = {}
    for pattern in patterns:
        if "\0" in pattern:
            raise CaptureError(f"{pattern!r} names no file: it holds a NUL character")
        wanted = Path(pattern).expanduser()
        places = [Path()] if wanted.is_absolute() else folders
        matches = next((hits for folder in places if (hits := _matches(folder, wanted))), [])
        if not matches:
            searched = "" if wanted.is_absolute() else f" in {', '.join(map(str, folders)) or 'no folder at all'}"
            raise CaptureError(f"no file matches '{pattern}'{searched}")
        paths.update(dict.fromkeys(matches))
    return list(paths)


def _matches(folder: Path, wanted: Path) -> list[Path]:
    if (folder / wanted).is_file():  # also a name that happens to hold glob characters
        return [(folder / wanted).resolve()]
    return [(folder / hit).resolve() for hit in matching_files(folder, str(wanted))]


def short_names(files: Sequence[Path]) -> dict[str, Path]:
    """Files by their stems, with as many parent folders in front as it takes to separate equal stems."""
    named: dict[str, Path] = {}
    for file in files:
        parts = file.with_suffix("").parts
        others = [other.with_suffix("").parts for other in files if other != file]
        depths = (depth for depth in range(1, len(parts)) if all(o[-depth:] != parts[-depth:] for o in others))
        depth = next(depths, None)
        named["/".join(parts[-depth:]) if depth else str(file)] = file  # x.h5 beside x.hdf5 differ in nothing else
    return named


class CaptureFilesParams(Params):
    """Which files."""

    files: list[str] = Field(
        min_length=1, description="Paths or glob patterns of capture files; ** stands for any number of folders."
    )
    receiver: str | None = Field(None, description="Only this receiver; all receivers of each file if left out.")


class CaptureFiles(Dataset[CaptureFilesParams]):
    """Capture files of one's own.

    A capture is named after its file, ``stem`` or, where the file has several receivers, ``stem/receiver``; where two
    files have the same stem, their folders separate them. A file is one run of its receivers. A broken file is listed
    like any other, so that it shows up in results as a failure with its reason.
    """

    card: ClassVar[Card] = Card(
        title="Capture files of the user",
        license="as stated in each file",
        citation="as stated in each file",
        source="the user's own files",
    )

    @cached_property
    def _files(self) -> dict[str, Path]:
        return short_names(find_files(self.params.files, self.roots))

    def names(self) -> list[str]:
        """One capture for each receiver of each file.

        Raises
        ------
        CaptureError
            If a pattern matches no file.
        """
        return [name for captures in self.runs().values() for name in captures]

    def runs(self) -> dict[str, tuple[str, ...]]:
        """One run a file, with a capture for each of its receivers.

        Raises
        ------
        CaptureError
            If a pattern matches no file.
        """
        return {stem: self._captures(stem, file) for stem, file in self._files.items()}

    def _captures(self, stem: str, file: Path) -> tuple[str, ...]:
        try:
            receivers = list_receivers(file)
        except CaptureError:
            return (stem,)  # opening it raises the error
        wanted = [name for name in receivers if self.params.receiver in (None, name)]
        return tuple(f"{stem}/{name}" for name in wanted) if len(receivers) > 1 and wanted else (stem,)

    def scene(self, name: str) -> str:
        """The file: what several receivers on one robot saw together is one recording."""
        return name if name in self._files else name.rpartition("/")[0]

    def open(self, name: str) -> Capture:
        """Open one receiver of one file.

        Raises
        ------
        CaptureError
            If there is no such capture, or its file is broken; names the file and what is wrong in it.
        """
        if name in self._files:
            return open_capture(self._files[name], self.params.receiver)
        stem, _, receiver = name.rpartition("/")
        if stem not in self._files or self.params.receiver not in (None, receiver):
            raise CaptureError(f"no capture named '{name}'.{nearest(name, self.names())}")
        return open_capture(self._files[stem], receiver)
