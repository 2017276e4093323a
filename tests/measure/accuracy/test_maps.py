"""Maps against what was there: the scoring ``map``."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.measure.accuracy.scenes import capture_of, post
from uwbbench.api import Detections, Grid, Landmarks, Map, Mapped, Obstacle, Poses, ScoringError
from uwbbench.measure.accuracy.metrics.map import MAP_METRICS
from uwbbench.measure.accuracy.region import Region
from uwbbench.measure.accuracy.scoring import score
from uwbbench.measure.accuracy.trajectories import Motion

STEPS = 40
REGION = Region(0.1, 8.0, math.pi)
POSTS = ((3.0, 0.0), (0.0, 3.0), (-3.0, 0.5))
WALL = Obstacle("wall", "plaster", np.array([[-4, -4], [4, -4]], float), structure=True)


def room(*objects, exhaustive=True):
    """A run on a small way among posts before a wall."""
    share = np.linspace(0, 1, STEPS)
    position_m = np.column_stack([share, 0.5 * share**2, np.zeros(STEPS)])
    objects = objects or (*(post(x, y) for x, y in POSTS), WALL)
    return capture_of(*objects, frames=STEPS, position_m=position_m, yaw_rad=share, exhaustive=exhaustive)


def landmarks(places, kind=0):
    a, b = np.array(places, float).reshape(-1, 2).T
    number = np.arange(len(a))
    return Landmarks(number, np.full(len(a), kind), a, b, np.zeros((len(a), 2, 2)), np.ones(len(a), np.int64))


def scored(made, capture=None, motion=None, smoothed=None):
    """Scores of a map; of an estimate that knows where it was, unless a motion says otherwise."""
    capture = capture or room()
    pose = np.column_stack([capture.trajectory.position_m[:, :2], capture.trajectory.yaw_rad])
    pose = pose if motion is None else motion.of_poses(pose)
    index = np.arange(len(pose))
    later = None if smoothed is None else Poses(index, smoothed)
    found = Detections([0], range_m=[1.0], processed=index, receiver=[0])
    return score(
        found.annotated(mapped=Mapped(Poses(index, pose), made, later)), capture, "map", region=REGION
    ).filtering


def true_map():
    return Map(landmarks(POSTS), WALL.outline_m[None])


def test_the_truth_itself_is_a_perfect_map():
    block = scored(true_map())
    for name in ("outline_f1_10", "landmark_precision", "landmark_recall", "landmark_f1", "map_overlap"):
        assert getattr(block, name) == 1.0
    assert (block.false_landmarks, block.landmark_duplicates) == (0, 0)
    for name in ("chamfer_m", "map_accuracy_m", "map_completeness_m", "chamfer_start_m", "landmark_error_m"):
        assert getattr(block, name) == pytest.approx(0, abs=1e-9)


def test_distances_are_those_of_every_point_to_every_other():
    made = Map(segments_m=np.array([[[-4, -3.85], [2, -3.95]]]), points_m=np.array([[3.1, 0.1], [1.0, 1.0]]))
    block = scored(made)
    share = (np.arange(301) + 0.5) / 301  # of 6.0008 m
    mine = np.vstack([np.array([-4, -3.85]) + share[:, None] * [6, -0.1], made.points_m])
    wall = np.column_stack([-4 + 0.02 * (np.arange(400) + 0.5), np.full(400, -4.0)])
    true = np.vstack([POSTS, wall])
    apart = np.hypot(*(mine[:, None] - true[None]).transpose(2, 0, 1))
    assert block.map_accuracy_m == pytest.approx(apart.min(axis=1).mean())
    assert block.map_completeness_m == pytest.approx(apart.min(axis=0).mean())
    assert block.chamfer_m == pytest.approx((apart.min(axis=1).mean() + apart.min(axis=0).mean()) / 2)
    for cm in (10, 20):
        precision, recall = (np.mean(apart.min(axis=axis) <= cm / 100) for axis in (1, 0))
        assert getattr(block, f"outline_precision_{cm}") == pytest.approx(precision)
        assert getattr(block, f"outline_recall_{cm}") == pytest.approx(recall)
        assert getattr(block, f"outline_f1_{cm}") == pytest.approx(2 * precision * recall / (precision + recall))


def test_cells_of_both_are_widened_by_one():
    block = scored(Map(points_m=np.array([[3.05, 0.05], [-2.15, 1.05]])), room(post(3.05, 0.05), post(-2.05, 1.05)))
    assert block.map_overlap == pytest.approx((9 + 6) / (9 + 12))  # one on its post, the other a cell beside it


def test_landmarks_belong_to_one_object_each():
    places = [(3.1, 0.0), (3.2, 0.0), (0.0, 2.5), (-3.0, 0.75)]  # a match, its duplicate, a false one, a match
    block = scored(Map(landmarks(places)))
    assert (block.landmark_precision, block.landmark_recall) == (0.5, pytest.approx(2 / 3))
    assert block.landmark_f1 == pytest.approx(4 / 7)
    assert (block.false_landmarks, block.landmark_duplicates) == (2, 1)
    assert block.landmark_error_m == pytest.approx((0.1 + 0.25) / 2)


def brute_matches(places, posts, gate_m):
    """Largest number of pairs, by trying every assignment."""
    near = [[math.dist(place, item) <= gate_m for item in posts] for place in places]
    wide = max(len(places), len(posts))
    orders = itertools.permutations(range(wide), len(places))
    return max(sum(column < len(posts) and near[row][column] for row, column in enumerate(order)) for order in orders)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_as_many_landmarks_as_possible_are_matched(seed):
    rng = np.random.default_rng(seed)
    posts = rng.uniform((2.5, 1), (3.3, 1.8), (4, 2))
    places = rng.uniform((2.5, 1), (3.3, 1.8), (4, 2))
    block = scored(Map(landmarks(places)), room(*(post(*place) for place in posts)))
    assert 4 * block.landmark_recall == pytest.approx(brute_matches(places, posts, 0.3))


def test_a_landmark_on_a_wall_is_false_and_one_on_what_was_never_seen_is_neither():
    capture = room(post(3, 0), post(20, 0), WALL)
    block = scored(Map(landmarks([(3, 0), (20.1, 0), (0, -4)])), capture)
    assert (block.landmark_precision, block.landmark_recall, block.false_landmarks) == (0.5, 1.0, 1)


def test_the_error_of_a_landmark_is_its_distance_from_the_outline():
    plate = Obstacle("plate", "metal", np.array([[2, -1], [2.2, -1], [2.2, 1], [2, 1]]))
    assert scored(Map(landmarks([(2.1, 0.9)])), room(plate)).landmark_error_m == 0
    assert scored(Map(landmarks([(1.8, 0.9)])), room(plate)).landmark_error_m == pytest.approx(0.2)


def test_lines_and_anchors_are_no_landmarks_of_objects():
    made = Map(landmarks([(3, 0)], kind=1))
    assert math.isnan(scored(made).landmark_f1)
    made = Map(landmarks([(3, 0)], kind=2))
    assert math.isnan(scored(made).landmark_f1)


def test_a_map_that_has_no_landmarks_is_not_asked_for_them_but_an_empty_one_is():
    block = scored(Map(grid=Grid(np.array([2.95, -0.05]), 0.1, np.ones((1, 1)))))
    assert math.isnan(block.landmark_recall)
    assert block.outline_precision_10 == 1.0
    empty = scored(Map())
    assert (empty.landmark_recall, empty.landmark_f1, empty.outline_f1_10, empty.map_overlap) == (0, 0, 0, 0)
    assert math.isnan(empty.chamfer_m)


def test_what_moves_is_no_part_of_a_map():
    walker = Obstacle("walker", "person", np.tile(np.array([[2.0, 1.0]]), (STEPS, 1, 1)))
    block = scored(Map(landmarks([(3, 0)])), room(post(3, 0), walker))
    assert (block.landmark_recall, block.map_completeness_m) == (1.0, pytest.approx(0, abs=1e-9))


@given(st.floats(-math.pi, math.pi), st.floats(-30, 30), st.floats(-30, 30))
@settings(max_examples=8, deadline=None)
def test_every_number_stays_where_poses_and_map_are_moved_as_a_whole(turn_rad, x_m, y_m):
    motion = Motion(turn_rad, np.array([x_m, y_m]))
    places = np.array(POSTS) + 0.07
    before = scored(Map(landmarks(places), WALL.outline_m[None] + 0.033))
    moved = Map(landmarks(motion.of_points(places)), motion.of_points(WALL.outline_m + 0.033)[None])
    after = scored(moved, motion=motion).own
    for name, value in before.own.items():
        assert after[name] == pytest.approx(value, abs=1e-7), name


def test_the_map_is_laid_over_the_truth_by_the_smoothed_trajectory_where_there_is_one():
    capture = room()
    truth = np.column_stack([capture.trajectory.position_m[:, :2], capture.trajectory.yaw_rad])
    astray = Motion(0.5, np.array([1.0, 1.0]))
    assert scored(true_map(), motion=astray).landmark_recall < 1
    assert scored(true_map(), motion=astray, smoothed=truth).landmark_recall == 1


def test_the_same_with_the_start_fixed_does_not_forgive_a_wrong_start():
    capture = room()
    pose = np.column_stack([capture.trajectory.position_m[:, :2], capture.trajectory.yaw_rad])
    pose[0, 2] += 0.3
    found = Detections([0], range_m=[1.0], processed=np.arange(STEPS))
    block = score(
        found.annotated(mapped=Mapped(Poses(np.arange(STEPS), pose), true_map())), capture, "map", region=REGION
    ).filtering
    assert block.chamfer_m == pytest.approx(0, abs=1e-9)
    assert block.chamfer_start_m > 0.2


def test_where_the_truth_is_not_exhaustive_only_what_is_missing_counts():
    block = scored(true_map(), room(*(post(x, y) for x, y in POSTS), WALL, exhaustive=False))
    open_world = {name for name, metric in MAP_METRICS.items() if not metric.needs_exhaustive_truth}
    assert {name.removesuffix("_m") for name, value in block.own.items() if not math.isnan(value)} == open_world
    assert {"map_completeness", "outline_recall_10", "landmark_recall"} <= open_world


def test_a_map_that_is_not_finite_is_refused():
    with pytest.raises(ScoringError, match="the map is not finite"):
        scored(Map(points_m=np.array([[0.0, np.nan]])))


def test_receivers_of_the_run_decide_what_was_to_be_seen():
    capture = room(post(3, 0), post(-3, 0.5))
    narrow = Region(0.1, 8.0, math.pi / 4)
    found = Detections([0], range_m=[1.0], processed=np.arange(STEPS))
    pose = np.column_stack([capture.trajectory.position_m[:, :2], capture.trajectory.yaw_rad])
    found = found.annotated(mapped=Mapped(Poses(np.arange(STEPS), pose), Map(landmarks([(3, 0)]))))
    back = dataclasses.replace(capture.radar, receiver="back", mount_yaw_rad=math.pi)
    both = dataclasses.replace(capture, radars=(capture.radar, back))
    assert score(found, capture, "map", region=narrow).landmark_recall == 1.0
    assert score(found, both, "map", region=narrow).landmark_recall == 0.5
