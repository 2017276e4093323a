"""Parameters to examine a plugin with, where its author gives none."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain
from typing import Any

from pydantic import ValidationError

from uwbbench.api import registry
from uwbbench.api.case import NotApplicable
from uwbbench.api.check import checked
from uwbbench.api.errors import UwbbenchError
from uwbbench.api.locate import shipped
from uwbbench.api.stage import Params
from uwbbench.api.yaml_file import YamlFile
from uwbbench.config.detector import Step, read_detector

CHANNEL = 9
"""Channel of the capture that plugins are tried on."""


def working_params(model: type[Params], given: Mapping[str, Any], subject: str, use: str = "") -> Params:
    """Parameters that the model takes: those given; else the defaults; else what a detector gives; else plain numbers.

    Parameters
    ----------
    model : type of Params
    given : mapping
        From the plugin's author; wins.
    subject : str
        What is examined, for messages.
    use : str
        Name of a stage, to be looked for in detectors.

    Raises
    ------
    ConfigError
        If those given are wrong.
    NotApplicable
        If no values could be found.
    """
    if given:
        return checked(model, dict(given), YamlFile(f"parameters of {subject}", dict(given), {}))
    for values in chain([{}], _from_detectors(use), _plain(model)):
        with contextlib.suppress(ValidationError):
            return model.model_validate(values)
    wanted = ", ".join(name for name, field in model.model_fields.items() if field.is_required())
    raise NotApplicable(f"it needs parameters ({wanted or 'see its docstring'}): give them with --set NAME=VALUE")


def _from_detectors(use: str) -> Iterator[dict[str, Any]]:
    """Parameters with which known detectors use a stage."""
    for name in [*shipped("detectors"), *registry.entries("detectors")] if use else ():
        with contextlib.suppress(UwbbenchError):  # a detector that cannot be read gives no hint
            yield from (step.params_for(CHANNEL)[0] for step in _steps(name) if step.use == use)


@cache
def _steps(detector: str) -> tuple[Step, ...]:
    return read_detector(detector).steps


def _plain(model: type[Params]) -> Iterator[dict[str, Any]]:
    """Ones for all required numbers, alone and with one optional number set too."""
    required = {name: 1.0 for name, field in model.model_fields.items() if field.is_required()}
    yield required
    for name, field in model.model_fields.items():
        if not field.is_required():
            yield {**required, name: 1.0}
