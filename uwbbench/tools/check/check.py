"""What a conformance check is, and how it ends."""

from __future__ import annotations

import dataclasses
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

from uwbbench.api.errors import UwbbenchError
from uwbbench.api.text import summary

if TYPE_CHECKING:
    from uwbbench.tools.check.subject import Subject

Kind = Literal["stage", "detector", "dataset", "metric"]
KINDS: tuple[Kind, ...] = get_args(Kind)
Status = Literal["passed", "failed", "not applicable", "error"]


class Nonconformity(Exception):
    """The plugin does not do what the check asks.

    Parameters
    ----------
    expected, found : str
        What should be, and what is, with the numbers.
    """

    def __init__(self, expected: str, found: str) -> None:
        super().__init__(f"expected {expected}; found {found}")
        self.expected, self.found = expected, found


class NotApplicable(Exception):
    """The plugin has no part that the check is about, or something is missing here; the text says which."""


@dataclass(frozen=True)
class Result:
    """How one check ended for one plugin.

    Attributes
    ----------
    check, statement, read_more : str
        Of the :class:`Check`.
    status : {"passed", "failed", "not applicable", "error"}
        ``error`` where the plugin raised.
    detail : str
        What was seen, or why the check does not apply.
    expected, found : str
        Of a failure; of an error, ``found`` is the last line of the traceback.
    trace : str
        Traceback of an error.
    """

    check: str
    statement: str
    read_more: str
    status: Status
    detail: str = ""
    expected: str = ""
    found: str = ""
    trace: str = ""

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong."""
        return self.status in ("passed", "not applicable")

    def explain(self) -> str:
        """What is asked and why, what was expected and found, and where to read more."""
        lines = [f"{self.status} {self.check}: {self.statement}"]
        facts = (("expected", self.expected), ("found", self.found), ("read more", self.read_more))
        lines += [f"  {name + ':':<11}{text}" for name, text in facts if text]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return dataclasses.asdict(self)


@dataclass(frozen=True)
class Check:
    """One thing that is asked of every plugin of a kind.

    Attributes
    ----------
    name : str
    statement : str
        What is asked and why, in a sentence or two.
    read_more : str
        Command that prints what the plugin's author should read.
    run : callable
        Given a subject; returns what it saw, or raises :class:`Nonconformity` or :class:`NotApplicable`.
    """

    name: str
    statement: str
    read_more: str
    run: Callable[[Any], str | None]

    def judge(self, subject: Subject) -> Result:
        """Result for one plugin; whatever it raises is an error of its own."""
        about = (self.name, self.statement, self.read_more)
        try:
            seen = self.run(subject)
        except NotApplicable as reason:
            return Result(*about, "not applicable", str(reason))
        except Nonconformity as reason:
            return Result(*about, "failed", expected=reason.expected, found=reason.found)
        except Exception as error:  # noqa: BLE001 - a plugin may raise anything
            trace = "".join(traceback.format_exception(error))
            return Result(*about, "error", expected="no exception", found=last_line(error), trace=trace)
        return Result(*about, "passed", seen or "")


def last_line(error: BaseException) -> str:
    """Exception as the last line of a traceback shows it; a message for users stands for itself."""
    text = str(error) if isinstance(error, UwbbenchError) else f"{type(error).__name__}: {error}"
    return text.strip().partition("\n")[0]


def check(read_more: str) -> Callable[[Callable[[Any], str | None]], Check]:
    """Make a check of a function, named like it; the first paragraph of its docstring states what is asked.

    Parameters
    ----------
    read_more : str
        Dotted name of what explains it, for ``python -m pydoc``, or a whole command.
    """

    def made(run: Callable[[Any], str | None]) -> Check:
        command = read_more if " " in read_more else f"python -m pydoc {read_more}"
        return Check(run.__name__.replace("_", "-"), summary(run.__doc__), command, run)

    return made
