"""Checks of a plugin's source text: what it imports at start, and what it must never do with data."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from uwbbench.api.case import NotApplicable
from uwbbench.tools.check.check import Nonconformity, check
from uwbbench.tools.check.subject import ClassSubject

HEAVY = ("scipy.signal", "scipy.stats", "sklearn", "numba", "pandas", "matplotlib", "torch", "tensorflow")
"""Libraries that take longer to import than a short run takes."""
_CODE = ("eval", "exec")
_PICKLES = ("pickle", "dill", "cloudpickle", "marshal", "shelve")


def _tree(subject: ClassSubject) -> tuple[Path, ast.Module]:
    file = subject.source_file
    if file is None:
        raise NotApplicable("its source is not there")
    return file, ast.parse(file.read_text(encoding="utf-8"), filename=str(file))


def _at_import(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements that run when the module is imported, apart from those for type checkers."""
    for node in body:
        yield node
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            yield from _at_import(node.orelse)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            for part in ("body", "orelse", "finalbody"):
                yield from _at_import(getattr(node, part, []))


def _imported(node: ast.AST) -> list[str]:
    """Full names that an import statement may load."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        return [f"{node.module}.{alias.name}" for alias in node.names]
    return []


def _is_within(name: str, package: str) -> bool:
    return name == package or name.startswith(f"{package}.")


@check("uwbbench.api.compiling")
def imports_are_light(subject: ClassSubject) -> None:
    """Heavy libraries are imported where they are first needed, in ``open`` say: others list and load it too."""
    file, tree = _tree(subject)
    for node in _at_import(tree.body):
        for name in _imported(node):
            heavy = next((one for one in HEAVY if _is_within(name, one)), None)
            if heavy:
                place = f"{file.name}:{getattr(node, 'lineno', 0)}"
                raise Nonconformity("no heavy library at the top of the module", f"{place} imports {heavy}")


@check("uwbbench.api")
def imports_are_public(subject: ClassSubject) -> None:
    """Of uwbbench only ``uwbbench.api`` is imported: all else may change with any version."""
    file, tree = _tree(subject)
    if subject.package == "uwbbench":
        raise NotApplicable("it comes with uwbbench itself")
    for node in ast.walk(tree):
        for name in _imported(node):
            if _is_within(name, "uwbbench") and not _is_within(name, "uwbbench.api"):
                place = f"{file.name}:{getattr(node, 'lineno', 0)}"
                raise Nonconformity("imports of uwbbench.api alone", f"{place} imports {name}")


@check("pickle")
def runs_no_foreign_code(subject: ClassSubject) -> None:
    """Nothing is unpickled or evaluated: a data file must not be able to run code."""
    file, tree = _tree(subject)
    for node in ast.walk(tree):
        unsafe = next((name for name in _imported(node) if name.partition(".")[0] in _PICKLES), "")
        if isinstance(node, ast.Call):
            called = node.func.id if isinstance(node.func, ast.Name) else ""
            unsafe = f"{called}()" if called in _CODE else unsafe
            if any(_allows_pickle(keyword) for keyword in node.keywords):
                unsafe = "allow_pickle=True"
        if unsafe:
            place = f"{file.name}:{getattr(node, 'lineno', 0)}"
            raise Nonconformity(
                "no pickle, marshal, eval or exec, and numpy files without pickles", f"{place}: {unsafe}"
            )


def _allows_pickle(keyword: ast.keyword) -> bool:
    value = keyword.value
    return keyword.arg == "allow_pickle" and not (isinstance(value, ast.Constant) and value.value is False)


CHECKS = (imports_are_light, imports_are_public, runs_no_foreign_code)
