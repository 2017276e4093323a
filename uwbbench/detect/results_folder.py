"""What another program has found, in a folder of results files: a detector without stages."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from uwbbench.api.capture import Capture
from uwbbench.api.drive import Drive
from uwbbench.api.errors import ScoringError, nearest
from uwbbench.config.detector import DetectorConfig
from uwbbench.config.identity import RESULTS, detector_identity
from uwbbench.detect import trajectory_file
from uwbbench.detect.results_file import SUFFIXES, ResultsFile, content_of, read_results
from uwbbench.detect.trajectory_file import read_trajectory
from uwbbench.detect.tum import SUFFIX as TUM


class ResultsFolder:
    """Results files of one detector, in a folder of the dataset's label or beside it.

    They are ``CAPTURE.csv`` or ``.parquet``; of a detector of runs ``RUN.tum``.

    Parameters
    ----------
    config : DetectorConfig
        With the folder as ``results``.

    Raises
    ------
    ValueError
        If it names no folder.
    """

    def __init__(self, config: DetectorConfig) -> None:
        if config.results is None:
            raise ValueError(f"detector '{config.name}' has stages, and no folder of results")
        self.config, self.folder = config, config.results
        self.suffixes = (TUM,) if config.trajectories else SUFFIXES

    def file_of(self, dataset: str, capture: str) -> Path:
        """File about a capture.

        Parameters
        ----------
        dataset : str
            Label of the dataset; its folder is searched first.
        capture : str
            Name of the capture in the dataset.

        Raises
        ------
        ScoringError
            If there is none, or more than one in the same folder, or the name leads out of the folder.
        """
        for stem in (self.folder / dataset / capture, self.folder / capture):
            tried = [stem.with_name(f"{stem.name}{suffix}") for suffix in self.suffixes]
            there = [path for path in tried if path.is_file()]
            if len(there) > 1:
                raise ScoringError(f"{there[0]}: {there[1].name} lies beside it; keep one of them")
            if there and not there[0].resolve().is_relative_to(self.folder.resolve()):
                raise ScoringError(f"{there[0]}: lies outside the folder of results {self.folder}")
            if there:
                return there[0]
        stems = [path.stem for suffix in self.suffixes for path in self.folder.glob(f"*{suffix}")]
        kinds = "TUM" if self.config.trajectories else "CSV or Parquet"
        hint = nearest(capture, stems) if stems else f" No {kinds} file is there."
        names = " or ".join(f"{capture}{suffix}" for suffix in self.suffixes)
        what = "run" if self.config.trajectories else "capture"
        raise ScoringError(f"{self.folder}: no results for {what} '{capture}' of '{dataset}': no {names}.{hint}")

    def read(self, dataset: str, capture: str, opened: Capture | Drive) -> ResultsFile:
        """What the file about a capture or a run holds.

        Parameters
        ----------
        dataset, capture : str
            As in :meth:`file_of`.
        opened : Capture or Drive

        Raises
        ------
        ScoringError
            If there is no such file, or something in it cannot be right.
        """
        path = self.file_of(dataset, capture)
        return read_trajectory(path, opened) if isinstance(opened, Drive) else read_results(path, opened)

    def content(self, dataset: str, capture: str) -> str:
        """SHA-256 of the file about a capture; empty where it cannot be read.

        Parameters
        ----------
        dataset, capture : str
            As in :meth:`file_of`.
        """
        try:
            path = self.file_of(dataset, capture)
            return trajectory_file.content_of(path) if self.config.trajectories else content_of(path)
        except ScoringError:  # the unit itself will fail in the same way, and say so
            return ""

    def source(self, captures: Iterable[tuple[str, str]]) -> dict[str, str]:
        """SHA-256 of all that the folder holds about some captures, by the name that it has among sources.

        Parameters
        ----------
        captures : iterable of (str, str)
            Label of the dataset and name of the capture.
        """
        digest = hashlib.sha256()
        for dataset, capture in captures:
            digest.update("\0".join((dataset, capture, self.content(dataset, capture))).encode() + b"\n")
        return {f"{RESULTS}{self.config.name}": digest.hexdigest()}

    def identity(self, sha256: str) -> str:
        """Identity of the detector on a capture whose file has this content."""
        return detector_identity(self.config.to_dict(), {f"{RESULTS}{self.config.name}": sha256})
