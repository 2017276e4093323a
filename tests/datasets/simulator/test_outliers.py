"""Outliers: rare, anywhere, and the same on any number of threads."""

import numpy as np
import pytest
from pydantic import ValidationError

from uwbbench.api import SPEED_OF_LIGHT_M_S


def test_outliers_are_as_rare_as_strong_and_as_far_as_the_scene_says(make_view, make_term, rng) -> None:
    view = make_view(np.zeros((20_000, 2)))
    term = make_term("outliers", share=0.1, lowest_db=-20.0, highest_db=-6.0, from_m=1.0, to_m=5.0)
    paths = term.paths(view, rng)
    shown = np.abs(paths.amplitude) > 0
    assert abs(shown.sum() - 2000) < 5 * np.sqrt(2000 * 0.9)
    level_db = 20 * np.log10(np.abs(paths.amplitude[shown]))
    range_m = paths.delay_s[shown] * SPEED_OF_LIGHT_M_S / 2
    for found, low, high in ((level_db, -20.0, -6.0), (range_m, 1.0, 5.0)):
        assert low <= found.min() < low + 0.02 * (high - low)
        assert high - 0.02 * (high - low) < found.max() <= high
    assert np.abs(paths.amplitude).max() <= term.bound(view)


def test_no_outliers_are_left_out_by_themselves(make_view, make_term) -> None:
    assert make_term("outliers", share=0.0).bound(make_view([[0, 0]])) == 0


def test_outliers_stand_alone(run_scene) -> None:
    terms = [{"use": "outliers", "params": {"share": 0.3, "to_m": 4.0}}]
    energy = np.abs(run_scene(terms, trajectory={"kind": "static", "duration_s": 20.0}).preamble).max(axis=1)
    hit = energy > 0
    assert 0 < hit.sum() < len(hit)
    assert len(np.unique(energy[hit])) == hit.sum()


@pytest.mark.parametrize("wrong", [{"lowest_db": 3.0}, {"from_m": 8.0}])
def test_limits_in_the_wrong_order_are_refused(make_term, wrong) -> None:
    with pytest.raises(ValidationError, match=f"{next(iter(wrong))} must not lie above"):
        make_term("outliers", **wrong)
