"""What all models of configuration files have in common."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict


class ConfigModel(BaseModel):
    """Part of a configuration file: no unknown keys, no NaN, and unchangeable once it is checked."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True, allow_inf_nan=False, frozen=True)


def _named_null(value: Any) -> Any:
    return "null" if value is None else value


NamedNull = BeforeValidator(_named_null)
"""Takes YAML's null for the detector of that name."""

DetectorName = Annotated[str, NamedNull]
"""Name of a detector, or path to its file."""
