"""The site of a leaderboard, in a real browser: offline, quiet, linked, sortable, and safe from the names in it."""

from pathlib import Path

import pytest

from uwbbench.results.leaderboard import read_runs, suites
from uwbbench.show.site import Content, rendered, write_site

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def site(report_file: Path) -> Path:
    """Site of a run whose names try to break out of it."""
    runs = read_runs([report_file.parent / "run"])
    folder = report_file.parent / "site"
    write_site(folder, rendered(Content(suites(runs), runs)))
    return folder


@pytest.fixture
def index(chromium, site: Path):
    """The first page, open."""
    chromium.width(1280)
    chromium.open(site / "index.html")
    return chromium


def pages(site: Path) -> list[Path]:
    return sorted(site.rglob("*.html"))


def test_every_page_opens_offline_without_a_word_on_the_console(chromium, site: Path) -> None:
    chromium.width(1280)
    assert len(pages(site)) == 2 + 2 + 4
    for page in pages(site):
        chromium.open(page)
        assert chromium.errors() == []
        addresses = chromium.run("return performance.getEntriesByType('resource').map(e => e.name)")
        assert all(address.startswith("data:") for address in addresses)


def test_every_link_leads_to_a_file_of_the_site(chromium, site: Path) -> None:
    for page in pages(site):
        chromium.open(page)
        for link in chromium.run("return [...document.querySelectorAll('a')].map(a => a.href)"):
            address, _, anchor = link.partition("#")
            assert Path(address.removeprefix("file://")).is_file()
            if anchor:
                assert chromium.run("return !!document.getElementById(arguments[0])", anchor)


def test_a_reader_gets_from_the_index_to_a_detector_and_back(index) -> None:
    index.run("document.querySelector('table a').click()")
    index.open(Path(index.driver.current_url.removeprefix("file://")))
    assert "/detectors/" in index.driver.current_url
    assert index.run("return document.querySelector('h2').textContent") == "Results"
    index.run("document.querySelector('nav a').click()")
    assert index.driver.current_url.endswith("/index.html")


def test_charts_are_drawn_named_and_said_to_be_simulated(index) -> None:
    names = index.run("return [...document.querySelectorAll('.drawn')].map(d => d.getAttribute('aria-label'))")
    assert len(names) == 2
    assert all("SIMULATED" in name for name in names)
    heights = index.run(
        "return [...document.querySelectorAll('.drawn svg')].map(s => s.getBoundingClientRect().height)"
    )
    assert all(height > 200 for height in heights)


def test_ink_follows_the_theme(index) -> None:
    ink = "return getComputedStyle(document.querySelector('.drawn text')).fill"
    colours = set()
    for _ in range(3):
        index.run("document.getElementById('theme').click()")
        colours.add(index.run(ink))
    assert len(colours) == 2


def test_a_click_on_a_head_sorts_and_another_turns_it_around(index) -> None:
    click = "[...document.querySelectorAll('table')[1].tHead.querySelectorAll('button')][arguments[0]].click()"
    column = (
        "return [...document.querySelectorAll('table')[1].tBodies[0].rows].map(r => r.cells[arguments[0]].dataset.key)"
    )
    heads = index.run("return [...document.querySelectorAll('table')[1].tHead.rows[0].cells].map(c => c.textContent)")
    place = heads.index("MAE (cm)")
    index.run(click, place)
    up = index.run(column, place)
    index.run(click, place)
    down = index.run(column, place)
    known = [float(key) for key in up if key != "n/a"]
    assert len(known) >= 2
    assert known == sorted(known)
    assert [float(key) for key in down if key != "n/a"] == known[::-1]
    assert up[-1] == down[-1] == "n/a"


def test_filters_narrow_the_table_of_all_detectors_and_datasets(index) -> None:
    rows = "[...document.querySelectorAll('#part-1 tbody tr')].filter(r => !r.hidden)"
    shown = f"return {rows}.map(r => r.cells[0].textContent)"
    heads = "return [...document.querySelectorAll('#part-1 thead th')].filter(h => !h.hidden).length"
    everything, columns = index.run(shown), index.run(heads)
    write = "const i = document.querySelector(arguments[0]); i.value = arguments[1]; "
    write += "i.dispatchEvent(new Event('input', { bubbles: true }))"
    index.run(write, ".filters .rows", "CFAR")
    assert index.run(shown) == ["cfar-os"]
    index.run(write, ".filters .columns", "second")
    assert index.run(heads) == 2 < columns
    index.run(write, ".filters .rows", "")
    index.run(write, ".filters .columns", "")
    assert (index.run(shown), index.run(heads)) == (everything, columns)
    assert index.run("return document.querySelector('a.download').href").endswith("/matrix.csv")


def test_names_stay_text(chromium, site: Path) -> None:
    for page in pages(site):
        chromium.open(page)
        assert chromium.run("return document.querySelectorAll('img, iframe, object, embed').length") == 0
        assert chromium.run("return [...document.querySelectorAll('*')].every(e => !e.hasAttribute('onerror'))")
        assert chromium.run("return document.querySelectorAll('script').length") == 1


def test_no_page_is_wider_than_a_phone(chromium, site: Path) -> None:
    chromium.width(390)
    for page in pages(site):
        chromium.open(page)
        assert chromium.run("return document.documentElement.scrollWidth") <= 390, page.name


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_nothing_serious_is_inaccessible(chromium, site: Path, theme: str, axe: str) -> None:
    chromium.width(1280)
    chromium.driver.execute_cdp_cmd("Page.setBypassCSP", {"enabled": True})
    for page in pages(site):
        chromium.open(page)
        chromium.run("document.documentElement.dataset.theme = arguments[0]", theme)
        chromium.run(axe)
        found = chromium.driver.execute_async_script(
            "const done = arguments[arguments.length - 1];"
            "const told = v => v.id + ': ' + v.nodes[0].target + ' ' + v.nodes[0].html.slice(0, 200);"
            "axe.run(document).then(r => done(r.violations.map(told)))"
        )
        assert found == [], page.name
