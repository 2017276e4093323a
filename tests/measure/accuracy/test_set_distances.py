"""GOSPA and OSPA against their definitions, and against Stone Soup where it is installed."""

import datetime
import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api import ScoringError
from uwbbench.measure.accuracy.set_distances import gospa, ospa

GOLDEN = json.loads((Path(__file__).parent / "golden" / "stonesoup_gospa_ospa.json").read_text())
C = 0.5

positions = st.lists(st.tuples(st.floats(0, 2), st.floats(0, 2)), max_size=4).map(
    lambda rows: np.reshape(rows, (-1, 2))
)
orders = st.sampled_from([1.0, 1.5, 2.0, 3.0])


def by_permutations(truth, found, cutoff, order):
    """GOSPA and OSPA by trying every assignment."""
    few, many = sorted((truth, found), key=len)
    ways = itertools.permutations(range(len(many)), len(few))
    cut = [
        sum(min(float(np.linalg.norm(a - many[at])), cutoff) ** order for a, at in zip(few, way, strict=True))
        for way in ways
    ]
    left = len(many) - len(few)
    mean = (min(cut) + cutoff**order * left) / max(len(many), 1)
    return (min(cut) + cutoff**order / 2 * left) ** (1 / order), mean ** (1 / order)


@settings(deadline=None, max_examples=40)
@given(positions, positions, orders)
def test_both_are_the_best_of_all_assignments(truth, found, order):
    expected = by_permutations(truth, found, C, order)
    assert gospa(truth, found, C, order).value == pytest.approx(expected[0], abs=1e-12)
    assert ospa(truth, found, C, order) == pytest.approx(expected[1], abs=1e-12)


@settings(deadline=None, max_examples=40)
@given(positions, positions, positions, orders)
def test_both_are_distances(one, two, three, order):
    for distance in (lambda a, b: gospa(a, b, C, order).value, lambda a, b: ospa(a, b, C, order)):
        assert distance(one, two) == pytest.approx(distance(two, one), abs=1e-12)
        assert distance(one, three) <= distance(one, two) + distance(two, three) + 1e-9
        assert distance(one, one) == pytest.approx(0, abs=1e-12)


@settings(deadline=None, max_examples=40)
@given(positions, positions, orders)
def test_the_parts_of_gospa_add_up_to_its_power_and_count_what_is_left(truth, found, order):
    of = gospa(truth, found, C, order)
    assert of.localisation + of.missed + of.false == pytest.approx(of.value**order, abs=1e-12)
    pairs = len(truth) - of.missed / (C**order / 2)
    assert pairs == pytest.approx(len(found) - of.false / (C**order / 2))
    assert 0 <= round(pairs, 6) <= min(len(truth), len(found))


@pytest.mark.parametrize("case", GOLDEN["cases"], ids=lambda case: case["name"])
def test_both_are_what_stone_soup_found(case):
    truth, found = (np.reshape(case[key], (-1, 2)) for key in ("truth", "found"))
    for order, (value, localisation, missed, false) in zip(GOLDEN["orders"], case["gospa"], strict=True):
        of = gospa(truth, found, C, order)
        assert of.value == pytest.approx(value, abs=1e-12)
        assert (of.localisation, of.missed, of.false) == pytest.approx((localisation, missed, false), abs=1e-12)
    assert ospa(truth, found, C) == pytest.approx(case["ospa"], abs=1e-12)


@pytest.mark.slow  # its import takes seconds
def test_both_are_what_the_installed_stone_soup_finds():
    rng = np.random.default_rng(3)
    for _ in range(60):
        counts = rng.integers([0, 1], 6)  # of two empty sets it knows no time
        truth, found = (rng.uniform(0, 1.5, (count, 2)) for count in counts.tolist())
        for order in (1.0, 2.0, 3.5):
            value, *parts = stonesoup_gospa(truth, found, order)
            of = gospa(truth, found, C, order)
            assert of.value == pytest.approx(value, abs=1e-12)
            assert (of.localisation, of.missed, of.false) == pytest.approx(parts, abs=1e-12)
        assert ospa(truth, found, C) == pytest.approx(stonesoup_ospa(truth, found), abs=1e-12)


def stonesoup_gospa(truth, found, order):
    """Value and parts of Stone Soup's GOSPA."""
    metrics = pytest.importorskip("stonesoup.metricgenerator.ospametric")
    metric = metrics.GOSPAMetric(c=C, p=order, switching_penalty=0)
    found_metric, _ = metric.compute_gospa_metric(states(found), states(truth))
    parts = found_metric.value
    return tuple(parts[name] for name in ("distance", "localisation", "missed", "false"))


def stonesoup_ospa(truth, found):
    """Stone Soup's OSPA of order 1: of other orders it assigns by distances, not by their powers."""
    metrics = pytest.importorskip("stonesoup.metricgenerator.ospametric")
    return metrics.OSPAMetric(c=C, p=1).compute_OSPA_distance(states(found), states(truth)).value


def states(points):
    from stonesoup.types.state import State

    return [State(np.reshape(point, (2, 1)), timestamp=datetime.datetime(2026, 1, 1)) for point in points]


def test_ranges_are_positions_on_a_line():
    assert gospa([1.0, 2.0], [1.1], C).value == gospa([[1.0], [2.0]], [[1.1]], C).value


def test_a_pair_as_far_apart_as_the_cut_off_is_not_assigned_and_costs_the_same():
    of = gospa([1.0], [1.5], C)
    assert (of.localisation, of.missed, of.false) == (0, C**2 / 2, C**2 / 2)
    assert of.value == pytest.approx(C)


@pytest.mark.parametrize(
    ("truth", "cutoff", "order", "said"),
    [
        ([1.0], 0.0, 2.0, "cut-off must be positive"),
        ([1.0], C, 0.5, "order must be at least 1"),
        ([[1.0, 2.0]], C, 2.0, "as many axes"),
        ([[[1.0]]], C, 2.0, "as many axes"),
    ],
)
def test_what_is_no_set_or_no_distance_is_refused(truth, cutoff, order, said):
    for distance in (gospa, ospa):
        with pytest.raises(ScoringError, match=said):
            distance(truth, [1.0], cutoff, order)
