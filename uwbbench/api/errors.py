"""What a user's mistake becomes: one message that names the place, what was expected, and the nearest valid name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UwbbenchError(Exception):
    """A mistake in what the user gave: its text is the whole message, no traceback needed."""


class CaptureError(UwbbenchError):
    """A capture, or the recording behind it, cannot be read or written as requested."""


class ConfigError(UwbbenchError):
    """A YAML file or an option is wrong: the message names file, line and key."""


class PluginError(UwbbenchError):
    """A plugin is unknown, claimed twice, or cannot be imported."""


class ScoringError(UwbbenchError):
    """Detections cannot be scored as requested, for example without ground truth."""


class StoreError(UwbbenchError):
    """A run folder cannot be read or written."""


def nearest(name: str, known: Iterable[str]) -> str:
    """End of an error message that helps with an unknown name.

    Parameters
    ----------
    name : str
        What the user wrote.
    known : iterable of str
        The valid names.

    Returns
    -------
    str
        ``" Did you mean 'x'?"``, or the list of valid names where none is near.

    Examples
    --------
    >>> nearest("promience", ["prominence", "width"])
    " Did you mean 'prominence'?"
    """
    names = sorted(set(known))
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if near:
        return f" Did you mean '{near[0]}'?"
    return f" Known: {', '.join(names)}." if names else ""
