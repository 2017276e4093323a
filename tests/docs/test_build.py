"""The pages as they are built: what the program writes into them, and that they open without a network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from uwbbench.api import registry
from uwbbench.api.locate import shipped

DOCS = Path(__file__).parents[2] / "docs"
ADDRESS = re.compile(
    r"""(?:src|srcset)=["']?(?:https?:)?//|<link[^>]+href=["']?(?:https?:)?//|url\(["']?(?:https?:)?//"""
)


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--quiet", DOCS, folder]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
def test_no_page_loads_anything_from_elsewhere(pages):
    loaded = {path.name: ADDRESS.findall(path.read_text()) for path in pages.rglob("*.html")}
    loaded |= {path.name: ADDRESS.findall(path.read_text()) for path in pages.rglob("*.css")}
    assert {name: found for name, found in loaded.items() if found} == {}


@pytest.mark.slow
def test_every_command_is_on_the_page_of_commands(pages):
    help_text = subprocess.run([sys.executable, "-m", "uwbbench.cli", "--help"], capture_output=True, text=True).stdout
    commands = re.findall(r"^  (\w+)  ", help_text.partition("Commands:")[2], re.M)
    text = (pages / "reference" / "commands.html").read_text()
    assert {"run", "report", "gate"} <= set(commands)
    assert [name for name in commands if f'id="{name}"' not in text or f"uwbbench {name}" not in text] == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["stages", "datasets", "terms"])
def test_every_plugin_is_on_the_page_of_its_kind(pages, kind):
    text = (pages / "reference" / f"{kind}.html").read_text()
    ours = [name for name in registry.entries(kind) if registry.entry(kind, name).package.startswith("uwbbench ")]
    assert ours
    assert [name for name in ours if f"<h2>{name}" not in text] == []


@pytest.mark.slow
def test_every_shipped_detector_is_on_the_page_of_detectors(pages):
    text = (pages / "reference" / "detectors.html").read_text()
    assert [name for name in shipped("detectors") if f"<h2>{name}" not in text] == []
