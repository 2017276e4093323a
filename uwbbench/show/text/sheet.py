"""A table of texts, and how names become texts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from uwbbench.api.text import one_line, printable

LONGEST_NAME, LONGEST_SENTENCE = 60, 600
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

    def renamed(self, column: str, names: Mapping[str, str]) -> Sheet:
        """Sheet with other texts in a column, where it has that."""
        if column not in self.columns:
            return self
        at = self.columns.index(column)
        rows = tuple((*row[:at], names.get(row[at], row[at]), *row[at + 1 :]) for row in self.rows)
        return replace(self, rows=rows)

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
    return printable(name, LONGEST_NAME)


def sentence(text: str) -> str:
    """Text on one line, without control characters, cut where it is very long."""
    return one_line(text, LONGEST_SENTENCE)


def labels(names: Iterable[str], longest: int = 28) -> dict[str, str]:
    """Short label of each name, no two alike.

    Examples
    --------
    >>> labels(["a" * 40, "a" * 41, "paper"], longest=6)["paper"]
    'paper'
    """
    by_name: dict[str, str] = {}
    for name in dict.fromkeys(names):
        short = printable(name.strip(), longest) or "(no name)"
        label, copy = short, 2
        while label in by_name.values():
            label, copy = f"{short} ({copy})", copy + 1
        by_name[name] = label
    return by_name
