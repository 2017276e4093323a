"""Checks of a metric: pure, mergeable in any order, and right where the answer is known."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from uwbbench.api.metric import Metric, Outcome
from uwbbench.api.registry import AuthoredKind
from uwbbench.measure.accuracy.evidence import merge
from uwbbench.measure.accuracy.stats import estimated, evaluate
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.outcomes import FRAMES, empty, outcome, perfect
from uwbbench.tools.check.subject import ClassSubject
from uwbbench.tools.check.values import Values

CAPTURES = 12
_METRIC = "uwbbench.api.metric.Metric"


class MetricSubject(ClassSubject):
    """One metric, and outcomes of twelve captures."""

    kind: ClassVar[AuthoredKind] = "metric"
    base: ClassVar[type] = Metric

    @cached_property
    def outcomes(self) -> list[Outcome]:
        """The usual outcomes."""
        return [outcome(self.cls.of, seed) for seed in range(1, CAPTURES + 1)]

    def result(self) -> Values:
        """Partials of all outcomes, and the value of all together."""
        partials = [self.cls.partial(one) for one in self.outcomes]
        value = np.array([self.cls.value(merge(self.cls, partials))])
        return {**{f"partial {number}": np.asarray(part) for number, part in enumerate(partials)}, "value": value}

    def input_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of the usual outcomes."""
        return {
            f"{name} of outcome {number}": value
            for number, one in enumerate(self.outcomes)
            for name, value in vars(one).items()
            if isinstance(value, np.ndarray)
        }

    @property
    def value(self) -> float:
        """Value of all outcomes together."""
        return float(self.usual["value"][0])


@check(_METRIC)
def attributes_are_valid(subject: MetricSubject) -> str:
    """``of`` is an outcome; ``merge``, ``better``, ``kind`` are known words; ``minimum_samples`` is positive."""
    if not (isinstance(subject.cls.of, type) and issubclass(subject.cls.of, Outcome)):
        raise Nonconformity("of as uwbbench.api.Outcome or what a scoring makes of it", repr(subject.cls.of))
    hints = get_type_hints(Metric)
    for name in ("merge", "better", "kind"):
        (choice,) = get_args(hints[name])
        value = getattr(subject.cls, name)
        if value not in get_args(choice):
            raise Nonconformity(f"{name} among {', '.join(get_args(choice))}", repr(value))
    least = subject.cls.minimum_samples
    if not isinstance(least, int) or least < 1:
        raise Nonconformity("minimum_samples of 1 or more", repr(least))
    return f"{subject.cls.merge}, {subject.cls.better} is better"


@check(_METRIC)
def display_is_valid(subject: MetricSubject) -> str:
    """What tables and rankings read is of the kind that they expect: title, decimals, order, headline, margin."""
    cls = subject.cls
    if not isinstance(cls.title, str) or not cls.title.isprintable():
        raise Nonconformity("title as text on one line", repr(cls.title))
    shown = cls.shown_as
    if shown is not None and not (isinstance(shown, tuple) and len(shown) == 3):
        raise Nonconformity("shown_as as (unit, factor, decimals), or None", repr(shown))
    unit, factor, decimals = cls.scale()
    if not isinstance(unit, str) or not unit.isprintable():
        raise Nonconformity("a unit in shown_as as text on one line", repr(unit))
    if not _is_number(factor) or factor <= 0:
        raise Nonconformity("a factor above 0 in shown_as", repr(factor))
    if not _is_whole(decimals) or not 0 <= decimals <= 9:
        raise Nonconformity("0 to 9 decimals in shown_as", repr(decimals))
    if not _is_whole(cls.order) or not (cls.headline is None or _is_whole(cls.headline)):
        raise Nonconformity("order and headline as whole numbers, or headline None", f"{cls.order!r}, {cls.headline!r}")
    if not _is_number(cls.margin) or cls.margin < 0:
        raise Nonconformity("a margin of 0 or more", repr(cls.margin))
    for name in ("default", "brief", "needs_exhaustive_truth"):
        if not isinstance(getattr(cls, name), bool):
            raise Nonconformity(f"{name} as True or False", repr(getattr(cls, name)))
    return f"{cls.title or 'its registered name'}, {decimals} decimals {unit}".rstrip()


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: object) -> bool:
    return _is_whole(value) or (isinstance(value, float) and math.isfinite(value))


@check(_METRIC)
def unit_is_given(subject: MetricSubject) -> str:
    """A number that doubles or changes where all errors double has a unit, and says which."""
    unit = subject.cls.unit
    if not isinstance(unit, str):
        raise Nonconformity("unit as text", repr(unit))
    doubled = [dataclasses.replace(one, error_m=2 * one.error_m) for one in subject.outcomes]
    changed = not math.isclose(evaluate(subject.cls, doubled), subject.value, rel_tol=1e-9)
    if changed and not unit:
        raise Nonconformity("a unit, such as 'm', as the value follows the errors", "unit = ''")
    return unit or "a ratio without unit"


@check(_METRIC)
def partials_are_flat_arrays(subject: MetricSubject) -> None:
    """A partial is a flat float array, of one length where partials are added; samples that stack may be rows."""
    partials = [subject.cls.partial(one) for one in subject.outcomes]
    for part in partials:
        most = 2 if subject.cls.merge == "stack" else 1
        if not isinstance(part, np.ndarray) or not 1 <= part.ndim <= most or part.dtype != np.float64:
            observed = f"{part.dtype} of shape {part.shape}" if isinstance(part, np.ndarray) else type(part).__name__
            raise Nonconformity("float64 arrays of one dimension", observed)
    lengths = {len(part) for part in [*partials, subject.cls.partial(empty(subject.cls.of))]}
    if subject.cls.merge == "sum" and len(lengths) > 1:
        raise Nonconformity("partials of one length", f"lengths {sorted(lengths)}")


@check(_METRIC)
def value_is_a_float(subject: MetricSubject) -> str:
    """The value is a Python float: it goes into JSON and tables."""
    value = subject.cls.value(merge(subject.cls, [subject.cls.partial(one) for one in subject.outcomes]))
    if type(value) is not float:
        raise Nonconformity("a float", type(value).__name__)
    if not math.isfinite(value):
        raise Nonconformity(f"a number for {CAPTURES * FRAMES} frames", str(value))
    return f"{value:.4g} {subject.cls.unit}".rstrip()


@check("uwbbench.measure.accuracy.evidence.merge")
def grouping_does_not_matter(subject: MetricSubject) -> None:
    """Partials that are merged in any grouping and order give one value: runs are put together in pieces."""
    cls = subject.cls
    parts = [cls.partial(one) for one in subject.outcomes]
    ways = {
        "in reverse": parts[::-1],
        "in two halves": [merge(cls, parts[:5]), merge(cls, parts[5:])],
        "one after the other": [merge(cls, [merge(cls, [merge(cls, parts[:2]), parts[2]]), *parts[3:]])],
        "with an empty capture": [*parts, cls.partial(empty(cls.of))],
    }
    for name, pieces in ways.items():
        value = cls.value(merge(cls, pieces))
        if not math.isclose(value, subject.value, rel_tol=1e-9, abs_tol=1e-12):
            raise Nonconformity(f"{subject.value!r} merged {name}", repr(value))


@check("uwbbench.measure.accuracy.metrics")
def nothing_is_undefined(subject: MetricSubject) -> None:
    """Without frames the value is NaN with n = 0, no zero and no exception: 0/0 is undefined."""
    estimate = estimated(subject.cls, [empty(subject.cls.of)])
    value = subject.cls.value(subject.cls.partial(empty(subject.cls.of)))
    if not math.isnan(value) or not math.isnan(estimate.value) or estimate.n:
        raise Nonconformity("NaN with n = 0", f"{value} with n = {estimate.n}")


@check(_METRIC)
def perfection_is_best(subject: MetricSubject) -> str:
    """A perfect detector gets a number, and none that misses, invents or errs gets a better one; ``better`` says how.

    At least one of those must get a worse one.
    """
    cls = subject.cls
    best = evaluate(cls, [perfect(cls.of)])
    spoiled = {"misses half": {"missed": 0.5}, "invents": {"false": 0.5}, "errs": {"bias_m": 0.3, "sd_m": 0.2}}
    flaws = {name: {"missed": 0.0, "false": 0.0, "bias_m": 0.0, "sd_m": 0.0, **how} for name, how in spoiled.items()}
    others = {name: evaluate(cls, [outcome(cls.of, 1, **how)]) for name, how in flaws.items()}
    if not math.isfinite(best):
        raise Nonconformity("a number for a perfect detector", str(best))
    beaten = {name: cls.merit(best) - cls.merit(value) for name, value in others.items()}
    wrong = next((name for name, lead in beaten.items() if lead < -1e-12), None)
    if wrong:
        observed = f"perfect {best:g}, one that {wrong} {others[wrong]:g}, and {cls.better} is better"
        raise Nonconformity("no flawed detector above the perfect one", observed)
    if not any(lead > 0 for lead in beaten.values()):
        raise Nonconformity("a worse value for some flaw", f"{best:g} for all of {', '.join(others)}")
    return f"perfect: {best:g}"


@check("uwbbench.measure.accuracy.stats.estimated")
def interval_brackets_the_value(subject: MetricSubject) -> str:
    """The interval over twelve captures holds the value."""
    estimate = estimated(subject.cls, subject.outcomes)
    if not estimate.low <= estimate.value <= estimate.high:
        raise Nonconformity(f"an interval around {estimate.value:g}", f"{estimate.low:g} to {estimate.high:g}")
    return f"{estimate.value:.4g} in {estimate.low:.4g} to {estimate.high:.4g}, n = {estimate.n}"


@check("uwbbench.api.metric.Metric.parts")
def kind_fits(subject: MetricSubject) -> str:
    """The value is what its ``kind`` says: the ratio of summed parts, or a quantile of what is stacked."""
    cls = subject.cls
    partials = [cls.partial(one) for one in subject.outcomes]
    if cls.kind == "quantile":
        expected = float(np.quantile(np.abs(merge(cls, partials)), cls.level)) if 0 <= cls.level <= 1 else math.nan
    elif cls.kind in ("share", "ratio", "mean"):
        num, den = np.sum([cls.parts(part) for part in partials], axis=0)
        expected = float(num / den)
    else:
        expected = subject.value
    if not math.isclose(expected, subject.value, rel_tol=1e-9, abs_tol=1e-12):
        raise Nonconformity(f"{subject.value:g}, the value", f"{expected:g} from the parts of a {cls.kind}")
    if subject.value < 0 and cls.kind not in ("mean", "other"):
        raise Nonconformity(f"no negative value of the kind '{cls.kind}'", f"{subject.value:g}")
    if cls.kind == "share" and subject.value > 1:
        raise Nonconformity("a share of 1 or less", f"{subject.value:g}")
    return str(cls.kind)


@check("uwbbench.api.metric.Outcome")
def errors_that_are_nan_are_left_out(subject: MetricSubject) -> None:
    """Detections that belong to no object have the error NaN, which must not make the value NaN."""
    spoiled = []
    for one in subject.outcomes:
        error_m = one.error_m.copy()
        error_m[::10] = np.nan
        spoiled.append(dataclasses.replace(one, error_m=error_m))
    if not math.isfinite(evaluate(subject.cls, spoiled)):
        raise Nonconformity("a number from the other errors", str(evaluate(subject.cls, spoiled)))


@check("uwbbench.api.metric.Outcome")
def open_truth_is_fine(subject: MetricSubject) -> str:
    """Captures whose truth is not exhaustive come through; a metric that is undefined there says so, and no other."""
    value = evaluate(subject.cls, [dataclasses.replace(one, exhaustive=False) for one in subject.outcomes])
    if subject.cls.needs_exhaustive_truth != math.isnan(value):
        observed = f"needs_exhaustive_truth = {subject.cls.needs_exhaustive_truth}"
        raise Nonconformity(
            f"needs_exhaustive_truth = {math.isnan(value)}, as the value is {value:.4g} there", observed
        )
    return f"{value:.4g}"


CHECKS = (
    attributes_are_valid,
    display_is_valid,
    unit_is_given,
    partials_are_flat_arrays,
    value_is_a_float,
    grouping_does_not_matter,
    nothing_is_undefined,
    perfection_is_best,
    interval_brackets_the_value,
    kind_fits,
    errors_that_are_nan_are_left_out,
    open_truth_is_fine,
)
