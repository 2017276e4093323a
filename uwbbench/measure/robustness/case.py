"""What a hard case is, and how it ends."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from uwbbench.api.text import summary

if TYPE_CHECKING:
    from uwbbench.measure.robustness.subject import Subject

Expectation = Literal["reject", "survive", "equal"]
"""Yield nothing; carry on soundly; or give what a reference gives, within a tolerance."""
Status = Literal["passed", "failed", "not applicable"]


class Violation(Exception):
    """The detector did not do what the case expects.

    Parameters
    ----------
    text : str
        What it did instead.
    flips : float, optional
        As in :class:`Evidence`.
    """

    def __init__(self, text: str, flips: float | None = None) -> None:
        super().__init__(text)
        self.flips = flips


class NotApplicable(Exception):
    """The detector has no part that the case is about; the text says which."""


@dataclass(frozen=True)
class Evidence:
    """What a passed case has seen.

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
class Outcome:
    """How one case ended for one detector.

    Attributes
    ----------
    case, group, expectation, statement : str
        Of the :class:`Case`.
    status : {"passed", "failed", "not applicable"}
    detail : str
        What was seen, what went wrong, or what the detector does not have.
    error_m, error_ulp, flips : float or None
        As in :class:`Evidence`.
    """

    case: str
    group: str
    expectation: Expectation
    statement: str
    status: Status
    detail: str
    error_m: float | None = None
    error_ulp: float | None = None
    flips: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return dataclasses.asdict(self)


@dataclass(frozen=True)
class Case:
    """One hard input, and what is expected of a detector that is given it.

    Attributes
    ----------
    name : str
    group : str
        The module that holds the case.
    expectation : {"reject", "survive", "equal"}
    statement : str
        The expected behaviour in one sentence; the check's docstring goes on to argue it.
    check : callable
        Gives :class:`Evidence`, or raises :class:`Violation` or :class:`NotApplicable`.
    """

    name: str
    group: str
    expectation: Expectation
    statement: str
    check: Callable[[Subject], Evidence]

    def judge(self, subject: Subject) -> Outcome:
        """Outcome for one detector; whatever goes wrong in the detector is a failed case."""
        about = (self.name, self.group, self.expectation, self.statement)
        try:
            seen = self.check(subject)
        except NotApplicable as reason:
            return Outcome(*about, "not applicable", str(reason))
        except Violation as reason:
            return Outcome(*about, "failed", str(reason), flips=reason.flips)
        except Exception as error:  # noqa: BLE001 - a hard input may make a plugin raise anything
            return Outcome(*about, "failed", f"{type(error).__name__}: {error}")
        return Outcome(*about, "passed", seen.detail, seen.error_m, seen.error_ulp, seen.flips)


def case(expectation: Expectation) -> Callable[[Callable[[Subject], Evidence]], Case]:
    """Make a case of a function, named like it; the first paragraph of its docstring states what is expected."""

    def made(check: Callable[[Subject], Evidence]) -> Case:
        group = check.__module__.rpartition(".")[2]
        return Case(check.__name__.replace("_", "-"), group, expectation, summary(check.__doc__), check)

    return made
