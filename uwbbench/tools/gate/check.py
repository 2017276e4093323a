"""What a gate found: checks with verdicts, and what follows from them together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, Literal

from uwbbench.run.folder.identity import plain
from uwbbench.show.text.numbers import number

Aspect = Literal["captures", "accuracy", "deadline", "canary", "latency"]
"""What a check is about."""


class GateVerdict(StrEnum):
    """Outcome of a check, and of a gate."""

    PASS = "pass"  # noqa: S105 - no password
    REGRESSION = "regression"
    INCONCLUSIVE = "inconclusive"
    INVALID = "invalid"

    @property
    def exit_code(self) -> int:
        """Exit code of the command: 0 pass, 1 regression, 2 inconclusive, 3 invalid."""
        return list(GateVerdict).index(self)


_GRAVITY = (GateVerdict.REGRESSION, GateVerdict.INVALID, GateVerdict.INCONCLUSIVE)


@dataclass(frozen=True, kw_only=True)
class Check:
    """One limit, held against what was measured.

    Attributes
    ----------
    kind : {"captures", "accuracy", "deadline", "canary", "latency"}
        A canary compares the base with itself; captures are those that cannot be listed.
    name : str
        What was checked, and on which captures.
    verdict : GateVerdict
    quantity : str
        What the value is, for people.
    value, low, high : float or None
        Measured value and the ends of its 95 % interval; None where there is none.
    n, counted : int and str
        Samples behind the value, and what they are.
    unit : str
        ``m`` for lengths, ``share`` for shares, empty for ratios and scores.
    limit : float or None
    bound : {"maximum", "minimum"}
        Which end the limit is.
    reason : str
        Why the verdict is not a pass, or what to know about it.
    advice : str
        What to do next.
    elapsed_s : float
    """

    kind: Aspect
    name: str
    verdict: GateVerdict
    quantity: str = ""
    value: float | None = None
    low: float | None = None
    high: float | None = None
    n: int = 0
    counted: str = ""
    unit: str = ""
    limit: float | None = None
    bound: Literal["maximum", "minimum"] = "maximum"
    reason: str = ""
    advice: str = ""
    elapsed_s: float = 0.0

    @property
    def measured_text(self) -> str:
        """Value, interval and number of samples, for people."""
        if self.value is None:
            return "n/a"
        text = _quantity(self.value, self.unit)
        if self.low is not None and self.high is not None:
            text += f" [{_quantity(self.low, self.unit)}, {_quantity(self.high, self.unit)}]"
        return f"{self.quantity} {text}, {self.n} {self.counted}".strip()

    @property
    def limit_text(self) -> str:
        """Limit, for people."""
        if self.limit is None:
            return ""
        sign = "<=" if self.bound == "maximum" else ">="
        return f"{sign} {_quantity(self.limit, self.unit)}"


@dataclass(frozen=True)
class GateResult:
    """All checks of a gate.

    Attributes
    ----------
    gate : str
        Name of the gate.
    head, base : str
        What was compared, for people; ``base`` is empty where nothing was compared with one.
    checks : sequence of Check
    machine : dict
        Where it ran.
    """

    gate: str
    head: str
    base: str
    checks: Sequence[Check]
    machine: dict[str, Any]

    @property
    def verdict(self) -> GateVerdict:
        """Gravest verdict of all checks: a proven regression, then what is invalid, then what is inconclusive."""
        verdicts = {check.verdict for check in self.checks}
        return next((verdict for verdict in _GRAVITY if verdict in verdicts), GateVerdict.PASS)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        about = {"gate": self.gate, "verdict": self.verdict.value, "exit_code": self.verdict.exit_code}
        checks = [{**asdict(check), "verdict": check.verdict.value} for check in self.checks]
        return dict(plain({**about, "head": self.head, "base": self.base, "checks": checks, "machine": self.machine}))


def _quantity(value: float, unit: str) -> str:
    """Number as people read it: centimetres, per cent, or three digits.

    Examples
    --------
    >>> _quantity(0.0312, "m"), _quantity(0.004, "share"), _quantity(1.0123, "")
    ('3.12 cm', '0.40 %', '1.012')
    """
    digits, scale, shown = {"m": (2, 100.0, "cm"), "share": (2, 100.0, "%")}.get(unit, (3, 1.0, unit))
    return number(value, digits, scale, shown)
