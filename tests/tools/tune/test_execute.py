"""A whole tuning against running and scoring detectors in the ordinary way."""

import numpy as np
import pytest
import yaml

from uwbbench.api import ConfigError
from uwbbench.measure.accuracy.metrics.detection import F1
from uwbbench.measure.accuracy.scoring import ScoringRules, outcomes
from uwbbench.measure.accuracy.stats import evaluate
from uwbbench.tools.tune import tune
from uwbbench.tools.tune.execute import variant

WIDTH = "pipeline.filter.width.params.minimum"


def f1_of(detector, captures, rules):
    return evaluate(F1, [outcomes(detector.run(one.capture), one.capture, rules)["filtering"] for one in captures])


@pytest.mark.parametrize("scoring", ["frame", "peak", "object"])
def test_every_set_has_the_f1_of_its_detector_on_the_tuning_captures(tuning, scoring):
    made = tuning(scoring=scoring)
    (tuned,) = tune(made).groups
    for index in range(0, 27, 5):
        values = {path: column[index] for path, column in tuned.columns.items()}
        expected = f1_of(variant(made, values), tuned.group.tuning, ScoringRules(scoring))
        assert tuned.scores.f1[index] == pytest.approx(expected, abs=1e-12)
    assert tuned.scores.f1[tuned.best] >= np.nanmax(tuned.scores.f1) - made.model.f1_tie


def test_the_chosen_set_stands_beside_the_detector_as_it_was_on_both_kinds_of_captures(tuning):
    made = tuning()
    (tuned,) = tune(made).groups
    before, after = variant(made, {}), variant(made, tuned.values)
    for result, detector, captures in (
        (tuned.before, before, tuned.group.tuning),
        (tuned.after, after, tuned.group.tuning),
        (tuned.held_out_before, before, tuned.group.held_out),
        (tuned.held_out_after, after, tuned.group.held_out),
    ):
        assert result.scores.f1[0] == pytest.approx(f1_of(detector, captures, made.rules))
        assert result.captures == 2
    assert tuned.after.scores.f1[0] == tuned.scores.f1[tuned.best]
    assert {one.capture.sha256 for one in tuned.group.tuning}.isdisjoint(
        one.capture.sha256 for one in tuned.group.held_out
    )


def test_materials_and_channels_are_tuned_apart(tuning):
    outcome = tune(tuning(groups=["material", "channel", "material-channel", "overall"]))
    names = [tuned.group.name for tuned in outcome.groups]
    assert names == ["concrete", "plywood", "ch5", "ch9", "concrete-ch9", "plywood-ch5", "overall"]
    assert [len(tuned.group.tuning) for tuned in outcome.groups] == [1, 1, 1, 1, 1, 1, 2]
    assert {len(tuned.scores.tp) for tuned in outcome.groups} == {27}


def test_a_group_without_held_out_captures_says_so(tuning, approach_of):
    outcome = tune(tuning(groups=["material"], held_out=[approach_of("concrete", 2)]))
    assert [tuned.held_out_after is None for tuned in outcome.groups] == [False, True]
    assert "plywood: no capture is held out" in outcome.notes


def test_simulated_captures_are_told(tuning):
    assert any("SIMULATED" in note for note in tune(tuning()).notes)


def test_a_choice_at_the_edge_of_the_grid_is_told_and_a_plateau_there_is_not(tuning):
    narrow = tune(tuning(grid={WIDTH: [3.0, 4.0]}))
    assert any("edge of the grid" in note and WIDTH in note for note in narrow.notes)
    flat = tune(tuning(grid={WIDTH: [0.0, 0.1, 0.2]}))  # no width is below half a tap
    assert not any("edge of the grid" in note for note in flat.notes)


def test_captures_that_are_held_out_are_not_tuned_on_whatever_they_are_called(tuning, approach_of):
    renamed = {**approach_of("concrete", 1), "name": "another name"}
    with pytest.raises(ConfigError, match=r"both tuned on and held out: 'another name: .* \(here 'concrete, seed 1"):
        tune(tuning(held_out=[renamed]))


def experiment(tmp_path, *datasets):
    path = tmp_path / "scores.yaml"
    data = {"schema": 1, "detectors": ["null"], "datasets": list(datasets), "latency": False, "stability": False}
    path.write_text(yaml.safe_dump(data))
    return path


def test_captures_that_the_experiment_scores_are_not_tuned_on(tuning, tmp_path, approach_of):
    experiment(tmp_path, approach_of("metal", 5), {**approach_of("plywood", 1, channel=5), "name": "test set"})
    with pytest.raises(ConfigError, match="experiment 'scores' scores captures that would be tuned on: 'test set: "):
        tune(tuning(experiment="scores.yaml"))


def test_the_experiment_of_the_option_goes_before_that_of_the_file(tuning, tmp_path, approach_of):
    path = experiment(tmp_path, approach_of("plywood", 1, channel=5))
    with pytest.raises(ConfigError, match="experiment 'scores'"):
        tune(tuning(scored_by=str(path), experiment="demo"))


def test_an_experiment_on_other_captures_and_on_those_held_out_is_no_obstacle(tuning, tmp_path, approach_of):
    experiment(tmp_path, approach_of("metal", 5), approach_of("concrete", 2))
    assert len(tune(tuning(experiment="scores.yaml")).groups) == 1


@pytest.mark.parametrize("scoring", ["frame", "peak", "object"])
def test_a_detector_that_retains_several_peaks_is_tuned_too(tuning, scoring):
    made = tuning(set={"pipeline.select.strongest.params": {"count": 2}}, grid={WIDTH: [0.5, 1.5]}, scoring=scoring)
    (tuned,) = tune(made).groups
    for index, width in enumerate((0.5, 1.5)):
        expected = f1_of(variant(made, {WIDTH: width}), tuned.group.tuning, made.rules)
        assert tuned.scores.f1[index] == pytest.approx(expected, abs=1e-12)


SPACE = {
    WIDTH: {"low": 0.5, "high": 3.0},
    "pipeline.select.strongest.use": {"choices": ["select.strongest", "select.nearest"]},
    "pipeline.peaks.params.window_taps": {"low": 5, "high": 21, "whole": True},
}


def test_a_search_tries_so_many_detectors_each_scored_in_the_ordinary_way(tuning):
    pytest.importorskip("optuna")
    made = tuning(grid=..., search={"space": SPACE, "trials": 6, "seed": 3})
    (tuned,) = tune(made).groups
    assert (len(tuned.scores.tp), tuned.zone) == (6, None)
    for index in (0, 5):
        values = {path: column[index] for path, column in tuned.columns.items()}
        assert isinstance(values["pipeline.peaks.params.window_taps"], int)
        assert tuned.scores.f1[index] == pytest.approx(f1_of(variant(made, values), tuned.group.tuning, made.rules))
    again = tune(made).groups[0]
    assert again.columns == tuned.columns


def test_a_search_may_be_scored_after_mapping(tuning, approach_of):
    pytest.importorskip("optuna")
    mapped = approach_of("metal", 1, sts=True, frame_rate_hz=24.0)
    other = approach_of("metal", 2, sts=True, frame_rate_hz=24.0)
    space = {"pipeline.dbscan.params.eps_m": {"low": 0.05, "high": 0.4}}
    search = {"space": space, "trials": 3, "sampler": "random"}
    made = tuning(detector="paper", grid=..., search=search, table="mapping", tuning=[mapped], held_out=[other])
    (tuned,) = tune(made).groups
    after = variant(made, tuned.values)
    expected = [outcomes(after.run(one.capture), one.capture, made.rules)["mapping"] for one in tuned.group.tuning]
    assert tuned.after.scores.f1[0] == pytest.approx(evaluate(F1, expected))
    # The detector as it is was tried first, as the space holds its value.
    assert tuned.columns["pipeline.dbscan.params.eps_m"][0] == 0.2
