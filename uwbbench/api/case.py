"""Checks of plugins and detectors: functions with a name and a statement, and how they end.

There are two families. A *conformance check* (:mod:`uwbbench.tools.check`) asks what every plugin of a kind must do; a
*hard case* is an input at which numerical code breaks, with what a detector is expected to do. Hard cases of whole
detectors are in :mod:`uwbbench.measure.robustness`; those of single stages are in the package of the stages, which
registers them as an entry point of the group ``uwbbench.cases``: a tuple of hard cases (:func:`cases_of`).
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Literal, Self, TypeVar, get_args

from uwbbench.api.errors import ConfigError, UwbbenchError, nearest
from uwbbench.api.interruption import by_plugin
from uwbbench.api.text import summary

Expectation = Literal["reject", "survive", "equal"]
"""Yield nothing; carry on soundly; or give what a reference gives, within a tolerance."""
Status = Literal["passed", "failed", "error", "not applicable"]
STATUSES: tuple[Status, ...] = get_args(Status)


C = TypeVar("C", bound="Check")


class Violation(Exception):
    """The subject does not do what is asked.

    Parameters
    ----------
    found : str
        What it does instead, with the numbers.
    flips : float, optional
        As in :class:`Evidence`.
    expected : str
        What it should do; the check's statement if not given.
    """

    def __init__(self, found: str, flips: float | None = None, expected: str = "") -> None:
        super().__init__(found)
        self.found, self.flips, self.expected = found, flips, expected


class NotApplicable(Exception):
    """The subject has no part that the check is about, or something is missing here; the text says which."""


@dataclass(frozen=True)
class Evidence:
    """What a passed check has seen.

    Attributes
    ----------
    detail : str
        For people.
    error_m : float or None
        Largest difference of a range from its reference.
    error_ulp : float or None
        Largest difference of a computed value from its reference, in units in the last place of the reference, or of
        the largest operand where the reference is a difference.
    flips : float or None
        Share of the detections that come or go against the reference.
    """

    detail: str
    error_m: float | None = None
    error_ulp: float | None = None
    flips: float | None = None


@dataclass(frozen=True)
class CheckResult:
    """How one check ended for one subject.

    Attributes
    ----------
    check : Check
    status : {"passed", "failed", "error", "not applicable"}
        ``error`` where a plugin raised.
    detail : str
        What was seen, or why the check does not apply.
    expected, found : str
        Of a failure; of an error, ``found`` is the last line of the traceback.
    trace : str
        Traceback of an error.
    error_m, error_ulp, flips : float or None
        As in :class:`Evidence`.
    """

    check: Check
    status: Status
    detail: str = ""
    expected: str = ""
    found: str = ""
    trace: str = ""
    error_m: float | None = None
    error_ulp: float | None = None
    flips: float | None = None

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong."""
        return self.status in ("passed", "not applicable")

    def explain(self) -> str:
        """What is asked and why, what was expected and found, and where to read more."""
        lines = [f"{self.status} {self.check.name}: {self.check.asked}"]
        facts = (("expected", self.expected), ("found", self.found), ("read more", self.check.read_more))
        lines += [f"  {name + ':':<11}{text}" for name, text in facts if text]
        return "\n".join(lines)


@dataclass(frozen=True)
class Check:
    """One requirement on a subject.

    Attributes
    ----------
    name : str
    statement : str
        What is asked and why, in a sentence or two.
    run : callable
        Given a subject; returns what it saw, or raises :class:`Violation` or :class:`NotApplicable`.
    read_more : str
        Command that prints what the author of a plugin should read.
    """

    name: str
    statement: str
    run: Callable[[Any], Evidence | str | None]
    read_more: str = ""

    @classmethod
    def named_after(cls, run: Callable[[Any], Evidence | str | None], **facts: Any) -> Self:
        """Check of a function: named like it, and stated by the first paragraph of its docstring."""
        return cls(name=run.__name__.replace("_", "-"), statement=summary(run.__doc__), run=run, **facts)

    @property
    def asked(self) -> str:
        """What is asked, in full."""
        return self.statement

    def judge(self, subject: Any) -> CheckResult:
        """Result for one subject; whatever it raises is a result too."""
        try:
            seen = self.run(subject)
        except NotApplicable as reason:
            return CheckResult(self, "not applicable", str(reason))
        except Violation as fault:
            return CheckResult(
                self, "failed", expected=fault.expected or self.asked, found=fault.found, flips=fault.flips
            )
        except BaseException as error:
            if not by_plugin(error):
                raise
            return self._broken(error)
        return CheckResult(self, "passed", **vars(seen if isinstance(seen, Evidence) else Evidence(seen or "")))

    def _broken(self, error: BaseException) -> CheckResult:
        trace = "".join(traceback.format_exception(error))
        return CheckResult(self, "error", expected="no exception", found=last_line(error), trace=trace)


@dataclass(frozen=True)
class HardCase(Check):
    """One hard input, and what is expected of a detector that is given it.

    Attributes
    ----------
    group : str
        The module that holds the case.
    expectation : {"reject", "survive", "equal"}
    """

    group: str = ""
    expectation: Expectation = "survive"

    @property
    def asked(self) -> str:
        """The expectation, and the behaviour in one sentence; the docstring goes on to argue it."""
        return f"{self.expectation}: {self.statement}"

    def _broken(self, error: BaseException) -> CheckResult:
        return CheckResult(self, "failed", expected=self.asked, found=f"{type(error).__name__}: {error}")


def hard_case(expectation: Expectation) -> Callable[[Callable[[Any], Evidence]], HardCase]:
    """Make a hard case of a function, whose docstring says in its first paragraph what is expected."""
    return lambda run: HardCase.named_after(run, group=run.__module__.rpartition(".")[2], expectation=expectation)


def cases_of(*modules: ModuleType) -> tuple[HardCase, ...]:
    """Hard cases of some modules, in the order in which they are written."""
    return tuple(value for module in modules for value in vars(module).values() if isinstance(value, HardCase))


@dataclass(frozen=True)
class Examination:
    """Results of the checks of one subject.

    Attributes
    ----------
    results : tuple of CheckResult
    """

    results: tuple[CheckResult, ...]

    @property
    def passed(self) -> bool:
        """Whether no check failed, and none was broken by the plugin."""
        return all(result.passed for result in self.results)

    def count(self, status: Status) -> int:
        """Checks with this status."""
        return sum(result.status == status for result in self.results)


def select(checks: Iterable[C], names: Sequence[str], what: str) -> list[C]:
    """Checks of these names, in their order.

    Parameters
    ----------
    checks : iterable of Check
    names : sequence of str
    what : str
        What such a check is called, for messages.

    Raises
    ------
    ConfigError
        If there is none of a name.
    """
    known = {check.name: check for check in checks}
    for name in names:
        if name not in known:
            raise ConfigError(f"no {what} named '{name}'.{nearest(name, known)}")
    return [known[name] for name in names]


def last_line(error: BaseException) -> str:
    """Exception as the last line of a traceback shows it; a message for users stands for itself."""
    text = str(error) if isinstance(error, UwbbenchError) else f"{type(error).__name__}: {error}"
    return text.strip().partition("\n")[0]
