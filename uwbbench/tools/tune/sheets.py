"""The results of a tuning as tables for people."""

from __future__ import annotations

from typing import Any

from uwbbench.api.text import one_line
from uwbbench.measure.accuracy.metrics.detection import F1
from uwbbench.show.text.numbers import number
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.sheet import Sheet, escaped, shown
from uwbbench.tools.tune.evaluate import Result
from uwbbench.tools.tune.execute import TuneOutcome

_F1 = Quantity.of("f1", F1)
"""The metric that a tuning maximises."""


def sheets(outcome: TuneOutcome) -> list[Sheet]:
    """Scores of each group before and after, the chosen values, and the stable zone."""
    model, several = outcome.tuning.model, len(outcome.groups)
    is_grid = outcome.tuning.sweep is not None
    simulated = ", SIMULATED" if any(one.capture.source == "simulated" for one in outcome.captures) else ""
    scores = Sheet(
        f"{outcome.tuning.detector.name} tuned for {several} group{'s' if several > 1 else ''} of captures{simulated}",
        (
            "tuned for",
            "sets",
            "captures",
            f"{_F1.title} before",
            f"{_F1.title} tuned",
            "held out",
            f"held-out {_F1.title} before",
            f"held-out {_F1.title} tuned",
            "held-out RMSE (cm)",
            "stable zone",
        ),
        tuple(
            (
                shown(tuned.group.text),
                str(len(tuned.scores.tp)),
                str(tuned.after.captures),
                _f1(tuned.before),
                _f1(tuned.after),
                "0" if tuned.held_out_after is None else str(tuned.held_out_after.captures),
                _f1(tuned.held_out_before),
                _f1(tuned.held_out_after),
                "n/a" if tuned.held_out_after is None else number(float(tuned.held_out_after.scores.rmse_m[0]), 1, 100),
                "n/a" if tuned.zone is None else f"{tuned.zone.share:.1%}",
            )
            for tuned in outcome.groups
        ),
        (
            f"scoring '{model.scoring}' after {model.table}, gate {100 * model.gate_m:g} cm; intervals of F1 "
            "over scenes",
            f"chosen: of all sets within {model.f1_tie:g} of the highest F1 on the captures tuned on, the one of "
            "lowest RMSE of all retained detections",
            *([f"stable zone: share of the sets within {model.stable_within:g} of the highest F1"] if is_grid else ()),
            *outcome.notes,
        ),
    )
    return [scores, _values(outcome)]


def _values(outcome: TuneOutcome) -> Sheet:
    """Chosen value of each parameter, beside its span in the stable zone."""
    rows = []
    for tuned in outcome.groups:
        for path, value in tuned.values.items():
            span = ("n/a", "n/a")
            if tuned.zone is not None:
                low, high = tuned.zone.spans[path]
                span = (_value(low), _value(high))
            numbers = [one for one in tuned.columns[path] if isinstance(one, int | float)]
            ends = (_value(min(numbers)), _value(max(numbers))) if numbers else ("n/a", "n/a")
            rows.append((shown(tuned.group.text), shown(short(path)), _value(value), *span, *ends))
    return Sheet(
        "Values",
        ("tuned for", "parameter", "tuned", "stable from", "stable to", "tried from", "tried to"),
        tuple(rows),
        ("stable: smallest and largest value in any set of the stable zone",)
        if outcome.tuning.sweep is not None
        else (),
    )


def markdown(outcome: TuneOutcome) -> str:
    """All tables as Markdown."""
    lines = [f"# {escaped(shown(outcome.tuning.name))}", ""]
    if outcome.tuning.model.description:
        lines += [escaped(one_line(outcome.tuning.model.description)), ""]
    return "\n".join([*lines, *(sheet.markdown() for sheet in sheets(outcome))])


def short(path: str) -> str:
    """Path of a parameter without what all of them share.

    Examples
    --------
    >>> short("pipeline.filter.width.params.minimum")
    'filter.width.minimum'
    """
    return path.removeprefix("pipeline.").replace(".params.", ".")


def _f1(result: Result | None) -> str:
    if result is None:
        return "n/a"
    if result.f1 is None:
        return _F1.text(float(result.scores.f1[0]))
    return _F1.value_of(result.f1)


def _value(value: Any) -> str:
    if value is None:
        return "none"
    return f"{value:.4g}" if isinstance(value, float) else shown(str(value))
