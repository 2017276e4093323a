"""Ground truth as pictures show it."""

import dataclasses

import numpy as np

from uwbbench.api import Obstacle, Truth
from uwbbench.measure.accuracy.region import Region
from uwbbench.results.ground_truth import outlines, true_ranges


def test_what_stands_still_has_corners_and_what_moves_the_path_of_its_middle(approach):
    steps = np.arange(len(approach))[:, None, None] * np.array([0.01, 0.0])
    person = Obstacle("person", "body", np.array([[2.0, 0.0], [2.2, 0.0]]) + steps)
    wall = Obstacle("wall", "plaster", np.array([[0.0, 1.0], [3.0, 1.0]]), structure=True)
    capture = dataclasses.replace(approach, truth=Truth((person, wall)))
    moving, still = outlines(capture, np.array([0, 10]))
    np.testing.assert_allclose(moving.points_m, [[2.1, 0.0], [2.2, 0.0]])
    np.testing.assert_allclose(still.points_m, [[0.0, 1.0], [3.0, 1.0]])
    assert (moving.moves, still.moves, still.structure) == (True, False, True)
    assert len(outlines(capture)[0].points_m) == len(approach)


def test_ranges_are_those_of_obstacles_and_gone_where_they_are_hidden(approach):
    (plate,) = true_ranges(approach)
    sight = approach.truth.seen_from(approach.radar, approach.trajectory)
    np.testing.assert_array_equal(plate.range_m, sight.range_m[:, 0])
    screen = Obstacle("screen", "cloth", np.array([[2.0, -3.0], [2.0, 3.0]]), structure=True)
    (hidden,) = true_ranges(dataclasses.replace(approach, truth=Truth((*approach.truth.objects, screen))))
    assert np.isnan(hidden.range_m).any()


def test_the_sector_is_that_of_the_scores(approach):
    beside = dataclasses.replace(approach, truth=Truth((Obstacle("post", "metal", np.array([[2.4, 1.0]])),)))
    (wide,), (narrow,) = true_ranges(beside), true_ranges(beside, Region(half_angle_rad=0.5))
    assert 0 < np.isfinite(narrow.ahead_m).sum() < np.isfinite(wide.ahead_m).sum()
    np.testing.assert_array_equal(narrow.range_m, wide.range_m)


def test_a_capture_without_truth_has_neither(approach):
    blind = dataclasses.replace(approach, truth=None)
    assert outlines(blind) == true_ranges(blind) == []
