"""Motion, windows of points, evidence, and whether a filter is right about itself."""

import numpy as np
import pytest

from tests.detectors.conftest import build_radar
from uwbbench.api import Detections
from uwbbench_detectors.mappers.consistency import Consistency
from uwbbench_detectors.mappers.evidence import Evidence, EvidenceParams
from uwbbench_detectors.mappers.motion import Motion, MotionParams
from uwbbench_detectors.mappers.window import Window, WindowParams

RADARS = {"front": build_radar(receiver="front")}


def rows(*places: tuple[float, float]) -> dict[str, Detections]:
    range_m, azimuth_rad = np.array(places).reshape(-1, 2).T
    return {"front": Detections(np.zeros(len(places), int), range_m=range_m, azimuth_rad=azimuth_rad)}


def window(**params: float) -> Window:
    return Window(WindowParams.model_validate(params), RADARS)


def test_derivatives_of_the_motion_are_those_of_its_pose():
    motion = Motion(MotionParams.model_validate({}))
    head, moved = np.array([1.0, 2.0, 0.7, 0.05, -0.1]), np.array([0.5, -0.2, 0.3])
    pose, by_head, _ = motion.predicted(head, moved)
    for place in range(5):
        nudged = head.copy()
        nudged[place] += 1e-6
        np.testing.assert_allclose((motion.predicted(nudged, moved)[0] - pose) / 1e-6, by_head[:, place], atol=1e-5)


def test_a_robot_that_stands_gains_no_doubt():
    motion = Motion(MotionParams.model_validate({}))
    pose, _, noise = motion.predicted(np.array([1.0, 2.0, 0.7, 0.05, 0.02]), np.zeros(3))
    np.testing.assert_array_equal(pose, [1.0, 2.0, 0.7])
    np.testing.assert_array_equal(noise, 0)


def test_a_cluster_is_the_median_of_its_points_from_the_end_of_the_window():
    gathered = window()
    for step in range(7):
        gathered.add(np.array([0.1, 0.0, 0.0]), rows((2.0 - 0.1 * step, 0.0)))
    assert gathered.full
    (cluster,) = gathered.take()
    np.testing.assert_allclose(cluster.place_m, [1.4, 0.0], atol=1e-12)
    assert (cluster.points, round(cluster.spread_m, 9)) == (7, 0)


def test_points_are_in_one_window_only():
    gathered = window()
    gathered.add(np.array([1.0, 0.0, 0.0]), rows(*[(2.0, 0.0)] * 6))
    assert len(gathered.take()) == 1
    gathered.add(np.array([1.0, 0.0, 0.0]), rows())
    assert gathered.take() == []


def test_a_standing_robot_adds_no_points():
    gathered = window()
    for _ in range(100):
        gathered.add(np.zeros(3), rows((2.0, 0.0)))
    assert gathered.take() == []


@pytest.mark.parametrize("place", [(0.4, 0.0), (3.6, 0.0), (2.0, 1.4), (np.nan, 0.0), (2.0, np.nan)])
def test_points_too_near_too_far_too_much_aside_or_nowhere_do_not_count(place):
    gathered = window()
    gathered.add(np.array([1.0, 0.0, 0.0]), rows(*[place] * 10))
    assert gathered.take() == []


def test_turning_on_the_spot_ends_a_window():
    gathered = window()
    gathered.add(np.array([0.0, 0.0, 1.6]), rows())
    assert gathered.full


def evidence(**params: float) -> Evidence:
    return Evidence(EvidenceParams.model_validate(params), WindowParams.model_validate({}), RADARS)


def test_a_landmark_is_confirmed_by_directions_that_differ_not_by_time():
    known = evidence()
    for x in np.arange(0.0, 3.0, 0.5):
        known.see(1, np.array([x, 0.0, 0.0]), np.array([4.0, 0.0]))
        known.see(2, np.array([x, 0.0, 0.0]), np.array([4.0, 1.0]))
    assert not known.confirmed(1)
    assert known.confirmed(2)


def test_a_landmark_that_should_be_seen_and_is_not_is_refuted():
    known = evidence()
    known.see(1, np.zeros(3), np.array([2.0, 0.5]))
    known.see(1, np.array([1.0, 0.0, 0.0]), np.array([2.0, 0.5]))
    assert known.confirmed(1)
    for _ in range(3):
        known.miss(1)
        assert known.refuted() == []
    known.miss(1)
    assert known.refuted() == [1]


def test_what_was_never_confirmed_is_dropped_long_after_it_was_seen():
    known = evidence()
    known.see(1, np.zeros(3), np.array([2.0, 0.5]))
    known.travel(29.0)
    assert known.refuted() == []
    known.travel(2.0)
    assert known.refuted() == [1]


@pytest.mark.parametrize(
    ("place", "expected"), [((2.0, 0.0), True), ((4.0, 0.0), False), ((0.5, 0.0), False), ((0.1, 2.0), False)]
)
def test_only_places_well_in_view_are_expected(place, expected):
    assert evidence().expects(np.zeros(3), np.array(place)) == expected


def test_a_filter_diverges_where_innovations_are_larger_than_chance_allows():
    right, wrong = Consistency(), Consistency()
    for squared in np.random.default_rng(1).chisquare(2, 200):
        right.add(squared, 2)
        wrong.add(4 * squared, 2)
    assert wrong.diverges
    assert not right.diverges
