"""What a plugin's name makes of the names of its package, module and class."""

from __future__ import annotations

import importlib.util
import keyword
import re
from dataclasses import dataclass

from uwbbench.api import registry
from uwbbench.api.errors import ConfigError
from uwbbench.api.locate import shipped

LONGEST = 60
_PATTERN = re.compile(r"[A-Za-z][A-Za-z0-9]*([._-][A-Za-z0-9]+)*")


@dataclass(frozen=True)
class PluginName:
    """A name that a new plugin may bear.

    Parameters
    ----------
    kind : str
        ``stage``, ``mapper``, ``detector``, ``dataset`` or ``metric``.
    name : str
        Name to be registered, such as ``clutter.mine``.

    Raises
    ------
    ConfigError
        If the name is malformed, a Python keyword, or taken.

    Examples
    --------
    >>> name = PluginName("stage", "clutter.my-own")
    >>> name.project, name.package, name.module, name.class_name
    ('uwbbench-clutter-my-own', 'uwbbench_clutter_my_own', 'clutter_my_own', 'ClutterMyOwn')
    """

    kind: str
    name: str

    def __post_init__(self) -> None:
        name = self.name
        if len(name) > LONGEST:
            raise ConfigError(f"name '{name[:20]}...' has {len(name)} characters; at most {LONGEST} are allowed")
        if not _PATTERN.fullmatch(name):
            raise ConfigError(
                f"name {name!r} must start with a letter and hold ASCII letters and digits, with single dots, dashes "
                "or underscores between them, such as 'clutter.mine'"
            )
        if keyword.iskeyword(self.module) or keyword.iskeyword(name):
            raise ConfigError(f"name '{name}' is a Python keyword; choose another, such as 'my.{name}'")
        self._check_free()

    def _check_free(self) -> None:
        known = registry.entries(f"{self.kind}s")
        owner = f"{known[self.name].package} ({known[self.name].target})" if self.name in known else ""
        if self.kind == "detector" and self.name in shipped("detectors"):
            owner = "uwbbench, which ships it"
        if owner:
            raise ConfigError(
                f"{self.kind} '{self.name}' is taken by {owner}; choose another, such as 'my.{self.name}'"
            )
        close = [other for other in known if _plain(other) == _plain(self.name)]
        if close:
            raise ConfigError(
                f"{self.kind} '{self.name}' would be mistaken for '{close[0]}' of {known[close[0]].package}; choose "
                f"another, such as 'my.{self.name}'"
            )
        if importlib.util.find_spec(self.package) is not None:
            raise ConfigError(f"a package {self.package} is installed; choose another name than '{self.name}'")

    @property
    def project(self) -> str:
        """Name of the distribution, and of its folder."""
        return f"uwbbench-{_plain(self.name).replace('_', '-')}"

    @property
    def module(self) -> str:
        """Name of the module."""
        return _plain(self.name)

    @property
    def package(self) -> str:
        """Name of the import package."""
        return f"uwbbench_{self.module}"

    @property
    def class_name(self) -> str:
        """Name of the class."""
        return "".join(part[:1].upper() + part[1:] for part in re.split(r"[._-]", self.name))


def _plain(name: str) -> str:
    """Name as Python can import it."""
    return re.sub(r"[._-]", "_", name).lower()
