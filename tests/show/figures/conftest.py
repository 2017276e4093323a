"""What the tests of plots share: small captures, a run folder, and looking into figures."""

import matplotlib as mpl
import numpy as np
import pytest

from uwbbench.detect.pipeline import load_detector
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.show.figures.source import from_capture

RUN = """\
schema: 1
detectors: [paper, cfar-os]
datasets:
  - {use: approach, name: metal, params: {speed_m_s: 1.0}}
  - {use: approach, name: plywood, params: {speed_m_s: 1.0, material: plywood}}
scoring: [frame, peak]
latency: false
stability: false
"""


@pytest.fixture(autouse=True)
def settings_stay():
    """No drawing changes matplotlib's settings for the program that called it."""
    before = mpl.rcParams.copy()
    yield
    assert {k: v for k, v in mpl.rcParams.items() if before[k] != v and k != "backend"} == {}


@pytest.fixture(scope="session")
def paper(approach):
    return from_capture(approach, load_detector("paper"))


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> RunFolder:
    """A run of two detectors on two simulated captures."""
    base = tmp_path_factory.mktemp("plots")
    (base / "plots.yaml").write_text(RUN)
    return run_experiment(read_experiment(base / "plots.yaml"), base / "run", jobs=1)


class Look:
    """Texts and artists of a figure."""

    def __init__(self, figure):
        self.figure = figure
        self.axes = [axes for axes in figure.axes if axes.get_visible()]

    @property
    def caption(self) -> str:
        return " ".join(self.figure.get_supxlabel().split())

    def legend(self) -> dict[str, object]:
        """Handle of the legend by its text."""
        found = {}
        for axes in self.axes:
            if axes.get_legend() is not None:
                box = axes.get_legend()
                texts = [text.get_text() for text in box.get_texts()]
                found |= dict(zip(texts, box.legend_handles, strict=True))
        return found

    def lines(self, marker: str, axes: int = 0) -> list[np.ndarray]:
        """Points (n, 2) of the lines with a marker."""
        return [line.get_xydata() for line in self.axes[axes].lines if line.get_marker() == marker]


@pytest.fixture
def look():
    return Look
