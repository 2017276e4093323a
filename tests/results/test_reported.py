"""Figures that a source reports of its method, beside those of a run."""

from pathlib import Path

import pytest

from uwbbench import load_detector
from uwbbench.api import ConfigError
from uwbbench.results import Report
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.show.text.report import Tables

DETECTOR = """\
schema: 1
name: after-source
reported:
  - {figures: "F1 <b>99</b> %", of: its own hall, source: "Somebody, 2020", metrics: [f1]}
  - {figures: "4 dB", of: its own hall, source: "Somebody, 2020"}
pipeline: [{use: peaks}, {use: range}]
"""

FINDS_NOTHING = """\
schema: 1
name: finds-nothing
reported:
  - {figures: "precision 99 %", of: its own hall, source: "Somebody, 2020", metrics: [precision]}
pipeline: [{use: peaks}, {use: filter.width, params: {minimum: 1000.0}}, {use: range}]
"""

EXPERIMENT = """\
schema: 1
detectors: [after-source.yaml, finds-nothing.yaml, "null"]
datasets: [{use: approach, name: plate, params: {speed_m_s: 6.0, runs: 1}, repeats: []}]
scoring: frame
latency: false
stability: false
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    folder = tmp_path_factory.mktemp("reported")
    (folder / "after-source.yaml").write_text(DETECTOR)
    (folder / "finds-nothing.yaml").write_text(FINDS_NOTHING)
    (folder / "one.yaml").write_text(EXPERIMENT)
    run_experiment(read_experiment(folder / "one.yaml"), folder / "run", jobs=1)
    return Report(RunFolder(folder / "run"))


def test_a_figure_with_a_like_metric_is_shown_beside_every_board_that_has_it(report: Report) -> None:
    (sheet,) = Tables(report).reported()
    like, other, _ = sheet.rows
    assert like[:4] == ("after-source", "F1 <b>99</b> %", "its own hall", "Somebody, 2020")
    assert like[4].startswith("SIMULATED: F1 ")
    assert like[5:] == ("plate", "frame", "1")
    assert other[4] == "no like metric"
    assert "no target" in sheet.notes[0]


def test_a_board_on_which_the_metric_has_no_value_is_not_shown(report: Report) -> None:
    (sheet,) = Tables(report).reported()
    assert [row[4] for row in sheet.rows if row[0] == "finds-nothing"] == ["no like metric"]


def test_figures_of_a_source_are_no_part_of_the_detector(tmp_path: Path) -> None:
    (tmp_path / "with.yaml").write_text(DETECTOR)
    (tmp_path / "without.yaml").write_text("\n".join(line for line in DETECTOR.split("\n") if "figures" not in line))
    text = (tmp_path / "without.yaml").read_text().replace("reported:\n", "")
    (tmp_path / "without.yaml").write_text(text)
    identities = {load_detector(tmp_path / name).identity for name in ("with.yaml", "without.yaml")}
    assert len(identities) == 1


def test_a_metric_that_is_not_there_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "wrong.yaml").write_text(DETECTOR.replace("[f1]", "[f2]"))
    with pytest.raises(ConfigError, match=r"wrong\.yaml:4: reported\[0\].*no metric 'f2'"):
        load_detector(tmp_path / "wrong.yaml")
