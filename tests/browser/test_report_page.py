"""The page of a report, in a real browser: offline, quiet, usable, and safe from the names in it."""

import pytest

pytestmark = pytest.mark.browser


def test_it_opens_offline_without_a_word_on_the_console_and_asks_nothing_of_the_network(opened) -> None:
    assert opened.errors() == []
    addresses = opened.run("return performance.getEntriesByType('resource').map(e => e.name)")
    assert all(address.startswith("data:") for address in addresses)


def test_every_chart_is_drawn_and_named(opened) -> None:
    drawn = opened.run("return document.querySelectorAll('.chart svg[aria-label]').length")
    assert drawn == opened.run("return document.querySelectorAll('.chart').length")
    assert drawn == 3 + 2 + 2 + 4 + 8, "of the board, times, causes, curves, and captures"


def test_a_table_wider_than_the_page_shows_that_it_goes_on_until_its_end(opened) -> None:
    opened.width(390)
    shaded = "return document.querySelector('#leaderboard .wide').classList.contains('more')"
    assert opened.run(shaded)
    opened.run("const s = document.querySelector('#leaderboard .scroll'); s.scrollLeft = s.scrollWidth")
    opened.run("return new Promise(go => setTimeout(go, 300))")
    assert not opened.run(shaded)
    first = "return document.querySelector('#board tbody th').getBoundingClientRect().left"
    assert 0 <= opened.run(first) < 40, "the first column stays"


def test_the_map_names_the_detector_that_it_shows(opened) -> None:
    label = "return document.querySelector('.look [data-chart=map] svg').getAttribute('aria-label')"
    chosen = "return [...document.querySelectorAll('.look label.single select')].at(1).value"
    assert opened.run(label).startswith(f"Places found by {opened.run(chosen)},")


def test_simulated_captures_are_said_to_be_in_every_chart(opened) -> None:
    titles = opened.run("return [...document.querySelectorAll('.chart svg')].map(s => s.getAttribute('aria-label'))")
    assert titles
    assert all("SIMULATED" in title for title in titles)


def test_names_stay_text(opened) -> None:
    assert opened.run("return document.querySelectorAll('img, iframe, object, embed').length") == 0
    assert opened.run("return [...document.querySelectorAll('*')].every(e => !e.hasAttribute('onerror'))")
    assert opened.run("return document.querySelectorAll('script').length") == 4
    assert any("</script><img" in text for text in opened.column("detector"))


def test_the_page_is_no_wider_than_a_phone_whatever_the_names(opened) -> None:
    opened.width(390)
    assert opened.run("return document.documentElement.scrollWidth") <= 390


def test_a_click_on_a_head_sorts_and_another_turns_it_around(opened) -> None:
    click = "[...document.querySelectorAll('#board thead button')].find(b => b.textContent === arguments[0]).click()"
    opened.run(click, "MAE (cm)")
    up = opened.column("MAE (cm)")
    opened.run(click, "MAE (cm)")
    down = opened.column("MAE (cm)")
    known = [float(text) for text in up if text != "n/a"]
    assert len(known) >= 2
    assert known == sorted(known)
    assert [float(text) for text in down if text != "n/a"] == known[::-1]
    assert up[-1] == down[-1] == "n/a"  # undefined numbers stay last
    state = "return [...document.querySelectorAll('#board th[aria-sort]')].map(h => [h.textContent, h.ariaSort])"
    assert opened.run(state) == [["MAE (cm)", "descending"]]


def test_tables_of_texts_sort_too(opened) -> None:
    names = "return [...document.querySelector('#compared tbody').rows].map(r => r.cells[0].textContent)"
    button = "document.querySelector('#compared thead button').click()"
    opened.run(button)
    assert opened.run(names) == sorted(opened.run(names))
    opened.run(button)
    assert opened.run(names) == sorted(opened.run(names), reverse=True)


def test_filters_narrow_the_leaderboard(opened) -> None:
    everything = opened.column("detector")
    opened.run("const s = document.getElementById('search'); s.value = 'CFAR'; s.dispatchEvent(new Event('input'))")
    assert opened.column("detector") == ["cfar-os"]
    opened.run("const s = document.getElementById('search'); s.value = 'zz'; s.dispatchEvent(new Event('input'))")
    assert opened.column("detector") == []
    assert opened.run("return document.getElementById('board-note').textContent") == "No row fits these filters."
    opened.run("const s = document.getElementById('search'); s.value = ''; s.dispatchEvent(new Event('input'))")
    assert opened.column("detector") == everything


def test_a_range_bin_changes_the_numbers_and_the_frames(opened) -> None:
    whole = [int(count) for count in opened.column("frames (n)")]
    spans = opened.run("return [...document.getElementById('span').options].map(o => o.value)")
    assert spans[0] == ""
    inside = []
    for span in spans[1:]:
        opened.choose("span", span)
        inside.append(int(opened.column("frames (n)")[0]))
    assert sum(inside) == whole[0]


def test_another_dataset_scoring_table_and_metric_change_board_and_charts(opened) -> None:
    label = "return document.querySelector('[data-chart=pareto] svg').getAttribute('aria-label')"
    first = opened.run(label)
    assert "Speed against F1" in first
    opened.choose("metric", "p95")
    assert "Speed against P95" in opened.run(label)
    opened.choose("dataset", "second (simulated)")
    assert "second, SIMULATED" in opened.run(label)
    opened.choose("scoring", "object")
    opened.choose("table", "after mapping (position)")
    assert opened.column("detector") == ["paper"]
    missing = opened.run("return document.getElementById('board-missing').textContent")
    assert "cfar-os: not here, as it does not cluster positions" in missing
    assert opened.errors() == []


def test_another_detector_shows_its_detections(opened) -> None:
    count = "return document.querySelector('.look [data-chart=radargram] .mark-symbol.role-mark').childElementCount"
    values = opened.run("return [...document.querySelector('.look select').options].map(o => [o.value, o.textContent])")
    empty = next(value for value, _ in values if value.startswith("null"))
    script = (
        "const s = document.querySelector('.look select'); s.value = arguments[0]; s.dispatchEvent(new Event('change'))"
    )
    before = opened.run(count)
    opened.run(script, empty)
    opened.run("return new Promise(go => setTimeout(go, 300))")
    assert before > 0
    assert opened.run(count) == 0


def test_the_theme_switch_changes_the_paper_and_prints_stay_light(opened) -> None:
    paper = "return getComputedStyle(document.body).backgroundColor"
    seen = set()
    for _ in range(3):
        opened.run("document.getElementById('theme').click()")
        seen.add((opened.run("return document.getElementById('theme').textContent"), opened.run(paper)))
    assert ("Theme: light", "rgb(255, 255, 255)") in seen
    assert ("Theme: dark", "rgb(20, 24, 29)") in seen
    assert opened.pdf().startswith(b"%PDF")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_nothing_serious_is_inaccessible(opened, theme: str, axe: str) -> None:
    opened.run("document.documentElement.dataset.theme = arguments[0]", theme)
    opened.driver.execute_cdp_cmd("Page.setBypassCSP", {"enabled": True})
    opened.run(axe)
    found = opened.driver.execute_async_script(
        "const done = arguments[arguments.length - 1];"
        "const told = v => [v.id, v.impact, v.nodes.slice(0, 3).map(n => n.html)];"
        "axe.run(document).then(r => done(r.violations.map(told)))"
    )
    assert [one for one in found if one[1] in ("serious", "critical")] == []
