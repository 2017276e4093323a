"""Causes of misses and kinds of false detections."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.detect.test_shipped_detectors import plate
from tests.fixtures.shipped import WITH_RANGES, sparing
from tests.measure.accuracy.test_scoring import capture_of, found_in, post
from uwbbench import load_detector
from uwbbench.api import SPEED_OF_LIGHT_M_S, Detections, Obstacle
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.causes import KINDS, NOT_KNOWN, Causes, causes
from uwbbench.measure.accuracy.echoes import covered_m, excess_m, ghosts_m, window_m
from uwbbench.measure.accuracy.judge import judge, tables_of
from uwbbench.measure.accuracy.region import Region
from uwbbench.measure.accuracy.rules import ScoringRules
from uwbbench.measure.accuracy.scene import Scene

FRAMES = 4


def explained(found, capture, scoring="object", table="filtering", **rules) -> Causes:
    rule = ScoringRules(scoring, **rules)
    scene = Scene.of(found, capture)
    made = causes(found, scene, rule, table)
    outcome = judge(found, scene, rule, table).outcome
    assert sum(made.misses.values()) == outcome.fn.sum()
    assert sum(made.false.values()) == outcome.fp.sum()
    return made


def with_candidates(found, *rows, chain=("peaks", "filter.width", "filter.snr")):
    """Detections with candidates given as (frame, range_m, place of the filter that dropped it)."""
    frame, range_m, place = np.array(rows, float).reshape(-1, 3).T
    candidates = Detections(frame, range_m=range_m, rejected_by=place)
    return found.annotated(candidates=candidates, chain=dict.fromkeys(chain, 1))


def nothing():
    return found_in(FRAMES)


def test_a_miss_is_of_the_filter_that_dropped_the_candidate_that_came_furthest():
    found = with_candidates(nothing(), (0, 2.05, 1), (0, 1.9, 2), (1, 2.1, 1), (2, 2.5, 2))
    made = explained(found, capture_of(post(2)))
    assert made.misses == {"no candidate": 2, "dropped by filter.snr": 1, "dropped by filter.width": 1}


@pytest.mark.parametrize("scoring", ["frame", "object"])
def test_without_candidates_the_cause_of_a_miss_is_not_known(scoring):
    assert explained(nothing(), capture_of(post(2)), scoring).misses == {NOT_KNOWN: FRAMES}


def test_an_echo_within_the_pulse_of_the_direct_path_is_masked_and_one_behind_it_is_not():
    capture = capture_of(post(2))
    far_m = covered_m(capture.radar, 2) / 2
    region = Region(min_range_m=0.0)
    for range_m, cause in ((far_m - 0.01, "masked by the direct path"), (far_m + 0.01, "no candidate")):
        made = explained(with_candidates(nothing()), capture_of(post(range_m)), region=region)
        assert made.misses == {cause: FRAMES}


def test_an_echo_behind_the_last_tap_is_outside_the_window():
    capture = capture_of(post(8))
    radar = replace(capture.radar, noise_taps=40)  # 60 of 100 taps of 0.2 m are left: 11.8 m of way, 5.9 m of range
    capture = replace(capture, radar=radar)
    assert window_m(radar) == pytest.approx(11.8)
    assert explained(with_candidates(nothing()), capture).misses == {"outside the window": FRAMES}


def test_one_detection_between_two_obstacles_leaves_the_other_shared():
    made = explained(found_in(FRAMES, (0, 2.1)), capture_of(post(2), post(2.2)))
    assert made.misses == {"shared": 1, NOT_KNOWN: 2 * FRAMES - 2}


def test_a_weaker_detection_that_is_not_looked_at_is_not_the_strongest():
    found = found_in(FRAMES, (0, 2.0), (0, 4.0), amplitude=[1.0, 2.0])
    assert explained(found, capture_of(post(2)), strongest=1).misses == {"not the strongest": 1, NOT_KNOWN: FRAMES - 1}


def test_a_detection_without_cluster_is_a_miss_of_the_clustering():
    place = {"x_m": [2.0], "y_m": [0.0], "cluster": [-1]}
    made = explained(found_in(FRAMES, (0, 2.0), **place), capture_of(post(2)), table="mapping")
    assert made.misses == {"not in a cluster": 1, NOT_KNOWN: FRAMES - 1}


def test_a_candidate_that_passed_all_filters_and_did_not_come_out_is_lost_behind_them():
    found = with_candidates(nothing(), *((frame, 2.0, np.nan) for frame in range(FRAMES)))
    assert explained(found, capture_of(post(2))).misses == {"lost behind the filters": FRAMES}


def test_false_detections_have_the_first_kind_that_holds():
    wall = Obstacle("wall", "concrete", np.array([[6.0, -1.0], [6.0, 1.0]]), structure=True)
    hidden = post(0, 3)
    capture = capture_of(post(2), hidden, wall, has_sts=True)  # 45 degrees to either side
    ranges = {
        2.0: None,
        2.1: "duplicate",
        3.1: "out of view",
        1.0: "direct path or ringing",
        2.35: "within twice the gate",
    }
    ranges |= {
        8.0: "noise",
        4.0: "ghost",
    }  # off the robot and out again; by way of the wall it is (2 + 4 + 6) / 2 = 6 m
    made = explained(found_in(FRAMES, *((0, range_m) for range_m in ranges)), capture)
    assert made.false == {kind: 1 for kind in KINDS if kind in ranges.values()}


def test_structure_is_false_where_a_scoring_counts_it_and_set_aside_by_object():
    wall = Obstacle("wall", "concrete", np.array([[6.0, -1.0], [6.0, 1.0]]), structure=True)
    found, capture = found_in(FRAMES, (0, 6.0)), capture_of(post(2), wall)
    assert explained(found, capture, "frame").false == {"structure": 1}
    assert explained(found, capture, "object").false == {}


def test_a_ghost_in_a_wall_lies_where_the_mirror_image_is():
    wall = Obstacle("wall", "concrete", np.array([[-1.0, 3.0], [5.0, 3.0]]), structure=True)
    found, capture = found_in(FRAMES), capture_of(post(2), wall)
    scene = Scene.of(found, capture)
    ways = ghosts_m(scene, np.array([0]))[0]
    by_wall = 2 + np.hypot(2, 6)  # out directly, back to the image of the receiver 6 m aside
    np.testing.assert_allclose(np.sort(ways), np.sort([8.0, by_wall, by_wall]))
    short = Obstacle("wall", "concrete", np.array([[1.5, 3.0], [5.0, 3.0]]), structure=True)  # the mirror is at x = 1
    assert np.isnan(ghosts_m(Scene.of(found, capture_of(post(2), short)), np.array([0]))).sum() == 2


def test_what_is_occluded_or_outside_the_region_is_no_miss_and_is_counted_beside():
    screen = Obstacle("screen", "metal", np.array([[1.0, -0.5], [1.0, 0.5]]))
    made = explained(nothing(), capture_of(screen, post(2), post(9.9, 3)))
    assert made.set_aside == {"occluded": FRAMES, "outside the region": FRAMES}
    assert sum(made.misses.values()) == FRAMES


def test_excess_paths_are_those_of_the_simulated_echoes():
    capture = plate()
    sight = capture.truth.seen_from(capture.radar, capture.trajectory)
    way_m = excess_m(sight.range_m, sight.azimuth_rad, capture.radar)[:, 0]
    assert np.all(way_m < 2 * sight.range_m[:, 0])  # the transmitter stands beside the receiver
    assert np.all(way_m > 2 * sight.range_m[:, 0] - 2 * capture.radar.baseline_length_m)
    assert covered_m(capture.radar, 2) == pytest.approx(2 * SPEED_OF_LIGHT_M_S / capture.radar.bandwidth_hz)


@pytest.mark.parametrize(
    "name", sparing(WITH_RANGES, {"paper-filtering", "cfar-os", "background-cfar-kalman", "constant"})
)
def test_causes_add_up_for_every_shipped_detector(name):
    capture = plate()
    found = load_detector(name).run(capture, candidates=True)
    for scoring in ("frame", "object", "peak"):
        for table in tables_of(found, scoring):
            made = explained(found, capture, scoring, table)
            assert NOT_KNOWN not in made.misses
            named = {cause.removeprefix("dropped by ") for cause in made.misses if cause.startswith("dropped by ")}
            assert named <= set(found.chain)


track = st.lists(st.tuples(st.integers(0, FRAMES - 1), st.floats(0.0, 11.0)), max_size=12)


@settings(deadline=None, max_examples=60)
@given(
    found=track,
    dropped=track,
    posts=st.lists(st.tuples(st.floats(0.3, 9.0), st.floats(-4.0, 4.0), st.booleans()), min_size=1, max_size=4),
    scoring=st.sampled_from(["frame", "object", "peak"]),
    exhaustive=st.booleans(),
    strongest=st.sampled_from([None, 1, 2]),
    table=st.sampled_from(get_args(Table)),
)
def test_causes_add_up_on_random_tracks(found, dropped, posts, scoring, exhaustive, strongest, table):
    objects = [post(x, y, structure=wall) for x, y, wall in posts]
    capture = capture_of(*objects, frames=FRAMES, exhaustive=exhaustive)
    place = {"x_m": [r for _, r in found], "y_m": [0.0] * len(found), "cluster": [n % 3 - 1 for n in range(len(found))]}
    detections = found_in(FRAMES, *found, amplitude=[r % 1 for _, r in found], **place)
    frame, range_m = np.array([*dropped, *found], float).reshape(-1, 2).T
    rejected_by = [1.0 + n % 2 for n in range(len(dropped))] + [np.nan] * len(found)
    candidates = Detections(frame, range_m=range_m, x_m=range_m, y_m=0 * range_m, rejected_by=rejected_by)
    chain = dict.fromkeys(("peaks", "filter.width", "filter.snr"), 1)
    explained(detections.annotated(candidates=candidates, chain=chain), capture, scoring, table, strongest=strongest)
