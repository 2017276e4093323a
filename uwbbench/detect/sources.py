"""Hash of the source of a plugin: of its module, and of what that takes from its own package."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path


def source_hash(module: str) -> str:
    """SHA-256 over the files that decide what a module does.

    These are the module's own file and those of its package that it imports, directly or by way of others, wherever
    in a file the import stands. A change elsewhere in the package leaves the hash as it is.

    Parameters
    ----------
    module : str
        Name of an importable module.
    """
    digest = hashlib.sha256()
    for name, content in sorted(_contents(module)):
        digest.update(f"{name} {content}\n".encode())
    return digest.hexdigest()


def _contents(module: str) -> Iterator[tuple[str, str]]:
    """A module, and what it imports from its own package: names, and hashes of their files."""
    seen: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in seen or name.partition(".")[0] != module.partition(".")[0]:
            continue
        seen.add(name)
        try:
            spec = importlib.util.find_spec(name)
        except ModuleNotFoundError:  # a name inside a module, not a module
            continue
        except ValueError:  # a script that was started by its path; a notebook has no file
            spec = None
        origin = getattr(sys.modules.get(name), "__file__", None) if spec is None else spec.origin
        if origin is None or not origin.endswith(".py"):
            continue
        path = Path(origin)
        known = path.stat()
        is_package = spec is not None and spec.submodule_search_locations is not None
        package = name if is_package else name.rpartition(".")[0]
        content, imported = _read(path, package, known.st_mtime_ns, known.st_size)
        yield name, content
        waiting += imported


@lru_cache(maxsize=512)
def _read(path: Path, package: str, _modified_ns: int, _size: int) -> tuple[str, tuple[str, ...]]:
    """Hash of a file of a package, and the names in its imports; read again only where the file has changed."""
    content = path.read_bytes()
    names: list[str] = []
    for node in ast.walk(ast.parse(content)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: package.count(".") + 2 - node.level] if node.level else []
            base = ".".join([*above, node.module or ""]).strip(".")
            names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return hashlib.sha256(content).hexdigest(), tuple(names)
