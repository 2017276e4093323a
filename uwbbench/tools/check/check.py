"""What a conformance check is, and how a plugin fails it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from uwbbench.api.case import Check, Violation


class Nonconformity(Violation):
    """The plugin does not do what the check asks.

    Parameters
    ----------
    expected, found : str
        What should be, and what is, with the numbers.
    """

    def __init__(self, expected: str, found: str) -> None:
        super().__init__(found, expected=expected)


def check(read_more: str) -> Callable[[Callable[[Any], str | None]], Check]:
    """Make a check of a function, named like it; the first paragraph of its docstring states what is asked.

    Parameters
    ----------
    read_more : str
        Dotted name of what explains it, for ``python -m pydoc``, or a whole command.
    """
    command = read_more if " " in read_more else f"python -m pydoc {read_more}"
    return lambda run: Check.named_after(run, read_more=command)
