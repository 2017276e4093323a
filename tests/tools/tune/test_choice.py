"""Which set is chosen, and the zone around it."""

import numpy as np
import pytest

from uwbbench.api import ScoringError
from uwbbench.tools.tune.choice import best_of, stable_zone
from uwbbench.tools.tune.sweep.scores import SetScores


def scores(f1, rmse_m=None):
    """Scores of sets with these figures, of 1000 true or missed frames each."""
    f1 = np.asarray(f1, float)
    tp = np.where(np.isnan(f1), 0, np.round(1000 * f1)).astype(int)
    misses = np.where(np.isnan(f1), 0, 2 * (1000 - tp))
    rmse_m = np.ones(len(f1)) if rmse_m is None else np.asarray(rmse_m, float)
    errors = np.where(np.isnan(rmse_m), 0, 1)
    return SetScores(tp, np.zeros(len(f1), int), misses, errors, np.nan_to_num(rmse_m), np.nan_to_num(rmse_m) ** 2)


def test_the_highest_f1_wins():
    assert best_of(scores([0.5, 0.9, 0.8]), 0.001, (3,)) == 1


def test_of_f1_within_the_tie_the_lowest_rmse_wins():
    assert best_of(scores([0.899, 0.9, 0.8], [0.1, 0.2, 0.0]), 0.0015, (3,)) == 0
    assert best_of(scores([0.898, 0.9, 0.8], [0.1, 0.2, 0.0]), 0.0015, (3,)) == 1


def test_of_equal_sets_the_one_in_the_middle_is_chosen():
    f1 = np.array([[0.9, 0.9, 0.9], [0.9, 0.9, 0.9], [0.9, 0.9, 0.9], [0.1, 0.1, 0.1]])
    assert best_of(scores(f1.ravel()), 0.0, f1.shape) == 4  # row 1, column 1


def test_a_set_without_errors_loses_against_one_with_errors():
    assert best_of(scores([0.9, 0.9], [np.nan, 0.5]), 0.0, (2,)) == 1


def test_sets_without_f1_are_passed_over_and_without_any_there_is_no_choice():
    assert best_of(scores([np.nan, 0.2]), 0.0, (2,)) == 1
    with pytest.raises(ScoringError, match="no set has an F1"):
        best_of(scores([np.nan, np.nan]), 0.0, (2,))


def zone(f1, first, second, within=0.01):
    places = [np.argsort(first), np.argsort(second)]
    return stable_zone(scores(np.ravel(f1)), within, {"a": first, "b": second}, places)


def test_the_zone_holds_all_sets_within_a_point_of_the_best():
    found = zone([[0.9, 0.892, 0.5], [0.889, 0.895, 0.5]], (1.0, 2.0), (10.0, 20.0, 30.0))
    assert found.inside.tolist() == [True, True, False, False, True, False]
    assert (found.share, found.regions) == (0.5, 1)
    assert found.spans == {"a": (1.0, 2.0), "b": (10.0, 20.0)}


def test_parts_of_the_zone_that_do_not_touch_are_counted():
    assert zone([[0.9, 0.1, 0.9], [0.1, 0.9, 0.1]], (1.0, 2.0), (1.0, 2.0, 3.0)).regions == 3


def test_neighbours_are_those_of_sorted_thresholds():
    assert zone([[0.9, 0.1, 0.9]], (1.0,), (1.0, 3.0, 2.0)).regions == 1


def test_a_threshold_of_none_inside_the_zone_leaves_its_span_open():
    found = stable_zone(scores([0.9, 0.9, 0.1]), 0.01, {"a": (None, 1.0, 2.0)}, [np.arange(3)])
    assert found.spans == {"a": (None, None)}
