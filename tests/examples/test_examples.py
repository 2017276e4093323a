"""Every example runs as its reader would run it, and leaves a picture that shows something."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))
LEAST_PIXELS, LEAST_COLOURS, LEAST_INK = 300, 20, 0.01
LONGEST = 60


def names(paths):
    return [path.stem for path in paths]


def is_drawn(picture: Image.Image) -> bool:
    """Whether a picture has a size, several colours, and more on it than its background."""
    colours = picture.convert("RGB").getcolors(picture.width * picture.height)
    ink = 1 - max(count for count, _ in colours) / (picture.width * picture.height)
    return min(picture.size) >= LEAST_PIXELS and len(colours) >= LEAST_COLOURS and ink >= LEAST_INK


def test_there_is_an_example_of_each_kind_of_work():
    wanted = {"compare_detectors", "own_stage", "own_dataset", "gate_a_change", "stable_zone", "simulate_a_room"}
    assert wanted <= set(names(EXAMPLES))


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=names(EXAMPLES))
def test_an_example_leaves_its_picture(path, tmp_path):
    done = subprocess.run([sys.executable, path, tmp_path], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with Image.open(tmp_path / f"{path.stem}.png") as picture:
        assert is_drawn(picture)


@pytest.mark.parametrize("path", EXAMPLES, ids=names(EXAMPLES))
def test_an_example_imports_only_what_is_public(path):
    imported = re.findall(r"^(?:from|import) (uwbbench[\w.]*)", path.read_text(), re.M)
    assert imported
    assert set(imported) <= {"uwbbench", "uwbbench.api"}


@pytest.mark.parametrize("path", EXAMPLES, ids=names(EXAMPLES))
def test_an_example_is_short(path):
    code = [line for line in path.read_text().splitlines() if line.strip()]
    assert len(code) < LONGEST


def test_an_empty_picture_would_be_noticed():
    assert not is_drawn(Image.new("RGB", (800, 600), "white"))
