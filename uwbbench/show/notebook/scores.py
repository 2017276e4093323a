"""Scores in a notebook: every number with its count and its interval."""

from __future__ import annotations

from uwbbench.api import registry
from uwbbench.api.metric import Outcome
from uwbbench.measure.accuracy.evidence import SHORTEST_S
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.scoring import ScoreBlock, Scores
from uwbbench.measure.accuracy.stats import Estimate, estimated
from uwbbench.show.notebook import elements
from uwbbench.show.text.numbers import UNDEFINED, between, number
from uwbbench.show.text.quantity import Quantity
from uwbbench.show.text.wording import TABLES, table_name


def scores(shown: Scores) -> str:
    """HTML of scores: each table's metrics with n and a 95 % interval within the recording, and the counts."""
    rules = shown.rules
    parts = []
    for name in TABLES:
        block = shown[name]
        if block is not None:
            title = table_name(rules.scoring, name)
            parts += [f"<div>{elements.text(title)}</div>", _table(shown.outcomes[name], rules.scoring), _counts(block)]
    return elements.frame("scores", f"{rules.scoring}, gate {100 * rules.gate_m:g} cm", *parts)


def _table(outcome: Outcome, scoring: str) -> str:
    metrics = MetricChoice(list(registry.entries("metrics")), [scoring])
    estimates = {name: estimated(metric, [outcome]) for name, metric in metrics.items() if name not in metrics.absent}
    rows = [_row(Quantity.of(name, metrics[name]), estimate) for name, estimate in estimates.items()]
    enough = "intervals: 95 %, within this recording only, from four blocks of it; says nothing about other scenes"
    few = f"intervals: of one scene that may end all or nothing; the recording is shorter than {SHORTEST_S:g} s"
    if outcome.of_run:
        few = "one run: no interval"
    note = enough if any(estimate.within for estimate in estimates.values()) else few
    return elements.table(("metric", "value", "interval", "n"), rows, numbers=True) + elements.notes([note])


def _row(quantity: Quantity, estimate: Estimate) -> tuple[str, str, str, str]:
    shown = quantity.digits, quantity.factor
    value, ends = number(estimate.value, *shown), between(estimate.low, estimate.high, *shown)
    held = "" if value == UNDEFINED else ends or UNDEFINED
    return quantity.axis, value, held, f"{estimate.n} {quantity.samples}"


def _counts(block: ScoreBlock) -> str:
    if not block.counts:
        return elements.notes([f"{block.unprocessed} steps have no pose"] if block.unprocessed else [])
    sentences = [f"{block.tp} true, {block.fp} false, {block.fn} missed in {block.frames} scored frames"]
    sentences += [f"{block.true_empty} frames with nothing to find and nothing found"] if block.true_empty else []
    sentences += [f"{block.unprocessed} labelled frames were not processed"] if block.unprocessed else []
    if not block.exhaustive:
        sentences.append(f"truth not exhaustive: {block.unmatched} unmatched detections prove nothing")
    return elements.notes(sentences)
