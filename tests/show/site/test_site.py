"""The files of a site, and the folder that they are written into."""

import csv
import io
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from tests.fixtures.contributions import Make, content_of, elsewhere, failing
from uwbbench.api import StoreError
from uwbbench.api.locate import config_folder
from uwbbench.api.yaml_file import read_yaml
from uwbbench.results import Report
from uwbbench.run.folder import RunFolder
from uwbbench.show.page import Content as ReportContent
from uwbbench.show.site import check_site, rendered, write_site
from uwbbench.show.site.folder import MARKER
from uwbbench.show.site.names import slug
from uwbbench.show.site.pages import pages

HOSTILE = "</script><img src=x onerror=alert(1)>\"'&`${1}\n../../etc\\x" + "x" * 10_000
SAFE = re.compile(r"[a-z0-9-]+/[a-z0-9-]{1,60}\.html|(index|runs)\.html|leaderboard\.json|matrix\.csv|\.nojekyll")


@pytest.fixture(scope="session")
def site(alice: Path, bob: Path, carol: Path, dave: Path) -> dict[str, str]:
    return dict(rendered(content_of(alice, bob, carol, dave)))


def test_there_is_a_page_for_every_detector_and_dataset(site: dict[str, str]) -> None:
    assert all(SAFE.fullmatch(name) for name in site)
    assert sum(name.startswith("datasets/") for name in site) == 2, "one dataset in two versions"
    assert sum(name.startswith("detectors/") for name in site) == 5, "two versions of one of four"
    assert {"index.html", "runs.html", "leaderboard.json", ".nojekyll"} <= set(site)


def test_every_link_leads_to_a_page(site: dict[str, str]) -> None:
    for name, text in site.items():
        for link in re.findall(r'href="([^"#]+)"', text):
            if link != "data:,":
                parts = (*name.split("/")[:-1], *link.split("/"))
                while ".." in parts:
                    at = parts.index("..")
                    parts = (*parts[: at - 1], *parts[at + 1 :])
                assert "/".join(parts) in site, f"{name}: {link}"


def test_nothing_is_requested_from_elsewhere(site: dict[str, str]) -> None:
    for name, text in site.items():
        if name.endswith(".html"):
            assert not re.search(r'(src|href|action)="(https?:)?//', text)
            assert "url(" not in text.replace("url(#clip-", "")
            assert "default-src &#39;none&#39;" in text


def test_the_index_says_who_leads_and_who_is_as_good(alice: Path) -> None:
    index = next(page for page in pages(content_of(alice)) if page.address == "index.html")
    (sentence,) = index.parts[1].sentences
    assert re.fullmatch(
        r"(twin|paper-filtering) comes first with F1 [\d.]+ \[[\d.]+, [\d.]+\] \(frame scoring\), but is not surely "
        r"ahead of (twin|paper-filtering); not told apart from it: (twin|paper-filtering)\.",
        sentence,
    )
    assert index.badge == "SIMULATED"
    assert "SIMULATED" in index.parts[1].title


def test_the_first_part_of_the_index_is_one_table_of_detectors_by_datasets(alice: Path, bob: Path) -> None:
    content = content_of(alice, bob)
    index = next(page for page in pages(content) if page.address == "index.html")
    (table,) = index.parts[0].tables
    assert len(table.columns) == 1 + len(content.sections)
    assert [row[0].text for row in table.rows] == list(content.labels.values())
    (section,) = content.sections
    f1 = {one.contender.key: one.estimates["f1"].value for one in section.main.standings}
    assert [float(row[1].text) for row in table.rows] == [round(f1[key], 3) for key in content.labels]


def test_the_table_as_a_file_has_every_number_and_no_formula(make: Make) -> None:
    run = make("formula", '[{use: paper-filtering, name: "=1+1"}, "null"]')
    content = content_of(run)
    rows = list(csv.reader(io.StringIO(rendered(content)["matrix.csv"])))
    (section,) = content.sections
    assert [row[0] for row in rows] == ["detector", "'=1+1", "null (bound)"]
    assert all(len(row) == 2 + 4 * len(content.sections) for row in rows)
    values = {one.contender.name: one.estimates["f1"].value for one in section.main.standings}
    assert [float(row[2]) for row in rows[1:]] == pytest.approx([values["=1+1"], values["null"]], rel=1e-8)


def test_a_detector_looks_the_same_in_every_table_and_as_in_the_report_of_its_run(alice: Path) -> None:
    content = content_of(alice)
    of_run = ReportContent(Report(RunFolder(alice))).marks
    seen = {
        (cell.text, cell.look)
        for page in pages(content)
        for part in page.parts
        for table in part.tables
        for row in table.rows
        for cell in row
        if cell.look is not None
    }
    assert seen == set(of_run.items())
    assert len({look for _, look in seen}) == len(seen)


def test_a_chart_is_well_formed_and_has_no_colours_of_paper(alice: Path) -> None:
    index = next(page for page in pages(content_of(alice)) if page.address == "index.html")
    ((picture, words),) = index.parts[1].charts
    ET.fromstring(picture)  # noqa: S314 - our own
    assert "var(--ink)" in picture
    assert "aria-" not in picture
    assert "SIMULATED" in words


@pytest.mark.slow
def test_a_dataset_shows_causes_of_errors_and_every_threshold_and_says_simulated(alice: Path) -> None:
    content = content_of(alice)
    (section,) = content.sections
    said = [text for _, text in content.causes_and_curves(section)]
    assert [text.split(".")[0].split(": ")[-1] for text in said] == [
        "causes of errors",
        "precision against recall",
        "recall against false alarms",
    ]
    assert all("SIMULATED" in text for text in said)
    page = next(page for page in pages(content) if page.address == section.address)
    assert "Causes of errors, and every threshold" in [part.title for part in page.parts]


@pytest.mark.slow
def test_no_absolute_time_of_several_machines_is_in_a_ranking(alice: Path, tmp_path: Path) -> None:
    content = content_of(alice, elsewhere(alice, tmp_path / "far", 2.0))
    for page in pages(content):
        for part in page.parts:
            for table in (*part.tables, *part.folded):
                if any("(us)" in column for column in table.columns):
                    assert table.columns[0] == "machine"
    (section,) = content.sections
    pareto = content.pareto(section, "f1")
    assert pareto is not None
    assert "frame period" not in pareto[0], "it is another ratio on each machine"


@pytest.mark.slow
def test_failures_are_told_with_reason_and_escaped(alice: Path, tmp_path: Path) -> None:
    capture = RunFolder(alice).entries()[0].capture
    files = rendered(content_of(failing(alice, tmp_path / "broken", "twin", capture)))
    (text,) = [text for name, text in files.items() if name.startswith("detectors/twin")]
    assert "ValueError: &lt;b&gt;no&lt;/b&gt;" in text
    assert "5 of 6" in text


@pytest.mark.slow
def test_hostile_names_stay_names(make: Make, tmp_path: Path) -> None:
    name = json.dumps(HOSTILE)
    run = make(
        "hostile", f"[{{use: paper-filtering, name: {name}}}, {{use: cfar-os, name: {json.dumps(HOSTILE + '2')}}}]"
    )
    files = rendered(content_of(run))
    assert all(SAFE.fullmatch(name) for name in files)
    assert sum(name.startswith("detectors/") for name in files) == 2
    for address, text in files.items():
        assert address in ("leaderboard.json", "matrix.csv") or "<img" not in text
    write_site(tmp_path / "site", files)
    data = json.loads((tmp_path / "site" / "leaderboard.json").read_text())
    assert {one["detector"] for one in data["suites"][0]["boards"][0]["standings"]} == {HOSTILE, HOSTILE + "2"}


def test_the_data_for_programs_is_strict_json_with_every_pair(site: dict[str, str]) -> None:
    data = json.loads(site["leaderboard.json"], parse_constant=pytest.fail)
    for suite in data["suites"]:
        for board in suite["boards"]:
            count = sum(not one["bound"] for one in board["standings"])
            assert len(board["pairs"]) == 3 * count * (count - 1) // 2
            assert all(0 < pair["p_adjusted"] <= 1 for pair in board["pairs"] if pair["p_adjusted"] is not None)


@pytest.mark.slow
def test_the_same_runs_give_the_same_site(alice: Path, bob: Path) -> None:
    assert rendered(content_of(alice, bob)) == rendered(content_of(bob, alice))


def test_the_shipped_workflow_builds_a_site_from_all_runs_and_publishes_it() -> None:
    jobs = read_yaml(config_folder() / "leaderboards" / "github-workflow.yml").data["jobs"]
    steps = jobs["site"]["steps"]
    assert any(step.get("run") == "uwbbench leaderboard runs/* -o site" for step in steps)
    assert any("upload-pages-artifact" in step.get("uses", "") and step["with"]["path"] == "site" for step in steps)
    assert jobs["publish"]["needs"] == "site"


@pytest.mark.parametrize("name", ["", "..", "a/b", "ÄÖ", "x" * 10_000, "con", "a\nb"])
def test_a_slug_is_a_safe_file_name(name: str) -> None:
    assert re.fullmatch(r"[a-z0-9][a-z0-9-]{0,60}", slug(name, "0123456789abcdef"))


# The folder ----------------------------------------------------------------------------------------------------


def test_a_site_is_replaced_by_a_newer_one_and_what_is_not_ours_stays(tmp_path: Path) -> None:
    write_site(tmp_path, {"index.html": "old", "detectors/gone.html": "old", ".nojekyll": ""})
    (tmp_path / "CNAME").write_text("example.org")
    write_site(tmp_path, {"index.html": "new", ".nojekyll": ""})
    assert (tmp_path / "index.html").read_text() == "new"
    assert not (tmp_path / "detectors" / "gone.html").exists()
    assert (tmp_path / "CNAME").read_text() == "example.org"
    assert check_site(tmp_path) == {"index.html", ".nojekyll"}


def test_a_folder_of_anything_else_is_left_alone(tmp_path: Path, alice: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    for folder in (tmp_path, alice):
        before = sorted(folder.rglob("*"))
        with pytest.raises(StoreError, match="is no site that 'uwbbench leaderboard' made"):
            write_site(folder, {"index.html": "new"})
        assert sorted(folder.rglob("*")) == before


def test_a_page_of_somebody_else_in_the_way_stops_everything(tmp_path: Path) -> None:
    write_site(tmp_path, {"index.html": "old"})
    (tmp_path / "runs.html").write_text("mine")
    with pytest.raises(StoreError, match=r"runs\.html: was not made by"):
        write_site(tmp_path, {"index.html": "new", "runs.html": "new"})
    assert (tmp_path / "index.html").read_text() == "old"
    assert (tmp_path / "runs.html").read_text() == "mine"


@pytest.mark.parametrize("listed", [["../secret"], ["/etc/passwd"], ["a/../../secret"], [5], "index.html", None])
def test_a_marker_edited_by_hand_leads_nowhere(tmp_path: Path, listed: object) -> None:
    folder = tmp_path / "site"
    write_site(folder, {"index.html": "old"})
    (tmp_path / "secret").write_text("mine")
    (folder / MARKER).write_text(json.dumps({"generator": "uwbbench leaderboard", "files": listed}))
    with pytest.raises(StoreError, match="is no list of the files of a site"):
        write_site(folder, {"index.html": "new"})
    assert (tmp_path / "secret").read_text() == "mine"


def test_nothing_is_written_or_removed_through_a_link(tmp_path: Path) -> None:
    folder, other = tmp_path / "site", tmp_path / "other"
    write_site(folder, {"index.html": "old", "detectors/a.html": "old"})
    other.mkdir()
    (other / "a.html").write_text("mine")
    (folder / "detectors" / "a.html").unlink()
    (folder / "detectors").rmdir()
    (folder / "detectors").symlink_to(other)
    with pytest.raises(StoreError, match="was not made by"):
        write_site(folder, {"index.html": "new", "detectors/a.html": "new"})
    write_site(folder, {"index.html": "new"})
    assert (other / "a.html").read_text() == "mine"
