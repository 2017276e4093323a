"""What a dataset adapter declares and hands out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Generic, Literal

from uwbbench.api.capture import Capture
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
        Hash of the file as published.
    url : str
        Where it can be downloaded, pinned to a commit or version.
    """

    path: str
    sha256: str
    url: str


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
    """

    title: str
    license: str
    citation: str
    source: str
    folder: str = ""
    files: tuple[DatasetFile, ...] = field(default=())
    origin: Literal["measured", "simulated"] = "measured"


class Dataset(Generic[P]):
    """An adapter from recordings to captures.

    Parameters
    ----------
    params : Params
        Checked parameters from the experiment.
    root : Path
        Where relative paths of the parameters start, and where the card's folder lies.
    """

    card: ClassVar[Card]

    def __init__(self, params: P, root: Path) -> None:
        self.params: P = params
        self.root = root

    @classmethod
    def params_type(cls) -> type[Params]:
        """Pydantic model of the parameters."""
        return params_type_of(cls, Dataset)

    def names(self) -> list[str]:
        """Names of the captures, found without reading them."""
        raise NotImplementedError

    def open(self, name: str) -> Capture:
        """Read one capture.

        Raises
        ------
        CaptureError
            If its files are missing or broken; the message names the file.
        """
        raise NotImplementedError

    def file(self, path: str) -> Path:
        """One of the card's files on disk: in the data directory itself or in the dataset's folder below it."""
        for folder in (self.root / self.card.folder, self.root):
            if (folder / path).is_file():
                return folder / path
        raise CaptureError(
            f"dataset file '{self.card.folder}/{path}' is not in {self.root}: "
            f"point --data-dir or UWBBENCH_DATA at it, or download it with 'uwbbench fetch'"
        )
