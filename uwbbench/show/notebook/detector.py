"""A detector in a notebook: its chain, each step with what it does and its parameters."""

from __future__ import annotations

from typing import Any

from uwbbench.api import registry
from uwbbench.api.errors import PluginError
from uwbbench.api.stage import describe
from uwbbench.api.text import without_markup
from uwbbench.config.detector import BY_CHANNEL, Step
from uwbbench.detect.pipeline import Pipeline
from uwbbench.show.notebook import elements


def detector(shown: Pipeline) -> str:
    """HTML of a detector: the chain in order; a step folds out into its parameters."""
    config = shown.config
    facts = {"about": config.description, "fidelity": config.fidelity, "citation": config.citation}
    steps = [_step(number, step) for number, step in enumerate(config.steps, start=1)]
    return elements.frame("detector", shown.name, elements.facts(facts), *steps)


def _step(number: int, step: Step) -> str:
    try:
        stage = registry.load_plugin("stages", step.use)
    except PluginError as error:  # uninstalled since the detector was loaded
        return elements.folded(f"{number}. <strong>{elements.text(step.label)}</strong>", elements.notes([error]))
    use = "" if step.use == step.label else f" ({elements.text(step.use)})"
    tags = ["optional: left out where the capture lacks what it needs"] if step.optional else []
    tags += [f"left out where {step.unless} is in use"] if step.unless else []
    tags += [f"inserted for {step.implied_by}"] if step.implied_by else []
    tag = f" <em>{elements.text('; '.join(tags))}</em>" if tags else ""
    summary = f"{number}. <strong>{elements.text(step.label)}</strong>{use}: {elements.text(describe(stage))}{tag}"
    rows = [
        (
            name,
            _value(step.params.get(name, field.get_default(call_default_factory=True))),
            "set" if name in step.params else "default",
            without_markup(field.description or ""),
        )
        for name, field in stage.params_type().model_fields.items()
    ]
    inside = elements.table(("parameter", "value", "", "meaning"), rows) if rows else elements.notes(["no parameters"])
    return elements.folded(summary, inside, optional=step.optional)


def _value(value: Any) -> str:
    """Parameter for people; one that depends on the channel names each.

    Examples
    --------
    >>> _value({"by_channel": {"5": 1.0, "other": 0.2}}), _value(None)
    ('channel 5: 1.0, other: 0.2', 'null')
    """
    if isinstance(value, dict) and set(value) == {BY_CHANNEL}:
        names = {key: key if key == "other" else f"channel {key}" for key in value[BY_CHANNEL]}
        return ", ".join(f"{names[key]}: {one}" for key, one in value[BY_CHANNEL].items())
    return "null" if value is None else str(value)
