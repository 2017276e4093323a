"""A scoring that looks at few detections does not hide the others."""

import pytest

from tests.fixtures.chance import reseeded
from uwbbench.results import Report
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.show.page import Content
from uwbbench.show.page.sections import summary
from uwbbench.show.text.report import markdown
from uwbbench.show.text.wording import set_aside_warning

EXPERIMENT = """\
schema: 1
name: bold
detectors:
  - {use: cfar-os, name: bold, set: {pipeline.cfar.os.params.false_alarm_rate: 0.1, pipeline.cfar.os.params.cells: all}}
  - paper-filtering
datasets:
  - {use: approach, name: plate, params: {speed_m_s: 1.5}}
scoring: [frame, object]
latency: false
stability: false
intervals: {resamples: 100}
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """Report of a detector whose strongest detections are true and whose others are noise."""
    folder = tmp_path_factory.mktemp("bold")
    (folder / "bold.yaml").write_text(reseeded(EXPERIMENT))
    return Report(run_experiment(read_experiment(folder / "bold.yaml"), folder / "run", jobs=1))


def test_detections_that_a_scoring_set_aside_are_judged_all_the_same(report: Report) -> None:
    (one,) = report.set_aside
    assert (one.detector, one.scoring) == ("bold", "frame")
    boards = report.leaderboard.set_index(["detector", "scoring"])
    assert boards.loc[("bold", "frame"), "f1"] > 0.9
    assert one.precision == boards.loc[("bold", "object"), "precision"] < 0.6
    assert one.false_alarms_per_minute == boards.loc[("bold", "object"), "false_alarms_per_minute"]
    assert one.judged <= one.frames < one.found
    assert one.share > 0.5


def test_the_warning_stands_beside_the_score_that_flatters(report: Report) -> None:
    (one,) = report.set_aside
    warning = set_aside_warning(one)
    assert f"its precision is {one.precision:.3f}" in warning
    assert "false alarms a minute" in warning
    content = Content(report)
    warned = [board["scoring"] for board in content.data()["boards"] if warning in board["warnings"]]
    assert warned == ["frame"]
    assert "bold: frame scoring looked at" in markdown(report)
    leads = content.leaders["plate", "simulated"] == "bold"
    assert (warning in summary(content).warnings) == leads
