"""The back end of a detector file: the mapper that all front ends of a run answer to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from uwbbench.api import registry
from uwbbench.api.check import checked
from uwbbench.api.errors import PluginError
from uwbbench.api.yaml_file import YamlFile


class MapperModel(BaseModel):
    """The mapper of a detector that answers with poses and a map."""

    model_config = ConfigDict(extra="forbid")

    use: str = Field(description="Registered name of the mapper.")
    params: dict[str, Any] = Field(default_factory=dict, description="Parameters of the mapper.")
    front: dict[str, dict[str, Any]] = Field(
        default_factory=dict,
        description="Changes to the pipeline of single receivers: values by path in the pipeline, by receiver.",
    )


@dataclass(frozen=True)
class MapperUse:
    """A mapper, with parameters as written.

    Attributes
    ----------
    use : str
        Its registered name.
    params : dict
        Checked, as written.
    front : dict of dict
        Changes to the pipeline by receiver: values by path in the pipeline.
    """

    use: str
    params: dict[str, Any] = field(default_factory=dict)
    front: dict[str, dict[str, Any]] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """As plain values."""
        return {"use": self.use, "params": self.params} | ({"front": self.front} if self.front else {})


def check_mapper(model: MapperModel | None, source: YamlFile) -> MapperUse | None:
    """Mapper of a file, looked up and its parameters checked; None where the file has none.

    Raises
    ------
    ConfigError, PluginError
        With file, line and key.
    """
    if model is None:
        return None
    try:
        mapper = registry.load_plugin("mappers", model.use)
    except PluginError as error:
        raise PluginError(f"{source.place(('mapper', 'use'))}: {error}") from error
    checked(mapper.params_type(), model.params, source, ("mapper", "params"))
    return MapperUse(model.use, model.params, model.front)
