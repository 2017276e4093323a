"""Downloads of the measured datasets, checked against the hashes in their cards, or against the commit they are of."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from uwbbench.api import registry
from uwbbench.api.dataset import Card, DatasetFile, DatasetFolder
from uwbbench.api.errors import CaptureError, ConfigError, nearest
from uwbbench.config.source import cache_folder
from uwbbench.tools.listing import read_listing, record, with_recorded

TIMEOUT_S = 30.0

Progress = Callable[[DatasetFile, int, int], None]
"""Called before each file with the file, how many are done, and how many there are."""


def fetch(name: str, folder: Path | None = None, progress: Progress | None = None, more: Sequence[str] = ()) -> Path:
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
    more : sequence of str
        Folders of the card's ``more`` to bring as well, or ``all``. No hash of theirs is published: a first download is
        checked against size and git hash of the pinned commit and its SHA-256 recorded; later ones are checked against
        that.

    Returns
    -------
    Path
        The dataset's folder.

    Raises
    ------
    PluginError
        If there is no such dataset.
    ConfigError
        If there is no such folder.
    CaptureError
        If the dataset has nothing to download, a file cannot be had or written, or its hash is wrong: such a file is
        not kept.
    """
    card: Card = registry.load_plugin("datasets", name).card
    if not card.files:
        raise CaptureError(f"dataset '{name}' has nothing to download: its source is {card.source}")
    target = (folder or cache_folder()) / card.folder
    folders = {each.name: each for each in card.more}
    for unknown in sorted(set(more) - {*folders, "all"}):
        known = f"{', '.join(folders)}, all" if folders else "nothing more"
        raise ConfigError(f"dataset '{name}' has no '{unknown}'; known: {known}.{nearest(unknown, folders)}")
    files = list(card.files)
    for each in folders.values():
        if each.name in more or "all" in more:
            files += read_listing(_listing(name, card, each), each)
    for done, file in enumerate(files):
        known_file = file if file.sha256 else with_recorded(file, target)
        if progress is not None:
            progress(known_file, done, len(files))
        _fetch_file(name, card, known_file, target)
        if not known_file.sha256:
            record(known_file, target)
    return target


def _listing(name: str, card: Card, folder: DatasetFolder) -> bytes:
    """What the host says of a folder's files."""
    with tempfile.TemporaryDirectory() as place:
        _retrieve(DatasetFile("listing", "", folder.listing), Path(place) / "listing", name, f"See {card.source}.")
        return (Path(place) / "listing").read_bytes()


def _fetch_file(name: str, card: Card, file: DatasetFile, target: Path) -> None:
    import pooch

    place = target / file.path
    by_hand = f"You can also take it from {card.source} and put it in {place.parent}."
    if not file.url:
        if not (place.is_file() and pooch.file_hash(place) == file.sha256):
            raise CaptureError(f"'{file.path}' of dataset '{name}' has no direct download address. {by_hand}")
        return
    _retrieve(file, place, name, by_hand)


def _retrieve(file: DatasetFile, place: Path, name: str, by_hand: str) -> None:
    """Put a file in its place, unless it lies there already with the hash that is known."""
    import pooch

    logger: logging.Logger = pooch.get_logger()
    level = logger.level
    logger.setLevel(logging.WARNING)  # pooch announces each download on the terminal
    try:
        pooch.retrieve(
            file.url,
            known_hash=f"sha256:{file.sha256}" if file.sha256 else None,
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
