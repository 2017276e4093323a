"""Fitting: what is found, on which draws it is shown, and what is left behind."""

import csv
import json
import math

import pyarrow.parquet as pq
import pytest

from tests.tools.fit.conftest import FIT
from uwbbench.api.errors import StoreError, UwbbenchError
from uwbbench.api.yaml_file import read_yaml
from uwbbench.tools.fit import fit, message, write_outcome
from uwbbench.tools.fit.config import Target, ToleranceModel
from uwbbench.tools.fit.evaluate import FARTHEST, cost, distance
from uwbbench.tools.fit.execute import _Cells

ROBOT = """\
schema: 1
name: mine
radar: {sample_interval_ns: 1.0016}
seed: 1
channels: {9: {terms: {direct: {isolation_db: 6.0}}}}
"""


@pytest.fixture
def outcome(plan, tmp_path):
    """Distance of the plate, fitted to an error of 30 cm of a detector that always says the same."""
    return write_outcome(fit(plan()), tmp_path / "fitted")


def test_the_value_that_gives_the_figure_is_found_and_shown_on_unseen_draws(outcome, plan, tmp_path):
    assert outcome.passed
    (one,) = outcome.residuals
    assert len(one.draws) == 2
    assert one.value == pytest.approx(0.3, abs=0.15)
    written = read_yaml(tmp_path / "fitted" / "plate.yaml").data
    assert written["objects"][0]["center_m"][0] == outcome.best.values["distance"]


def test_a_fit_leaves_calibrated_files_residuals_trials_and_manifest(outcome, tmp_path):
    folder = tmp_path / "fitted"
    names = {"plate.yaml", "residuals.csv", "trials.parquet", "summary.md", "manifest.json"}
    assert {path.name for path in folder.iterdir()} == names
    text = (folder / "plate.yaml").read_text()
    assert text.startswith("# Calibrated to figures of a test; not a validation of them.\n")
    assert "1 of 1 targets are within their tolerance" in text
    (row,) = csv.DictReader((folder / "residuals.csv").open())
    assert float(row["value"]) == outcome.residuals[0].value
    assert len(row["draws"].split()) == 2
    trials = pq.read_table(folder / "trials.parquet").to_pandas()
    assert len(trials) == 12
    assert trials.loc[trials["best"], "cost"].tolist() == [trials["cost"].min()]
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["optuna"]["seeds"] == [0]
    assert manifest["configuration"]["fitting"]["seeds"] == [1]
    assert manifest["results"]["passed"] is True


def test_the_same_fit_finds_the_same(plan, outcome):
    again = fit(plan())
    assert again.best == outcome.best


def test_a_target_out_of_reach_is_named_with_its_distance(plan, tmp_path):
    made = plan(targets={"near": {"filtering": {"mae": 9.0}}})
    outcome = write_outcome(fit(made), tmp_path / "fitted")
    assert not outcome.passed
    assert message(outcome).startswith("out of reach: near, filtering, mae: ")
    assert "for 900.0, 10.0 tolerances off" in message(outcome)
    assert "(out of tolerance)" in (tmp_path / "fitted" / "plate.yaml").read_text()


def test_a_stage_begins_at_the_best_of_the_one_before_and_frees_only_its_own(plan):
    noise = {"in": "plate.yaml", "path": "terms.noise.params.snr_db", "low": 30, "high": 50}
    stages = [{"free": ["distance"], "trials": 4}, {"free": ["noise"], "trials": 3}]
    made = plan(parameters={**FIT["parameters"], "noise": noise}, search={"stages": stages})
    trials = fit(made).trials
    assert {trial.values["noise"] for trial in trials[:4]} == {40}
    best = min(trials[:4], key=lambda trial: trial.cost)
    assert {trial.values["distance"] for trial in trials[4:]} == {best.values["distance"]}
    assert trials[4].values == best.values


def test_a_narrow_stage_stays_near_the_best_so_far(plan):
    made = plan(search={"stages": [{"trials": 1}, {"trials": 8, "span": 0.1}]})
    assert all(abs(trial.values["distance"] - 2.0) <= 0.1 for trial in fit(made).trials)


def test_cells_that_a_parameter_does_not_bear_on_are_not_simulated_again(plan):
    cells = {"near": {"scene": "plate.yaml"}, "other": {"scene": "plate.yaml", "set": {"radar.channel": 5}}}
    parameters = {"distance": {**FIT["parameters"]["distance"], "cells": ["near"]}}
    made = plan(cells=cells, parameters=parameters)
    evaluated = _Cells(made)
    first = {name: evaluated.found(cell, {"distance": 1.5}) for name, cell in made.cells.items()}
    second = {name: evaluated.found(cell, {"distance": 2.5}) for name, cell in made.cells.items()}
    assert second["other"] is first["other"]
    assert second["near"] is not first["near"]


def test_the_robot_of_all_scenes_is_fitted_too(plan, tmp_path):
    (tmp_path / "mine.yaml").write_text(ROBOT)
    isolation = {"in": "robot", "path": "channels.9.terms.direct.isolation_db", "low": 0, "high": 12}
    made = plan(robot="mine.yaml", parameters={"isolation": isolation}, search={"stages": [{"trials": 2}]})
    outcome = write_outcome(fit(made), tmp_path / "fitted")
    robot = read_yaml(tmp_path / "fitted" / "mine.yaml").data
    assert robot["channels"][9]["terms"]["direct"]["isolation_db"] == outcome.best.values["isolation"]
    assert read_yaml(tmp_path / "fitted" / "plate.yaml").data["robot"] == "mine.yaml"


def test_counts_behind_steps_are_targets_too(plan):
    made = plan(
        detector="paper",
        targets={"near": {"chain": {"peaks": 150}}},
        tolerances={"chain": {"factor": 2.0}},
        search={"stages": [{"trials": 1}]},
    )
    (one,) = fit(made).fitted
    assert one.value > 0
    assert one.draws == (one.value,)


def test_files_that_a_scene_names_are_copied_beside_it(plan, tmp_path):
    poses = "timestamp_s,x_m,y_m,yaw_rad\n0,0,0,0\n0.4,0.1,0,0\n"
    (tmp_path / "poses.csv").write_text(poses)
    scene = (tmp_path / "plate.yaml").read_text()
    start = scene.index("trajectory:")
    end = scene.index("\n", start)
    (tmp_path / "plate.yaml").write_text(f"{scene[:start]}trajectory: {{kind: file, file: poses.csv}}{scene[end:]}")
    write_outcome(fit(plan(search={"stages": [{"trials": 1}]})), tmp_path / "fitted")
    assert (tmp_path / "fitted" / "poses.csv").read_text() == poses


def test_a_scene_without_a_place_to_write_is_refused(plan, tmp_path):
    (tmp_path / "fitted").write_text("a file")
    with pytest.raises(StoreError, match="fitted"):
        write_outcome(fit(plan(search={"stages": [{"trials": 1}]})), tmp_path / "fitted")


def test_the_time_bounds_a_search(plan):
    made = plan(search={"stages": [{"trials": 100_000}], "timeout_s": 0.3})
    outcome = fit(made)
    assert outcome.out_of_time
    assert len(outcome.trials) < 100_000


def test_without_optuna_a_fit_says_how_to_install_it(plan, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "optuna", None)
    with pytest.raises(UwbbenchError, match=r"needs Optuna.*uwbbench\[tune\]"):
        fit(plan())


@pytest.mark.parametrize(
    ("tolerance", "value", "expected"),
    [
        ({"absolute": 0.05}, 0.9, 2.0),
        ({"relative": 0.25}, 0.6, 1.0),
        ({"factor": 2.0}, 0.4, 1.0),
        ({"factor": 2.0}, 3.2, 2.0),
        ({"factor": 2.0}, 0.0, FARTHEST),
        ({"absolute": 0.05}, math.nan, FARTHEST),
        ({"absolute": 0.05}, 50.0, FARTHEST),
    ],
)
def test_distances_are_counted_in_tolerances(tolerance, value, expected):
    target = Target("cell", "filtering", "mae", 0.8, ToleranceModel(**tolerance))
    assert distance(target, value) == pytest.approx(expected)


def test_the_cost_grows_with_the_square_inside_the_tolerance_and_evenly_outside():
    target = Target("cell", "filtering", "mae", 1.0, ToleranceModel(absolute=0.1, weight=2.0))
    assert [cost(target, value) for value in (1.0, 1.05, 1.1, 1.2, 1.3)] == pytest.approx([0, 0.5, 2, 6, 10])
