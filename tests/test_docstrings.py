"""Docstrings name what a caller hands over."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("uwbbench", "detectors", "datasets")

LEAST = 3
"""Parameters from which on a section must describe them."""


def commands(module: ast.Module) -> set[str]:
    """Functions that a module registers as ``app.command(...)(function)``, whose docstrings are their help texts.

    Their options carry a help text each, where terminals show it, so that a section would say it a second time.
    """
    return {
        argument.id
        for call in ast.walk(module)
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Call)
        if ast.unparse(call.func.func).endswith(".command")
        for argument in call.args
        if isinstance(argument, ast.Name)
    }


def public_functions(body: list[ast.stmt], within: str = "") -> Iterator[tuple[str, ast.FunctionDef]]:
    """Public functions of a module, and public methods of its public classes, with their dotted names."""
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from public_functions(node.body, f"{within}{node.name}.")
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not node.name.startswith("_"):
            yield f"{within}{node.name}", node


def undescribed(source: str, *, is_cli: bool = False) -> list[str]:
    """``line name`` of the public functions with LEAST parameters or more and no Parameters section."""
    module = ast.parse(source)
    registered = commands(module) if is_cli else set()
    lacking = []
    for name, function in public_functions(module.body):
        given = function.args
        parameters = [*given.posonlyargs, *given.args, *given.kwonlyargs]
        count = sum(parameter.arg not in ("self", "cls") for parameter in parameters)
        excepted = name in registered or any(ast.unparse(one).endswith("overload") for one in function.decorator_list)
        if count >= LEAST and not excepted and "Parameters\n---" not in (ast.get_docstring(function) or ""):
            lacking.append(f"{function.lineno} {name}")
    return lacking


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_public_function_with_three_parameters_describes_them(folder: str) -> None:
    files = sorted((ROOT / folder).rglob("*.py"))
    assert files, f"no modules in {folder}"
    lacking = [
        f"{file.relative_to(ROOT)}:{place}"
        for file in files
        for place in undescribed(file.read_text(encoding="utf-8"), is_cli="cli" in file.parts)
    ]
    assert not lacking, "no Parameters section:\n" + "\n".join(lacking)


DESCRIBED = '''
def described(a, b, c):
    """Do it.

    Parameters
    ----------
    a, b, c : int
    """
'''


@pytest.mark.parametrize(
    ("source", "lacking"),
    [
        (DESCRIBED, []),
        ("def bare(a, b, *, c): ...", ["1 bare"]),
        ("def two(a, b): ...", []),
        ("def _private(a, b, c): ...", []),
        ("class Box:\n    def fill(self, a, b, c): ...\n    def two(self, a, b): ...", ["2 Box.fill"]),
        ("class _Box:\n    def fill(self, a, b, c): ...", []),
        ("def run(a, b, c): ...\ndef register(app):\n    app.command(epilog='Example')(run)", []),
        ("def help(a, b, c): ...\ndef register(app):\n    app.command(epilog='Example')(run)", ["1 help"]),
    ],
)
def test_what_lacks_a_section_is_recognised(source: str, lacking: list[str]) -> None:
    assert undescribed(source, is_cli=True) == lacking


def test_the_exception_for_commands_holds_in_the_command_line_alone() -> None:
    assert undescribed("def run(a, b, c): ...\napp.command()(run)") == ["1 run"]
