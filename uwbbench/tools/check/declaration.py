"""Checks of what a plugin's class says of itself: docstring, origin, parameters, and what its source imports."""

from __future__ import annotations

import inspect
import json
import re
from typing import Annotated, Any

from pydantic import BaseModel, TypeAdapter, ValidationError

from uwbbench.api.case import NotApplicable
from uwbbench.api.check import checked
from uwbbench.api.errors import ConfigError
from uwbbench.api.stage import Params, describe
from uwbbench.api.yaml_file import parse_yaml
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.params import working_params
from uwbbench.tools.check.subject import ClassSubject

FIDELITIES = ("from-source", "reconstruction", "baseline", "reference")
_SOURCE = re.compile(r"\b(1[89]|20)\d\d\b|arXiv|doi|IEEE|ITU|ISO|https?://")


@check("uwbbench.api.stage.describe")
def docstring_says_what_it_is(subject: ClassSubject) -> str:
    """The docstring's first line is a plain sentence with a full stop: lists and reports show it."""
    own = subject.cls.__dict__.get("__doc__")
    line = describe(subject.cls) if own else ""
    if not line.endswith("."):
        raise Nonconformity("a first line that ends in a full stop", repr(line) if line else "no docstring")
    return line


@check("uwbbench.api.stage.Stage")
def origin_is_stated(subject: ClassSubject) -> str:
    """``fidelity`` is one of four words, and what is from a source or reconstructed names it in a docstring."""
    fidelity = subject.cls.fidelity
    if fidelity not in FIDELITIES:
        raise Nonconformity(f"fidelity {', '.join(FIDELITIES)}", repr(fidelity))
    module = inspect.getmodule(subject.cls)
    docs = f"{subject.cls.__doc__}\n{module.__doc__ if module else ''}"
    if fidelity in FIDELITIES[:2] and not _SOURCE.search(docs):
        raise Nonconformity(
            f"a citation beside fidelity '{fidelity}', such as a year, an arXiv number or a DOI",
            "none in the docstrings of class and module",
        )
    return str(fidelity)


def _model(subject: ClassSubject) -> type[Params]:
    model: type[Params] = subject.cls.params_type()
    if not model.model_fields:
        raise NotApplicable("it has no parameters")
    return model


@check("uwbbench.api.stage.Params")
def parameters_are_documented(subject: ClassSubject) -> str:
    """Every parameter has a description: editors, ``uwbbench show`` and the schema print it."""
    model = _model(subject)
    bare = [name for name, field in model.model_fields.items() if not field.description]
    if bare:
        raise Nonconformity("Field(..., description=...) for each parameter", f"none for {', '.join(bare)}")
    return f"{len(model.model_fields)} parameters"


@check("uwbbench.api.stage.Params")
def defaults_are_valid(subject: ClassSubject) -> None:
    """Defaults pass the checks that values from a file go through: pydantic does not check them on its own."""
    for name, field in _model(subject).model_fields.items():
        if not field.is_required():
            annotated: Any = Annotated[field.annotation, field]
            try:
                TypeAdapter(annotated).validate_python(field.get_default(call_default_factory=True))
            except ValidationError as error:
                observed = f"{name}: {error.errors(include_url=False)[0]['msg']}"
                raise Nonconformity("defaults that their own limits allow", observed) from error
    working_params(subject.cls.params_type(), subject.given, f"{subject.kind} '{subject.name}'", subject.name)


@check("uwbbench.api.stage.Params")
def unknown_parameters_are_refused(subject: ClassSubject) -> None:
    """A parameter that does not exist is an error with file and line: a typing mistake must not pass as a default."""
    source = parse_yaml("use: x\nparams:\n  no_such_parameter: 1\n", "mine.yaml")
    try:
        checked(subject.cls.params_type(), source.data["params"], source, ("params",))
    except ConfigError as error:
        if "mine.yaml:3" in str(error) and "unknown key 'no_such_parameter'" in str(error):
            return
        observed = f"the message {str(error).partition(chr(10))[0]!r}"
    else:
        observed = "that the parameter was taken"
    raise Nonconformity("an error that names file, line and key; derive the model from uwbbench.api.Params", observed)


@check("uwbbench.api.stage.Params")
def parameters_do_not_change(subject: ClassSubject) -> None:
    """Parameters are frozen and finite: what a manifest says must be what ran."""
    config = _model(subject).model_config
    if not config.get("frozen") or config.get("allow_inf_nan", True):
        raise Nonconformity("a model with frozen=True and allow_inf_nan=False, as uwbbench.api.Params is", str(config))


@check("uwbbench.tools.schema")
def schema_is_made(subject: ClassSubject) -> None:
    """The parameters have a JSON schema: editors complete and check with it."""
    model: type[BaseModel] = _model(subject)
    json.dumps(model.model_json_schema(), allow_nan=False)


CHECKS = (
    docstring_says_what_it_is,
    parameters_are_documented,
    defaults_are_valid,
    unknown_parameters_are_refused,
    parameters_do_not_change,
    schema_is_made,
)
