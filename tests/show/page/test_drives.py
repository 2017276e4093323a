"""Maps and trajectories on the page."""

import json

import pytest

from uwbbench.results import Report
from uwbbench.show.page import Content, page
from uwbbench.show.page.render import pictures
from uwbbench.show.page.sections import sections

pytestmark = pytest.mark.slow

MOST = 2000
"""Points of a detector in a chart."""


@pytest.fixture(scope="module")
def of_drives(mapped_run) -> Content:
    return Content(Report(mapped_run))


def values(spec):
    """Rows of all layers."""
    return [row for layer in spec["layer"] for row in layer["data"]["values"]]


def test_the_run_in_the_middle_is_shown_with_every_mapper(of_drives):
    (look,) = of_drives.drives
    assert look["detectors"] == ["reckoning", "grid", "other (results file)"]
    assert look["text"].startswith("The run of ")
    assert "SIMULATED" in look["map"]["title"]["text"]
    assert any(section.id == "drives" for section in sections(of_drives))


def test_charts_stay_small_whatever_the_map(of_drives):
    for kind in ("map", "errors"):
        rows = values(of_drives.drives[0][kind])
        for name in of_drives.drives[0]["detectors"]:
            own = [row for row in rows if row.get("detector") == name]
            assert 0 < len(own) < MOST, (kind, name)
        assert len(json.dumps(rows)) < 400_000


def test_pictures_of_a_report_have_them_too(of_drives):
    named = {picture.name: picture.spec for picture in pictures(of_drives)}
    assert named["drive-map-1"]["title"]["text"].startswith(f"Map of {of_drives.drives[0]['shown']}, usual")
    assert "{detector}" not in json.dumps(named["drive-errors-1"]["title"])


def test_a_run_without_mappers_has_no_such_section(content, of_drives):
    assert content.drives == []
    assert 'id="drives-title"' in page(of_drives)
