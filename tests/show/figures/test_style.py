import dataclasses
import sys

import pytest

from tests.conftest import simulated_approach
from uwbbench.api import Obstacle, StoreError, Truth, UwbbenchError
from uwbbench.api.text import printable
from uwbbench.detect.pipeline import load_detector
from uwbbench.show.figures import style
from uwbbench.show.figures.radargram import draw_radargram
from uwbbench.show.figures.source import one_of


@pytest.fixture(scope="module")
def few():
    """A capture of 45 frames, quick to draw."""
    return simulated_approach(speed_m_s=3.0)


HOSTILE = ["$x_1$ and $", r"\frac{1}{2}", "_hidden", "a\nb\x07", "<b>&amp;", "日本\udcff", "%s {0}"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "suffix"), [*((name, "svg") for name in HOSTILE), (" ".join(HOSTILE), "png"), (" ".join(HOSTILE), "pdf")]
)
def test_hostile_names_are_drawn_as_they_are(few, name, suffix, tmp_path):
    thing = few.truth.objects[0]
    outline = Obstacle(name, name, thing.outline_m)
    hostile = dataclasses.replace(few, name=name, truth=Truth((outline,)))
    path = tmp_path / f"picture.{suffix}"
    style.save(draw_radargram(hostile, load_detector("null")), path)
    assert path.stat().st_size > 5000
    if suffix == "svg":
        from html import unescape

        assert unescape(path.read_text("utf-8")).count(printable(name).strip("_")) >= 2


def test_a_label_that_starts_with_an_underscore_is_in_the_legend(look):
    with style.styled():
        drawn = style.figure(3, 2)
        axes = drawn.subplots()
        style.legend(axes, axes.plot([0, 1]), ["_plate"])
    assert [label.strip("\u200b") for label in look(drawn).legend()] == ["_plate"]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_the_same_picture_is_the_same_file(few, suffix, tmp_path):
    for name in "ab":
        style.save(draw_radargram(few), tmp_path / f"{name}.{suffix}")
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


def test_a_missing_matplotlib_is_told_with_the_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(UwbbenchError, match=r"pip install 'uwbbench\[plot\]'"), style.styled():
        pass


def test_a_picture_that_cannot_be_written_is_one_message(tmp_path):
    (tmp_path / "folder.png").mkdir()
    with style.styled():
        drawn = style.figure(2, 2)
    with pytest.raises(StoreError, match=r"folder.png: cannot be written"):
        style.save(drawn, tmp_path / "folder.png")


def test_one_detector_on_one_capture_is_its_own_choice(paper):
    assert one_of([paper], "here") is paper
