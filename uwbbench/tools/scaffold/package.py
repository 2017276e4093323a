"""Writing a plugin package: templates filled in, whole or not at all."""

from __future__ import annotations

import os
import shutil
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template

import uwbbench
from uwbbench.api.errors import StoreError
from uwbbench.api.registry import AuthoredKind
from uwbbench.tools.scaffold.naming import PluginName


def write_package(kind: AuthoredKind, name: str, folder: Path) -> Path:
    """Write a small installable package with one plugin and its tests.

    Parameters
    ----------
    kind : {"stage", "mapper", "detector", "dataset", "metric"}
    name : str
        Name to be registered.
    folder : Path
        Where the package's own folder goes; made if missing.

    Returns
    -------
    Path
        The package's folder.

    Raises
    ------
    ConfigError
        If the name cannot be used.
    StoreError
        If the folder is there already, or cannot be written; nothing is then left behind.
    """
    names = PluginName(kind, name)
    target = folder / names.project
    if os.path.lexists(target):
        raise StoreError(f"{target}: is there already; nothing was written")
    partial = folder / f".{names.project}.part"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        partial.mkdir()
    except FileExistsError as error:
        raise StoreError(f"{error.filename}: is there already; nothing was written") from error
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written: {error.strerror}") from error
    try:
        for path, text in _files(kind, names).items():
            (partial / path).parent.mkdir(parents=True, exist_ok=True)
            (partial / path).write_text(text, encoding="utf-8")
        partial.rename(target)
    except OSError as error:
        raise StoreError(f"{target}: cannot be written: {error.strerror}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return target


def _files(kind: AuthoredKind, names: PluginName) -> dict[str, str]:
    """Text of each file by its path in the package."""
    source = f"src/{names.package}"
    facts = {
        "kind": kind,
        "name": names.name,
        "project": names.project,
        "package": names.package,
        "module": names.module,
        "class_name": names.class_name,
        "bounds": _bounds(uwbbench.__version__),
        "target": f"{names.package}.{names.module}:{names.class_name}",
    }
    places = {
        "common/pyproject.toml": "pyproject.toml",
        "common/README.md": "README.md",
        "common/gitignore": ".gitignore",
        "common/test_conformance.py": "tests/test_conformance.py",
        f"{kind}/test_module.py": f"tests/test_{names.module}.py",
    }
    files = {f"{source}/__init__.py": f'"""The {kind} {names.name} for uwbbench."""\n'}
    if kind == "detector":
        facts["target"] = f"{names.package}.detectors:{names.module}.yaml"
        files[f"{source}/detectors/__init__.py"] = '"""Detectors of this package, as YAML."""\n'
        places["detector/module.yaml"] = f"{source}/detectors/{names.module}.yaml"
    else:
        files[f"{source}/py.typed"] = ""
        places[f"{kind}/module.py"] = f"{source}/{names.module}.py"
    if kind == "dataset":
        places["dataset/sample.csv"] = f"{source}/sample.csv"
    folder: Traversable = resources.files(__package__) / "templates"
    for template, path in places.items():
        text = (folder / f"{template}.tmpl").read_text(encoding="utf-8")
        files[path] = Template(text).substitute(facts)
    return files


def _bounds(version: str) -> str:
    """Versions of uwbbench that a plugin made with this one fits.

    Examples
    --------
    >>> _bounds("0.1.0")
    '>=0.1,<0.2'
    """
    major, minor = version.split(".")[:2]
    return f">={major}.{minor},<{major}.{int(minor) + 1}"
