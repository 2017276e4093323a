"""The choice of the surface in an experiment: stored, verified, scored again with, and absent where it was not made."""

from dataclasses import replace

from uwbbench.results import Report
from uwbbench.run import rescore, run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder.verify import verify
from uwbbench.show.text.report import markdown

EXPERIMENT = {
    "detectors": ["paper"],
    "datasets": [{"use": "approach", "params": {"speed_m_s": 1.0}}],
    "scoring": "object",
    "latency": False,
    "stability": False,
}


def test_positions_are_scored_by_the_visible_face_and_scored_again_by_the_other(tmp_path):
    made = read_experiment({**EXPERIMENT, "surface": "visible"})
    folder = run_experiment(made, tmp_path / "run", jobs=1)
    assert {rule.surface for rule in folder.rules} == {"visible"}
    assert verify(folder).passed, verify(folder).problems
    assert run_experiment(made, tmp_path / "run", jobs=1, resume=True).manifest["experiment"]["surface"] == "visible"
    usual = run_experiment(read_experiment(EXPERIMENT), tmp_path / "usual", jobs=1)
    assert "surface" not in usual.manifest["experiment"]
    columns = ["table", "tp", "fp", "fn", "mae_m"]
    assert not folder.scores()[columns].equals(usual.scores()[columns])
    note = "distances to the part of an outline that the receiver can see (surface: visible)"
    assert (note in markdown(Report(folder)), note in markdown(Report(usual))) == (True, False)
    rescore(folder, [replace(rule, surface="outline") for rule in folder.rules])
    assert folder.scores()[columns].equals(usual.scores()[columns])
    assert verify(folder).passed
