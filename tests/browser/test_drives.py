"""Maps and trajectories on a report's page, in a real browser."""

import time

import pytest

from tests.browser.conftest import Browser
from uwbbench.results import Report
from uwbbench.show.page import Content, page

pytestmark = pytest.mark.browser

PATH = "[data-drawn=map] svg .layer_6_marks path"
"""The estimated path: of the layers, the one behind segments."""


@pytest.fixture
def drives(chromium: Browser, mapped_run, tmp_path) -> Browser:
    """The page of a run of mappers, open and drawn."""
    target = tmp_path / "drives.html"
    target.write_text(page(Content(Report(mapped_run))), encoding="utf-8")
    chromium.width(1280)
    chromium.open(target)
    return chromium


def path_of(browser: Browser) -> str:
    return browser.run(f"return document.querySelector('{PATH}')?.getAttribute('d') ?? ''")


def slide(browser: Browser, share: float) -> None:
    browser.run(
        "const t = document.querySelector('[data-drive] input[type=range]');"
        "t.value = arguments[0] * Number(t.max); t.dispatchEvent(new Event('input'))",
        share,
    )
    time.sleep(0.6)


def test_it_opens_offline_without_a_word_on_the_console(drives: Browser) -> None:
    assert drives.errors() == []
    assert drives.run("return document.querySelectorAll('[data-drawn] svg[aria-label]').length") == 2


def test_the_path_is_that_up_to_the_chosen_time(drives: Browser) -> None:
    whole = path_of(drives)
    slide(drives, 0.5)
    half = path_of(drives)
    assert whole.count("L") > 1.5 * half.count("L") > 10
    slide(drives, 1.0)
    assert path_of(drives) == whole
    assert drives.errors() == []


def test_another_detector_is_drawn_at_the_same_time(drives: Browser) -> None:
    slide(drives, 0.5)
    drives.run(
        "const s = document.querySelector('[data-drive] select');"
        "s.value = s.options[1].value; s.dispatchEvent(new Event('change'))"
    )
    time.sleep(1.0)
    label = drives.run("return document.querySelector('[data-drawn=map] svg').getAttribute('aria-label')")
    chosen = drives.run("return document.querySelector('[data-drive] select').value")
    assert label.startswith(f"Map of {chosen}, usual")
    assert path_of(drives).count("L") > 10
    drives.width(390)
    assert drives.run("return document.documentElement.scrollWidth") <= 390
    assert drives.errors() == []
