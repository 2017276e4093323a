"""The page: one file, safe and small, of what is stored alone."""

import base64
import dataclasses
import hashlib
import json
import re
import zlib
from pathlib import Path

import altair
import pytest

from uwbbench.results import Report
from uwbbench.run.folder import RunFolder
from uwbbench.show.html.render import embedded
from uwbbench.show.page import Content, answer, page, render, write_figures
from uwbbench.show.page.board_charts import pareto
from uwbbench.show.page.sections import sections


@pytest.fixture(scope="module")
def html(content: Content) -> str:
    return page(content)


def test_nothing_is_asked_of_the_network(html: str) -> None:
    outside = re.sub(r"<script.*?</script>", "", html, flags=re.DOTALL)
    assert not re.search(r'\b(src|href)="(?!#|data:,)', outside)
    assert "@import" not in outside
    assert "default-src &#39;none&#39;" in html


def test_the_policy_names_each_script_and_the_style_by_its_hash(html: str) -> None:
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html)
    assert policy is not None
    allowed = policy[1].replace("&#39;", "'")
    parts = re.findall(r"<script>(.*?)</script>", html, re.DOTALL) + re.findall(
        r"<style>(.*?)</style>", html, re.DOTALL
    )
    assert len(parts) == 3
    for part in parts:
        digest = base64.b64encode(hashlib.sha256(part.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in allowed
    assert "unsafe" not in allowed


def test_embedded_data_cannot_end_its_element() -> None:
    hostile = {"name": "</script><!--<script>\u2028&"}
    text = embedded(hostile)
    assert "<" not in text
    assert json.loads(text) == hostile


def test_the_data_are_whole_and_plain(html: str, content: Content) -> None:
    found = re.search(r'id="data">(.*?)</script>', html, re.DOTALL)
    assert found is not None
    data = json.loads(zlib.decompress(base64.b64decode(found[1])), parse_constant=pytest.fail)
    assert data["detectors"] == ["paper", "cfar-os", "null (bound)"]
    assert data["bounds"] == [False, False, True]
    board = content.report.leaderboard
    wholes = [row for row in data["rows"] if row[1:4] == ["", "", ""]]
    assert len(wholes) == len(board)
    f1 = [one["name"] for one in data["quantities"]].index("f1")
    shown = sorted(row[7][f1][0] for row in wholes)
    assert shown == pytest.approx(sorted(board["f1"]), rel=1e-4)


def test_range_bins_hold_each_frame_once(content: Content) -> None:
    for board in content.boards:
        for detector in content.detectors:
            of = [one for one in content.slices if (one.board, one.detector, one.channel) == (board, detector, "")]
            inside = sum(one.frames for one in of if one.span)
            assert inside == sum(one.frames for one in of if not one.span)


@pytest.mark.slow
def test_every_chart_follows_the_schema_of_vega_lite_and_says_that_it_is_simulated(content: Content) -> None:
    pictures = list(render.pictures(content))
    assert {picture.name.split("-")[0] for picture in pictures} == {
        "pareto",
        "range",
        "errors",
        "causes",
        "curves",
        "latency",
        "radargram",
        "map",
    }
    assert all("SIMULATED" in picture.spec["title"]["text"] for picture in pictures)
    # One of each kind and quantity: the others differ in their data alone.
    for spec in {re.sub(r"-\d(-[a-z]+-[a-z]+)?", "", picture.name): picture.spec for picture in pictures}.values():
        altair.Chart.from_dict(spec, validate=True)


def test_the_summary_names_captures_leader_error_and_cost(content: Content) -> None:
    (sentence,) = answer.sentences(content)
    assert sentence.startswith("On 9 simulated captures of plates (")
    assert re.search("cfar-os (leads|comes first) with F1 ", sentence)
    assert re.search(r", at [\d.]+x the time a frame of paper-filtering\.$", sentence)


def test_the_answer_stands_first_and_no_section_is_empty(content: Content) -> None:
    parts = sections(content)
    assert [part.id for part in parts][:3] == ["summary", "leaderboard", "pareto"]
    assert len({part.id for part in parts}) == len(parts)
    for part in parts:
        assert part.layout != "plain" or any((part.sentences, part.charts, part.of_board, part.sheets, part.notes))


def test_the_front_is_given_with_a_probability(content: Content) -> None:
    board = next(iter(content.boards))
    spec = pareto(content, board, "mae")
    assert spec is not None
    rows = {row["detector"]: row for row in spec["data"]["values"]}
    assert set(rows) == {"paper", "cfar-os"}  # null finds nothing
    assert all(re.fullmatch(r"[01]\.\d\d|[<>]0\.\d\d", row["chance"]) for row in rows.values())
    assert all(row["low"] < row["value"] < row["high"] for row in rows.values())


def test_a_capture_of_other_content_is_not_shown(small_run: RunFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RunFolder, "content", lambda *_: "0" * 64)
    looks = Content(Report(small_run), [Path()]).looks
    assert all("other content" in look["missing"] for look in looks)


def test_without_captures_at_hand_their_truth_and_detections_are_shown(small_run: RunFolder) -> None:
    looks = Content(Report(small_run)).looks
    assert [look["missing"] for look in looks] == ["Captures were not looked for."] * 2
    for look in looks:
        assert not any("url" in layer.get("mark", ()) for layer in look["radargram"]["layer"])
        assert any(layer["data"]["values"] for layer in look["radargram"]["layer"])


def test_best_and_worst_captures_are_those_of_the_leader(content: Content) -> None:
    scores = content.report.folder.scores()
    of = scores[(scores["detector"] == "cfar-os") & (scores["scoring"] == "frame") & (scores["table"] == "filtering")]
    best, worst = content.cases
    assert best.score == of["f1"].max()
    assert worst.score == of["f1"].min()
    assert {best.leader, worst.leader} == {"cfar-os"}


def test_a_run_in_which_nothing_could_be_scored_has_a_page(small_run: RunFolder) -> None:
    report = Report(small_run)
    report.scored = []
    report.entries = [dataclasses.replace(e, status="failed", reason="gone", facts={}) for e in report.entries]
    text = page(Content(report))
    assert "Nothing could be scored" in text
    assert 'id="latency"' not in text, "a section with nothing in it is left out"
    assert text.count("gone") >= len(report.entries)


def test_figures_are_written_as_pictures_and_as_specifications(
    content: Content, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = list(render.pictures(content))[:1]
    monkeypatch.setattr(render, "pictures", lambda _: iter(few))
    (written,) = write_figures(content, tmp_path / "figures")
    assert written.read_bytes().startswith(b"\x89PNG")
    assert "<svg" in written.with_suffix(".svg").read_text()
    assert json.loads((tmp_path / "figures" / f"{few[0].name}.vl.json").read_text())["title"]
