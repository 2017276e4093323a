"""Finding plugins by name, without importing any before one is asked for.

Plugins are entry points of seven groups: stages, mappers, datasets, metrics, terms and kernels are classes; a detector
is a YAML file in a package, named ``package.module:file.yaml``. Built-in plugins are registered in the same way.

Two more groups say what belongs to plugins, so that the framework names none: ``uwbbench.defaults`` maps a role to the
plugin that fills it where nobody names one, and ``uwbbench.cases`` holds the hard cases of a package's stages.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, entry_points
from pathlib import Path
from typing import Any, Literal, get_args

from uwbbench.api.errors import PluginError, nearest
from uwbbench.api.interruption import by_plugin

ClassKind = Literal["stages", "mappers", "datasets", "metrics", "terms", "kernels"]
PluginKind = ClassKind | Literal["detectors"]
Group = PluginKind | Literal["defaults", "cases"]
AuthoredKind = Literal["stage", "mapper", "detector", "dataset", "metric"]
"""Kinds, in the singular, that a package can be written for and that have conformance checks."""
AUTHORED_KINDS: tuple[AuthoredKind, ...] = get_args(AuthoredKind)
KINDS: tuple[PluginKind, ...] = ("stages", "mappers", "detectors", "datasets", "metrics", "terms")
"""Kinds whose names people write in files; kernels step in by themselves."""

_CLASSES = ("stages", "mappers", "datasets", "metrics", "terms")
HERE_ALONE = "this process"
"""Package of what :func:`register` has named."""

_registered: dict[tuple[str, str], type[Any]] = {}


@dataclass(frozen=True)
class Entry:
    """One registered name.

    Attributes
    ----------
    name : str
    target : str
        ``module:attribute``.
    package : str
        Distribution and version that registers it.
    rivals : tuple of str
        Other packages that register the same name: such a name cannot be used.
    """

    name: str
    target: str
    package: str
    rivals: tuple[str, ...] = ()


@cache
def _package(distribution: Distribution | None) -> str:
    """Name and version; read once for all that a distribution registers, as that takes longer than the rest."""
    if distribution is None:
        return "unknown package"
    facts = distribution.metadata
    return f"{facts['Name']} {facts['Version']}"


@cache
def entries(kind: Group) -> dict[str, Entry]:
    """All registered names of a kind, sorted; imports nothing."""
    known: dict[str, Entry] = {}
    for point in sorted(entry_points(group=f"uwbbench.{kind}"), key=lambda point: point.name):
        mine = Entry(point.name, point.value, _package(point.dist))
        other = known.get(point.name)
        if other is None:
            known[point.name] = mine
        elif (other.target, other.package) != (mine.target, mine.package):  # one distribution seen twice on the path
            known[point.name] = Entry(other.name, other.target, other.package, (*other.rivals, mine.package))
    for (of_kind, name), plugin in _registered.items():
        if of_kind == kind:
            known[name] = Entry(name, f"{plugin.__module__}:{plugin.__qualname__}", HERE_ALONE)
    return known


def registered() -> dict[tuple[str, str], type[Any]]:
    """Classes that were given a name in this process, by kind and name."""
    return dict(_registered)


def take_over(classes: Mapping[tuple[str, str], type[Any]]) -> None:
    """Know just these classes by the names that they were given in another process.

    Parameters
    ----------
    classes : mapping
        As :func:`registered` gives them there.
    """
    _registered.clear()
    _registered.update(classes)
    entries.cache_clear()
    load_plugin.cache_clear()


def register(kind: Literal["stages", "mappers", "datasets", "metrics", "terms"], name: str, plugin: type[Any]) -> None:
    """Give a class a name in this process, as an entry point of an installed package does everywhere.

    For scripts and notebooks. The workers of a run are given the class; other processes do not know the name: what is
    timed, or called from the command line, needs a package, which ``uwbbench new`` writes.

    Parameters
    ----------
    kind : {"stages", "mappers", "datasets", "metrics", "terms"}
    name : str
        A name that was registered here before is given to the new class, as when a cell of a notebook runs again.
    plugin : type
        Class of that kind.

    Raises
    ------
    PluginError
        If an installed package has that name, or there is no such kind.
    """
    if kind not in _CLASSES:
        raise PluginError(f"no kind of class '{kind}' can be registered; expected one of {', '.join(_CLASSES)}")
    if not isinstance(plugin, type):
        raise PluginError(f"{kind[:-1]} '{name}': expected a class, found {plugin!r}")
    known = entries(kind).get(name)
    if known is not None and known.package != HERE_ALONE:
        raise PluginError(f"{kind[:-1]} '{name}' comes with {known.package}; give yours another name")
    _registered[kind, name] = plugin
    entries.cache_clear()
    load_plugin.cache_clear()


def entry(kind: Group, name: str) -> Entry:
    """Entry of a name.

    Raises
    ------
    PluginError
        If the name is unknown or claimed by two packages.
    """
    known = entries(kind)
    if name not in known:
        raise PluginError(f"no {kind[:-1]} named '{name}' is installed.{nearest(name, known)}")
    registered = known[name]
    if registered.rivals:
        packages = ", ".join((registered.package, *registered.rivals))
        raise PluginError(f"{kind[:-1]} '{name}' is registered by several packages ({packages}); uninstall all but one")
    return registered


def default(role: str) -> str:
    """Registered name of the plugin that fills a role where nobody names one.

    Roles are ``port.PORT``, the stage that makes a port; ``stage.idle``, which finds nothing, and ``stage.constant``,
    which yields one detection in every frame; ``dataset.files`` and ``dataset.scenes``, which read capture files and
    scenes, and ``dataset.limits``, the signals that physical limits are known of; ``detector.reference`` of relative
    times.

    Raises
    ------
    PluginError
        If no installed package fills the role, or two do.
    """
    return entry("defaults", role).target


def makers() -> dict[str, str]:
    """Stage that makes each port where nobody names one, by port; imports nothing."""
    roles = [role for role in entries("defaults") if role.startswith("port.")]
    return {role.removeprefix("port."): default(role) for role in roles}


@cache
def load_plugin(kind: ClassKind, name: str) -> type[Any]:
    """Class behind a name.

    Raises
    ------
    PluginError
        If the name is unknown, claimed twice, or its module cannot be imported; other plugins stay usable.
    """
    loaded = load_object(kind, name)
    if not isinstance(loaded, type):
        registered = entry(kind, name)
        raise PluginError(f"{kind[:-1]} '{name}' of {registered.package}: {registered.target} is not a class")
    return loaded


def load_object(kind: ClassKind | Literal["cases"], name: str) -> Any:
    """Whatever is registered by a name, as :func:`load_plugin` does, which asks for a class."""
    registered = entry(kind, name)
    if registered.package == HERE_ALONE:
        return _registered[kind, name]
    module, _, attribute = registered.target.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except BaseException as error:  # whatever a plugin's import raises is that plugin's fault alone
        if not by_plugin(error):
            raise
        cause = f"{type(error).__name__}: {error}"
        raise PluginError(
            f"{kind[:-1]} '{name}' of {registered.package} cannot be loaded from {registered.target}: {cause}"
        ) from error


def detector_file(name: str) -> Path:
    """YAML file of a detector that a package registers.

    Raises
    ------
    PluginError
        If the name is unknown or claimed twice, or the file is not in the package.
    """
    registered = entry("detectors", name)
    module, _, filename = registered.target.partition(":")
    try:
        spec = importlib.util.find_spec(module)
    except BaseException as error:  # finding a module imports the packages above it, which may raise anything
        if not by_plugin(error):
            raise
        raise PluginError(f"detector '{name}' of {registered.package}: no package {module} ({error})") from error
    folders = list(spec.submodule_search_locations or []) if spec else []
    for folder in folders:
        if (Path(folder) / filename).is_file():
            return Path(folder) / filename
    raise PluginError(f"detector '{name}' of {registered.package}: no file {filename} in package {module}")
