"""Downloads of the measured datasets, checked against the hashes in their cards."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

from uwbbench.api import registry
from uwbbench.api.dataset import Card, DatasetFile
from uwbbench.api.errors import CaptureError
from uwbbench.config.source import cache_folder

TIMEOUT_S = 30.0

Progress = Callable[[DatasetFile, int, int], None]
"""Called before each file with the file, how many are done, and how many there are."""


def fetch(name: str, folder: Path | None = None, progress: Progress | None = None) -> Path:
    """Download the files of a dataset that are not yet there.

    Files whose hash already fits are not downloaded again, so that calling it twice resumes.

    Parameters
    ----------
    name : str
        Registered dataset.
    folder : Path, optional
        Data directory that gets the card's folder; by default the cache, where every run searches.
    progress : callable, optional
        Called with what comes next; nothing is printed here.

    Returns
    -------
    Path
        The dataset's folder.

    Raises
    ------
    PluginError
        If there is no such dataset.
    CaptureError
        If the dataset has nothing to download, a file cannot be had or written, or its hash is wrong: such a file is
        not kept.
    """
    card: Card = registry.load_plugin("datasets", name).card
    if not card.files:
        raise CaptureError(f"dataset '{name}' has nothing to download: its source is {card.source}")
    target = (folder or cache_folder()) / card.folder
    for done, file in enumerate(card.files):
        if progress is not None:
            progress(file, done, len(card.files))
        _fetch_file(name, card, file, target)
    return target


def _fetch_file(name: str, card: Card, file: DatasetFile, target: Path) -> None:
    import pooch

    place = target / file.path
    by_hand = f"You can also take it from {card.source} and put it in {place.parent}."
    if not file.url:
        if not (place.is_file() and pooch.file_hash(place) == file.sha256):
            raise CaptureError(f"'{file.path}' of dataset '{name}' has no direct download address. {by_hand}")
        return
    logger: logging.Logger = pooch.get_logger()
    level = logger.level
    logger.setLevel(logging.WARNING)  # pooch announces each download on the terminal
    try:
        pooch.retrieve(
            file.url,
            known_hash=f"sha256:{file.sha256}",
            fname=place.name,
            path=place.parent,
            downloader=pooch.HTTPDownloader(timeout=TIMEOUT_S),
        )
    except OSError as error:  # what requests raises derives from it, too
        raise CaptureError(
            f"'{file.path}' of dataset '{name}' cannot be downloaded from {file.url}: {_reason(error)}. {by_hand}"
        ) from error
    except ValueError as error:
        raise CaptureError(
            f"'{file.path}' of dataset '{name}': what {file.url} sent is not the published file, "
            f"whose SHA-256 is {file.sha256}; it was not kept"
        ) from error
    finally:
        logger.setLevel(level)


def _reason(error: OSError) -> str:
    """Short cause: the server's answer, the disk's complaint, or that there was no answer."""
    response = getattr(error, "response", None)
    if response is not None:
        return f"the server answered {response.status_code} {response.reason}"
    return error.strerror or "no connection to the server"
