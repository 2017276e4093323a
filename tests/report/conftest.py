"""A small run that has everything a report shows, made once."""

from pathlib import Path

import pytest

from uwbbench.report import Report
from uwbbench.report.page import Content
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.store import RunFolder

EXPERIMENT = """\
schema: 1
name: small
detectors: [paper, cfar-os, "null"]
datasets:
  - {use: approach, name: plates, params: {speed_m_s: 3.0, runs: 9}}
scoring: [frame, object]
latency: {frames: 40}
intervals: {resamples: 100}
stability: false
"""


@pytest.fixture(scope="session")
def small_run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """Three detectors on nine simulated captures, timed."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "small.yaml").write_text(EXPERIMENT)
    return run_experiment(read_experiment(folder / "small.yaml"), folder / "run", jobs=1)


@pytest.fixture(scope="session")
def content(small_run: RunFolder) -> Content:
    """What the page of that run shows, with the samples."""
    return Content(Report(small_run), [Path()])
