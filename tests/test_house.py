"""The house itself: few rooms, short modules, and a framework that knows no plugin by name."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from uwbbench.api import registry
from uwbbench.api.locate import shipped

ROOT = Path(__file__).parents[1]
FRAMEWORK = ROOT / "uwbbench"
PLUGINS = (ROOT / "detectors" / "uwbbench_detectors", ROOT / "datasets" / "uwbbench_datasets")

WORDS = {
    "align": "a key of Vega-Lite text marks",
    "array": "a type of JSON Schema",
    "capture": "a column of every table and a key of every JSON output",
    "grid": "a key of tuning files, and of Vega-Lite axes",
    "interpolate": "a key of Vega-Lite line marks",
    "limits": "a section of the report",
    "noise": "a port, and a parameter of detectors that false alarms are counted for",
    "null": "how YAML writes nothing",
    "paper": "a section of the report",
    "range": "a chart of the report and its field, and the range of a Vega-Lite scale",
    "simulated": "one of the two origins of a capture",
    "table": "a column of every table of scores",
}
"""Names of plugins that are words of the framework too, and what they mean there; as names they are refused as well."""

NAMED_BY = {
    "CaptureRef",
    "DatasetUse",
    "StageSubject",
    "detector_file",
    "entry",
    "find_config",
    "load_detector",
    "load_plugin",
    "open_dataset",
    "read_detector",
    "stage",
    "subject_of",
    "uses",
}
"""Functions that are given the name of a plugin."""


def plugin_names() -> frozenset[str]:
    names = set(shipped("detectors"))
    for kind in ("stages", "detectors", "datasets", "terms", "kernels"):
        names |= registry.entries(kind).keys()
    return frozenset(names)


@cache
@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def constants(tree: ast.AST) -> Iterator[ast.Constant]:
    """Texts that a program computes with: no docstrings, and no pieces of longer texts."""
    apart = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    apart |= {id(piece) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for piece in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in apart:
            yield node


def places_of_names(tree: ast.AST) -> Iterator[ast.expr | None]:
    """Expressions that stand where the name of a plugin is expected."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            yield from node.args if called in NAMED_BY else ()
            yield from (keyword.value for keyword in node.keywords if keyword.arg == "use")
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            if any(isinstance(side, ast.Attribute) and side.attr == "use" for side in sides):
                yield from sides
        elif isinstance(node, ast.Dict):
            yield from (value for key, value in zip(node.keys, node.values, strict=True) if _is_use(key))


def _is_use(key: ast.expr | None) -> bool:
    return isinstance(key, ast.Constant) and key.value == "use"


def plugins_named(tree: ast.AST, names: frozenset[str]) -> list[tuple[int, str]]:
    """Line and text of each place of a module that names a plugin."""
    expected = {id(place) for place in places_of_names(tree)}
    found = []
    for text in constants(tree):
        is_word = text.value in WORDS and id(text) not in expected
        in_yaml = re.search(r"\buse: *([\w.-]+)", text.value)
        if (text.value in names and not is_word) or (in_yaml and in_yaml[1] in names):
            found.append((text.lineno, text.value))
    return found


@pytest.mark.parametrize(
    ("source", "named"),
    [
        ('chain = ("peaks", "dbscan")', ["peaks", "dbscan"]),
        ('default = {"profile": "profile.minmax"}', ["profile.minmax"]),
        ('open_dataset("simulated", {}, ())', ["simulated"]),
        ('CaptureRef("capture", {}, (), "one")', ["capture"]),
        ('bias = {"bias_m": 0.0} if step.use == "range" else {}', ["range"]),
        ('null = {"use": "null"}', ["null"]),
        ('text = "pipeline: [{use: reference.nothing}]"', ["pipeline: [{use: reference.nothing}]"]),
        ('label = "SIMULATED" if capture.source == "simulated" else row["capture"]', []),
        ('def found():\n    """dbscan"""\n    return "not a plugin"', []),
    ],
)
def test_a_name_of_a_plugin_is_told_from_a_word_of_the_framework(source, named):
    assert [text for _, text in plugins_named(ast.parse(source), plugin_names())] == named


def test_the_framework_names_no_plugin():
    names = plugin_names()
    assert {"dbscan", "peaks", "simulated", "paper-filtering", "frame_search", "echo.plate"} <= names
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text!r}"
        for path in sorted(FRAMEWORK.rglob("*.py"))
        for line, text in plugins_named(parsed(path), names)
    ]
    assert found == []


def test_every_word_that_is_allowed_is_the_name_of_a_plugin_and_is_used():
    texts = {text.value for path in FRAMEWORK.rglob("*.py") for text in constants(parsed(path))}
    assert WORDS.keys() <= plugin_names() & texts


def test_every_default_is_an_installed_plugin():
    kinds = {"port": "stages", "stage": "stages", "dataset": "datasets"}
    for role in registry.entries("defaults"):
        kind = kinds.get(role.partition(".")[0])
        known = registry.entries(kind) if kind else plugin_names()
        assert registry.default(role) in known, role


def test_every_default_maker_makes_its_port():
    for port, name in registry.makers().items():
        assert port in registry.load_plugin("stages", name).produces


def test_the_framework_has_few_rooms():
    entries = [entry.name for entry in FRAMEWORK.iterdir() if entry.name != "__pycache__"]
    assert len(entries) <= 12, sorted(entries)


def test_no_module_is_longer_than_400_lines():
    modules = [path for folder in (FRAMEWORK, *PLUGINS) for path in folder.rglob("*.py")]
    lines = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in modules}
    assert {name: count for name, count in lines.items() if count > 400} == {}


def test_no_module_is_imported_by_a_name_in_a_text():
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for folder in (FRAMEWORK, *PLUGINS)
        for path in sorted(folder.rglob("*.py"))
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module")
        if any(
            isinstance(part, ast.Constant) and str(part.value).startswith("uwbbench") for part in ast.walk(node.args[0])
        )
        and path
        not in (FRAMEWORK / "__init__.py", FRAMEWORK / "api" / "__init__.py")  # public names, loaded on first use
    ]
    assert found == []
