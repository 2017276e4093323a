"""A table of texts, and how numbers and names become texts."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

LONGEST_NAME = 60
_MARKDOWN = str.maketrans({char: f"\\{char}" for char in "\\`*_[]|~#"})
_HTML = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})


@dataclass(frozen=True)
class Sheet:
    """A table ready to be shown.

    Attributes
    ----------
    title : str
    columns : tuple of str
    rows : tuple of tuple of str
        As many texts as columns in each.
    notes : tuple of str
        What a reader must know to read it.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def markdown(self) -> str:
        """GitHub-flavoured Markdown."""
        lines = [f"## {escaped(self.title)}", ""]
        if self.rows:
            lines += [_row(self.columns), _row(["---"] * len(self.columns), escape=False), *map(_row, self.rows), ""]
        else:
            lines += ["None.", ""]
        lines += [f"* {escaped(note)}" for note in self.notes]
        return "\n".join(lines).rstrip() + "\n"


def _row(cells: tuple[str, ...] | list[str], *, escape: bool = True) -> str:
    return "| " + " | ".join(escaped(cell) if escape else cell for cell in cells) + " |"


def escaped(text: str) -> str:
    """Text that Markdown and HTML show as it is, on one line."""
    return text.translate(_HTML).translate(_MARKDOWN)


def shown(name: str) -> str:
    """Name on one line, without control characters, cut where it is very long."""
    text = "".join(char if char.isprintable() else char.encode("unicode_escape").decode() for char in name)
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME - 3]}..."


def labels(names: Iterable[str], longest: int = 28) -> dict[str, str]:
    """Short label of each name, no two alike.

    Examples
    --------
    >>> labels(["a" * 40, "a" * 41, "paper"], longest=6)["paper"]
    'paper'
    """
    found: dict[str, str] = {}
    for name in dict.fromkeys(names):
        text = shown(name).strip() or "(no name)"
        short = text if len(text) <= longest else f"{text[: longest - 1]}…"
        label, copy = short, 2
        while label in found.values():
            label, copy = f"{short} ({copy})", copy + 1
        found[name] = label
    return found


def number(value: object, digits: int, scale: float = 1.0) -> str:
    """Number with fixed digits; ``n/a`` where it is undefined.

    Examples
    --------
    >>> number(0.1234, 1, 100.0), number(None, 2), number(float("nan"), 2)
    ('12.3', 'n/a', 'n/a')
    """
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "n/a"
    return f"{value * scale:.{digits}f}"


def interval(value: object, low: object, high: object, digits: int, scale: float = 1.0) -> str:
    """Number with its interval in brackets, where there is one."""
    text = number(value, digits, scale)
    ends = number(low, digits, scale), number(high, digits, scale)
    return text if "n/a" in (text, *ends) else f"{text} [{ends[0]}, {ends[1]}]"
