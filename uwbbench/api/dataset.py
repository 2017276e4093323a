"""What a dataset adapter declares and hands out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Generic, Literal

from uwbbench.api.capture import Capture
from uwbbench.api.drive import Drive
from uwbbench.api.errors import CaptureError
from uwbbench.api.stage import P, Params, params_type_of


@dataclass(frozen=True)
class DatasetFile:
    """One file that a dataset is made of.

    Attributes
    ----------
    path : str
        Below the dataset's folder.
    sha256 : str
        Hash of the file as published; empty where it is not known before the first download.
    url : str
        Where it can be downloaded, pinned to a commit or version.
    size : int or None
        Bytes, where the host says so.
    git_sha1 : str
        Git's own hash of the content at that commit, where the host says so: what a first download is checked against.
    """

    path: str
    sha256: str
    url: str
    size: int | None = None
    git_sha1: str = ""


@dataclass(frozen=True)
class DatasetFolder:
    """Files published beside a dataset's own, which are downloaded only when they are asked for.

    Nobody has vouched for their hashes yet: the host lists them at a pinned commit, with size and git hash, and the
    SHA-256 of what a user's first download brought is recorded on his disk and holds from then on.

    Attributes
    ----------
    name : str
        What the user asks for, and the folder below the dataset's that the files go to.
    listing : str
        Address of the list, pinned to a commit: JSON as GitHub's contents API answers it
        (https://docs.github.com/rest/repos/contents).
    suffixes : tuple of str
        Endings of the files that are wanted.
    """

    name: str
    listing: str
    suffixes: tuple[str, ...]


@dataclass(frozen=True)
class Card:
    """Where a dataset comes from.

    Attributes
    ----------
    title, license, citation, source : str
        ``source`` is a public page or repository with its pinned commit.
    folder : str
        Name of the folder that holds the files below the data directory.
    files : tuple of DatasetFile
        What ``uwbbench fetch`` downloads; empty where the user brings the files.
    origin : {"measured", "simulated"}
    more : tuple of DatasetFolder
        What ``uwbbench fetch --more`` downloads besides.
    """

    title: str
    license: str
    citation: str
    source: str
    folder: str = ""
    files: tuple[DatasetFile, ...] = field(default=())
    origin: Literal["measured", "simulated"] = "measured"
    more: tuple[DatasetFolder, ...] = field(default=())


class Dataset(Generic[P]):
    """An adapter from recordings to captures.

    Parameters
    ----------
    params : Params
        Checked parameters from the experiment.
    roots : sequence of Path
        Folders searched, in this order, for the card's folder and for relative paths of the parameters.
    """

    card: ClassVar[Card]

    def __init__(self, params: P, roots: Sequence[Path]) -> None:
        self.params: P = params
        self.roots = tuple(roots)

    @classmethod
    def params_type(cls) -> type[Params]:
        """Pydantic model of the parameters."""
        return params_type_of(cls, Dataset)

    def names(self) -> list[str]:
        """Names of the captures, found without reading them."""
        raise NotImplementedError

    def scene(self, name: str) -> str:
        """Scene or set-up that a capture is of, by the capture's name; captures of one scene repeat one another.

        Evidence is counted in scenes. Unless an adapter says otherwise, each capture is of a scene of its own.
        """
        return name

    def open(self, name: str) -> Capture:
        """Read one capture.

        Raises
        ------
        CaptureError
            If its files are missing or broken; the message names the file.
        """
        raise NotImplementedError

    def runs(self) -> dict[str, tuple[str, ...]]:
        """Names of the captures of each run: of the receivers of one drive of one robot, found without reading them.

        Unless an adapter says otherwise, each capture is a run of its own.
        """
        return {name: (name,) for name in self.names()}

    def open_run(self, name: str, captures: Sequence[str]) -> Drive:
        """Read captures of one run.

        Parameters
        ----------
        name : str
            Of the run.
        captures : sequence of str
            Those of its captures that are wanted.

        Raises
        ------
        CaptureError
            If files are missing or broken, or the captures are of no one run.
        """
        return Drive(name, tuple(self.open(capture) for capture in captures))

    def file(self, path: str) -> Path:
        """One of the dataset's files on disk: in one of the roots, or in the card's folder below it.

        Raises
        ------
        CaptureError
            If it is in none of them, or the path leads out of them.
        """
        if Path(path).is_absolute() or ".." in Path(path).parts:
            raise CaptureError(f"dataset file '{path}' must lie below the dataset's folder")
        for root in self.roots:
            for folder in (root / self.card.folder, root):
                if (folder / path).is_file():
                    return folder / path
        searched = ", ".join(str(root) for root in self.roots)
        raise CaptureError(
            f"dataset file '{Path(self.card.folder) / path}' is not in {searched}: "
            f"point --data-dir or UWBBENCH_DATA at its folder, or download it with 'uwbbench fetch'"
        )
