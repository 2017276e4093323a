"""The page of a run over test signals: its questions first, and nothing that such signals cannot say."""

import math
from pathlib import Path

import altair
import pytest

from tests.fixtures.shared import Once
from uwbbench.results import Report
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.show.page import Content, page
from uwbbench.show.page.limits_section import limits, sentences
from uwbbench.show.page.sections import sections

EXPERIMENT = """\
schema: 1
name: signals
detectors:
  - paper-subsample
  - {use: cfar-ca, name: cells, set: {pipeline.cfar.ca.params.cells: all}}
  - "null"
datasets:
  - {use: limits, name: weak, params: {scene: echo, snr_db: 15, frames: 400}}
  - {use: limits, name: strong, params: {scene: echo, snr_db: 30, frames: 400}}
  - {use: limits, name: pair, params: {scene: pair, snr_db: 25, separation_ns: 5.0, frames: 100}}
  - {use: limits, name: noise, params: {scene: noise, snr_db: 20, frames: 300}}
scoring: object
latency: false
stability: false
intervals: {resamples: 100}
"""


@pytest.fixture(scope="module")
def signals(once: Once) -> Content:
    """What the page of a small run over test signals shows."""

    def make(folder: Path) -> None:
        (folder / "signals.yaml").write_text(EXPERIMENT)
        run_experiment(read_experiment(folder / "signals.yaml"), folder / "run", jobs=1)

    return Content(Report(RunFolder(once("signals", make) / "run")), [Path()])


def test_the_questions_of_the_test_signals_stand_first(signals: Content) -> None:
    parts = sections(signals)
    assert [part.id for part in parts][:2] == ["summary", "limits"]
    titles = [spec["title"]["text"] for spec in parts[1].charts]
    assert [title.split(",")[0] for title in titles] == [
        "Range error against SNR",
        "False alarms against the requested rate",
        "Resolution of two echoes",
        "Detection against SNR",
    ]
    assert all("SIMULATED" in title for title in titles)


def test_there_is_no_leader_no_best_capture_and_no_empty_section(signals: Content) -> None:
    assert not {part.id for part in sections(signals)} & {"leaderboard", "pareto", "range", "errors", "captures-seen"}
    html = page(signals)
    assert "leads with" not in html
    assert "data:image/png" not in html
    assert len(html) < 3_000_000


def test_the_charts_follow_the_schema_and_draw_the_bound(signals: Content) -> None:
    section = limits(signals)
    assert section is not None
    for spec in section.charts:
        altair.Chart.from_dict(spec, validate=True)
    bound = section.charts[0]["layer"][0]["data"]["values"]
    assert [row["snr"] for row in bound] == [15, 30]
    assert bound[0]["error"] / bound[1]["error"] == pytest.approx(10 ** (15 / 20))


def test_the_sentences_say_what_the_tables_hold(signals: Content) -> None:
    error, alarms, _ = sentences(signals)
    table = signals.report.limits.accuracy.set_index(["detector", "snr_db"])
    best = table.loc[("paper-subsample", 30.0), "rmse_m"]
    assert f"at 30 dB paper-subsample has {100 * best:.2f} cm RMS" in error
    assert alarms.startswith("False alarms, measured in times of the requested rate a cell: cells ")
    assert not math.isnan(best)
