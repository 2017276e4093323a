"""Text that people read: on one line whatever a name holds, and docstrings without their markup.

Conventions
-----------
* What cannot be printed becomes its escape: control characters, line breaks, marks that turn the direction of writing,
  and bytes that are no text.
* A *name* keeps every character, so that two names look alike only if they are; *prose* is put on one line, where runs
  of white space are one space.
* What is too long ends in three dots, within the given length.
"""

from __future__ import annotations

import inspect
import re

LONGEST_VALUE = 200
"""Characters of somebody's value that a message repeats at most."""

_MARKUP = re.compile(
    r"``(?P<literal>.+?)``"
    r"|:[\w:-]+:`(?P<role>[^`]+)`"
    r"|`(?P<link>[^`]+)`_{0,2}"
    r"|(?<![\w*])\*\*(?P<strong>[^\s*](?:[^*]*[^\s*])?)\*\*(?![\w*])"
    r"|(?<![\w*])\*(?P<emphasis>[^\s*](?:[^*]*[^\s*])?)\*(?![\w*])"
    r"|\n[-=~]{3,}(?P<underline>)(?=\n|$)",
    re.DOTALL,
)


def printable(name: object, longest: int | None = None) -> str:
    r"""Name with every character to be seen.

    Parameters
    ----------
    name : object
        Its ``str`` is shown.
    longest : int, optional
        Characters at most.

    Examples
    --------
    >>> printable("run\t1"), printable("a" * 10, longest=6)
    ('run\\t1', 'aaa...')
    """
    text = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(name))
    return text if longest is None or len(text) <= longest else f"{text[: longest - 3]}..."


def quoted(value: object) -> str:
    r"""Value in a message: its ``repr`` on one line, cut where it is long.

    Examples
    --------
    >>> quoted("text"), quoted(0.5), len(quoted("x" * 1000))
    ("'text'", '0.5', 200)
    """
    try:
        return printable(repr(value), LONGEST_VALUE)
    except ValueError:  # an integer of more digits than Python will write
        return f"a number of {value.bit_length() if isinstance(value, int) else 'many'} bits"


def one_line(prose: object, longest: int | None = None) -> str:
    r"""Prose on one line.

    Parameters
    ----------
    prose : object
        Its ``str`` is shown.
    longest : int, optional
        Characters at most.

    Examples
    --------
    >>> one_line("two\nlines\x1b[0m")
    'two lines\\x1b[0m'
    """
    return printable(" ".join(str(prose).split()), longest)


def without_markup(text: str) -> str:
    """Docstring or description as it is read, without the marks of reStructuredText.

    Examples
    --------
    >>> without_markup("Taps of :class:`~uwbbench.api.Frames`, ``k <= most``, *not* ``a * b``.")
    'Taps of Frames, k <= most, not a * b.'
    """
    return _MARKUP.sub(_words, text)


def _words(match: re.Match[str]) -> str:
    kind = match.lastgroup or ""
    inside = match[kind]
    if kind not in ("role", "link"):
        return inside
    inside = re.sub(r"\s*<[^<>]*>$", "", inside) or inside  # a title hides its target
    return inside.rpartition(".")[2] if inside.startswith("~") else inside


def summary(docstring: str | None) -> str:
    r"""First paragraph of a docstring, as prose on one line.

    Examples
    --------
    >>> summary("Peaks of a\n    ``profile``.\n\n    More about them.")
    'Peaks of a profile.'
    """
    return one_line(without_markup(inspect.cleandoc(docstring or "").partition("\n\n")[0]))


def counted(number: int, what: str) -> str:
    """So many of a noun that takes an s: ``1 scene``, ``6 scenes``."""
    return f"{number} {what}{'' if number == 1 else 's'}"
