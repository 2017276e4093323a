"""The results of a fit as tables for people."""

from __future__ import annotations

from uwbbench.api import registry
from uwbbench.api.text import one_line
from uwbbench.show.text.numbers import interval, number
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.sheet import Sheet, escaped, shown
from uwbbench.tools.fit.config import CHAIN, Target
from uwbbench.tools.fit.evaluate import Residual
from uwbbench.tools.fit.execute import FitOutcome
from uwbbench.tools.tune.config import Choices

_EDGE = 0.01
"""Part of a range within which a value lies at its end."""


def sheets(outcome: FitOutcome) -> list[Sheet]:
    """Every target beside what the calibrated files give, and the fitted values."""
    plan, draws = outcome.fit, outcome.fit.model.checking
    rows = []
    for one in outcome.residuals:
        by = _quantity(one.target)
        text, here = wanted(one)
        off = number(one.value - one.target.value, by.digits, by.factor)
        rows.append(
            (
                shown(one.target.cell),
                one.target.table,
                shown(by.axis),
                text,
                here,
                off if off.startswith("-") else f"+{off}",
                number(one.distance, 2),
                ("reached" if one.reached else "MISSED") if one.target.judged else "beside",
            )
        )
    judged = [one for one in outcome.residuals if one.target.judged]
    notes = (
        f"Targets: {one_line(plan.model.source)}. Here: SIMULATED, {len(draws.seeds) * draws.runs} draws that the fit "
        "did not see, all together; intervals over draws.",
        "Calibrated to these figures; not a validation of them. Off: distance in tolerances.",
        f"{len(judged) - len(outcome.missed)} of {len(judged)} targets within their tolerance, after "
        f"{len(outcome.trials)} trials in {outcome.seconds:.0f} s"
        + (" (the time ended the search)" if outcome.out_of_time else ""),
    )
    columns = ("cell", "after", "figure", "target", "here", "difference", "off", "")
    return [Sheet(f"Residuals of {shown(plan.name)}", columns, tuple(rows), notes), _values(outcome)]


def wanted(one: Residual) -> tuple[str, str]:
    """Target and what was found, as texts in the same unit."""
    by = _quantity(one.target)
    return (
        number(one.target.value, by.digits, by.factor),
        interval(one.value, one.low, one.high, by.digits, by.factor),
    )


def _quantity(target: Target) -> Quantity:
    if target.table == CHAIN:
        return Quantity(target.metric, target.metric, "", 0, 1.0, "zero", "detections")
    return Quantity.of(target.metric, registry.load_plugin("metrics", target.metric))


def _values(outcome: FitOutcome) -> Sheet:
    """Fitted value of each parameter, and whether its range ends there."""
    rows = []
    for name, value in outcome.best.values.items():
        free = outcome.fit.model.parameters[name]
        if isinstance(free, Choices):
            ends, edge = (f"{len(free.choices)} choices", ""), False
        else:
            ends = (f"{free.low:g}", f"{free.high:g}")
            edge = min(value - free.low, free.high - value) < _EDGE * (free.high - free.low)
        text = f"{value:.4g}" if isinstance(value, float) else str(value)
        rows.append((shown(name), text, *ends, "at the end of its range" if edge else ""))
    return Sheet("Fitted values", ("parameter", "value", "from", "to", ""), tuple(rows), ())


def markdown(outcome: FitOutcome) -> str:
    """All tables as Markdown."""
    lines = [f"# {escaped(shown(outcome.fit.name))}", ""]
    if outcome.fit.model.description:
        lines += [escaped(one_line(outcome.fit.model.description)), ""]
    return "\n".join([*lines, *(sheet.markdown() for sheet in sheets(outcome))])


def message(outcome: FitOutcome) -> str:
    """Which targets are out of reach, and how far."""
    parts = []
    for one in outcome.missed:
        text, here = wanted(one)
        parts.append(f"{one.target.name}: {here} for {text}, {one.distance:.1f} tolerances off")
    return "out of reach: " + "; ".join(parts)
