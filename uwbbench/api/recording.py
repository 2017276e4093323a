"""Which captures are of one recording: what was learnt on one must not be tried on the other.

A recording is all that receivers have seen of one run. A simulated one is as much its random draws: noise, sampling
grid and gain follow from the seed and the number of the run, whatever scene they are added to, so that two scenes with
equal seeds are no independent samples. Its name ends in brackets with a mark of the draws, and this decides. The mark
is a hash: seeds may be secret.
"""

from __future__ import annotations

import hashlib
import re

_DRAWS = re.compile(r" \[(.+)\]$")


def simulated_recording(name: str, draws: str) -> str:
    """Name of a simulated recording.

    Parameters
    ----------
    name : str
        Scene with its variant and run.
    draws : str
        What all random draws follow from, such as ``scene seed 1, run 2``.

    Examples
    --------
    >>> simulated_recording("walker/2", "scene seed 1, run 2")
    'walker/2 [draws 70a54e96dee3c25a]'
    """
    return f"{name} [draws {hashlib.sha256(draws.encode()).hexdigest()[:16]}]"


def leak_key(recording: str) -> str:
    """Part of a recording's name that is the same for all recordings which leak into each other.

    It is the mark of the draws of a simulated recording, and the whole name of any other.

    Examples
    --------
    >>> leak_key("walker/2 [draws 70a54e96dee3c25a]"), leak_key("corridor-monday")
    ('draws 70a54e96dee3c25a', 'corridor-monday')
    """
    draws = _DRAWS.search(recording)
    return draws[1] if draws else recording


def leaks(one: str, other: str) -> bool:
    """Whether one recording says something about another: they are the same, or simulated with the same draws.

    Examples
    --------
    >>> leaks("walker/2 [draws 70a54e96dee3c25a]", "room/2 [draws 70a54e96dee3c25a]")
    True
    """
    return leak_key(one) == leak_key(other)
