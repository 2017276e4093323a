"""A plugin under examination: what it is, and what it makes of the usual input."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from numpy.typing import NDArray

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError, PluginError
from uwbbench.api.registry import AuthoredKind
from uwbbench.tools.check.params import working_params
from uwbbench.tools.check.values import Values, digest


class Subject:
    """One plugin.

    Parameters
    ----------
    name : str
        Registered name.
    params : mapping
        Parameters to examine it with, as a file would give them.
    roots : sequence of Path
        Folders that a dataset searches.
    """

    kind: ClassVar[AuthoredKind]

    def __init__(self, name: str, params: Mapping[str, Any] | None = None, roots: tuple[Path, ...] = ()) -> None:
        self.name = name
        self.given = dict(params or {})
        self.roots = roots

    def result(self) -> Values:
        """What a fresh instance makes of the usual input."""
        raise NotImplementedError

    def input_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of the usual input; empty where the plugin is given none."""
        raise NotImplementedError

    @cached_property
    def usual(self) -> Values:
        """:meth:`result`, once."""
        return self.result()

    @cached_property
    def digest_elsewhere(self) -> str:
        """Hash of the result in a new process with another hash seed."""
        from uwbbench.tools.check.process import digests_elsewhere

        return digests_elsewhere([self])[0]

    @cached_property
    def digest(self) -> str:
        """Hash of the result in this process."""
        return digest(self.usual)


class ClassSubject(Subject):
    """A plugin that is a class.

    Raises
    ------
    PluginError
        If it cannot be loaded, or is no class of its kind.
    ConfigError
        If it has no such parameters.
    """

    base: ClassVar[type]

    def __init__(self, name: str, params: Mapping[str, Any] | None = None, roots: tuple[Path, ...] = ()) -> None:
        super().__init__(name, params, roots)
        kind: Any = f"{self.kind}s"
        self.cls: Any = registry.load_plugin(kind, name)
        registered = registry.entry(kind, name)
        self.package = registered.package.partition(" ")[0]
        if not issubclass(registry.load_plugin(kind, name), self.base):
            raise PluginError(
                f"{self.kind} '{name}' of {registered.package}: {registered.target} is no {self.base.__name__}"
            )
        if self.given and self.kind == "metric":
            raise ConfigError(f"metric '{name}' has no parameters; {', '.join(self.given)} cannot be set")
        if self.given:
            working_params(self.cls.params_type(), self.given, f"{self.kind} '{name}'")

    @property
    def source_file(self) -> Path | None:
        """File that the class is written in."""
        file = inspect.getsourcefile(self.cls)
        return Path(file) if file else None
