"""The map of the house is that of the code, and no arrow of it comes back."""

import ast
import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def architecture():
    spec = importlib.util.spec_from_file_location("architecture", ROOT / "docs" / "pictures" / "architecture.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_stored_picture_is_what_the_code_gives(architecture):
    stored = architecture.PICTURE.read_text(encoding="utf-8")
    assert stored == architecture.draw(), "out of date: run python docs/pictures/architecture.py"


def test_no_arrow_comes_back(architecture):
    order = [*architecture.rooms(), *architecture.PLUGINS]
    used, _ = architecture.imports()
    assert [pair for pair in used if order.index(pair[0]) <= order.index(pair[1])] == []


def test_plugins_use_the_api_alone(architecture):
    used, excused = architecture.imports()
    assert {other for place, other in used | excused if place in architecture.PLUGINS} == {"api"}


def test_only_the_notebook_is_excused(architecture):
    _, excused = architecture.imports()
    assert {other for _, other in excused} <= {"show"}


def test_every_room_is_drawn_and_described_on_its_page(architecture):
    text = (ROOT / "docs" / "explanation" / "architecture.md").read_text()
    folders = {path.parent.name for path in (ROOT / "uwbbench").glob("*/__init__.py")}
    assert folders == set(architecture.rooms()) == set(architecture.ROOMS)
    assert [room for room in folders if f"`{room}/`" not in text] == []


def test_rooms_below_the_tools_ask_the_package_for_its_version_alone(architecture):
    """What the linter is told to ignore: else a room could reach what is built on it by way of the public names."""
    wrong = []
    for room in architecture.rooms()[:-2]:
        for path in (ROOT / "uwbbench" / room).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import) and any(alias.name == "uwbbench" for alias in node.names):
                    wrong.append(path.name)
                if isinstance(node, ast.ImportFrom) and node.module == "uwbbench":
                    wrong += [f"{path.name}: {alias.name}" for alias in node.names if alias.name != "__version__"]
    assert wrong == []


def test_an_import_inside_a_function_is_seen(architecture, tmp_path):
    (tmp_path / "late.py").write_text("def f():\n    from uwbbench.show import page\n")
    assert "uwbbench.show.page" in architecture._imported(tmp_path / "late.py")
