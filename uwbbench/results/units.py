"""Finding the units of a run by the names that people use: detector, capture and dataset."""

from __future__ import annotations

from uwbbench.api.errors import ConfigError, StoreError, nearest
from uwbbench.run.folder import Entry, RunFolder
from uwbbench.run.folder.journal import Kind


def units_of(
    folder: RunFolder, kind: Kind, detector: str | None = None, capture: str | None = None, dataset: str | None = None
) -> list[Entry]:
    """Finished units of one kind, of all detectors, captures and datasets unless some are named.

    Parameters
    ----------
    folder : RunFolder
    kind : {"accuracy", "latency", "stability"}
    detector, capture, dataset : str, optional
        Names.

    Raises
    ------
    ConfigError
        If the run has none of that name; names the nearest.
    StoreError
        If no unit of that kind was finished.
    """
    entries = [entry for entry in folder.entries() if entry.kind == kind and entry.status == "done"]
    if not entries:
        what = {"accuracy": "detections", "latency": "measured times"}.get(kind, f"results of {kind}")
        raise StoreError(f"{folder.path}: holds no {what}")
    chosen = entries
    for what, name in (("detector", detector), ("capture", capture), ("dataset", dataset)):
        names = {getattr(entry, what) for entry in entries}
        if name is not None and name not in names:
            raise ConfigError(f"{folder.path}: has no {what} '{name}'.{nearest(name, names)}")
        chosen = [entry for entry in chosen if name in (None, getattr(entry, what))]
    if not chosen:
        raise ConfigError(f"{folder.path}: detector, capture and dataset exist, but not together")
    return chosen


def unit_of(folder: RunFolder, kind: Kind, detector: str | None, capture: str, dataset: str | None = None) -> Entry:
    """The one finished unit of these names.

    Parameters
    ----------
    folder : RunFolder
    kind : {"accuracy", "latency"}
    detector : str or None
        None for any: for what all detectors share, such as the capture.
    capture : str
    dataset : str, optional
        Needed where captures of several datasets have the same name.

    Raises
    ------
    ConfigError
        If the run has none of that name, or captures of that name in several datasets.
    StoreError
        If no unit of that kind was finished.
    """
    chosen = units_of(folder, kind, detector, capture, dataset)
    datasets = list(dict.fromkeys(entry.dataset for entry in chosen))
    if len(datasets) > 1:
        raise ConfigError(
            f"{folder.path}: several datasets have a capture '{capture}': {', '.join(datasets)}; name one"
        )
    return chosen[0]
