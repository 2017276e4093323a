"""What a user's mistake becomes: one message that names the place, what was expected, and the nearest valid name."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

_LONGEST_WORD, _LONGEST_LINE = 204, 4000
_LONG_WORD = re.compile(rf"[^\s/]{{{_LONGEST_WORD + 1},}}")
_LONG_LINE = re.compile(rf"[^\n]{{{_LONGEST_LINE + 1},}}")
"""Words are cut at slashes: a path is of use only as a whole."""


class UwbbenchError(Exception):
    """A mistake in what the user gave: its text is the whole message, no traceback needed.

    Words of more than 200 characters, which no message has of its own, are cut, and so are lines of more than 4000.
    """

    def __str__(self) -> str:
        text = _LONG_WORD.sub(lambda word: f"{word[0][: _LONGEST_WORD - 3]}...", super().__str__())
        return _LONG_LINE.sub(lambda line: f"{line[0][: _LONGEST_LINE - 3]}...", text)


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
