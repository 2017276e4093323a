"""The stage against its definition, written down with scikit-learn: all points clustered anew in each round."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.cluster import DBSCAN

from uwbbench.api import Block, Detections

EPS_M = 0.25


class Definition:
    """Rounds over all points, or a window of them, as the stage documents them; rows are (arrival, cluster)."""

    def __init__(self, every, min_samples, window):
        self.every, self.min_samples, self.window = every, min_samples, window
        self.points, self.ids = [], []
        self.new = self.clusters = self.rounds = self.left = 0

    def take(self, arrival, point):
        if not np.isfinite(point).all():
            return [(arrival, -1)]
        self.points.append((arrival, *point))
        self.ids.append(-1)
        self.new += 1
        return self.round() if self.new == self.every else []

    def end(self):
        decided = self.round() if self.new else []
        held = [arrival for (arrival, *_), cluster in zip(self.points, self.ids, strict=True) if cluster == -1]
        return decided + [(arrival, -1) for arrival in held if arrival >= self.first_arrival()]

    def first_arrival(self):
        return self.points[self.left][0] if self.left < len(self.points) else np.inf

    def round(self):
        self.rounds, self.new = self.rounds + 1, 0
        before, entered = list(self.ids), self.left
        self.left = max(len(self.points) - self.window, 0) if self.window else 0
        placed = np.array(self.points)[:, 1:]
        model = DBSCAN(eps=EPS_M, min_samples=self.min_samples, algorithm="kd_tree")
        labels = model.fit(placed[self.left :] - placed[0]).labels_
        taken, ids = set(), list(self.ids)
        for label in range(labels.max() + 1):
            core = [row for row in model.core_sample_indices_ if labels[row] == label]
            known = {self.ids[self.left + row] for row in core} - taken - {-1}
            number = min(known, default=self.clusters)
            self.clusters = max(self.clusters, number + 1)
            taken.add(number)
            for row in np.flatnonzero(labels == label):
                ids[self.left + row] = number
        self.ids = ids
        rows = range(entered, len(ids))
        return [
            (self.points[row][0], ids[row]) for row in rows if before[row] == -1 and (ids[row] >= 0 or row < self.left)
        ]


def lattice(seed, count, width=8):
    """Points whose distances tie with the radius, some without position."""
    points = np.random.default_rng(seed).integers(0, width, (count, 2)) / 8
    points[np.random.default_rng(seed + 1).uniform(size=count) < 0.1] = np.nan
    return points


@pytest.mark.slow
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(0, 150),
    width=st.integers(2, 20),
    every=st.integers(1, 40),
    min_samples=st.integers(1, 12),
    room=st.none() | st.integers(0, 60),
    cuts=st.lists(st.integers(0, 150), max_size=5),
)
@settings(max_examples=100, deadline=None)
def test_rounds_decide_what_their_definition_says_in_its_order(
    make_stage, make_radar, make_block, seed, count, width, every, min_samples, room, cuts
):
    window = None if room is None else max(every, min_samples) + room
    points = lattice(seed, count, width)
    expected = Definition(every, min_samples, window)
    stage = make_stage("dbscan", eps_m=EPS_M, every=every, min_samples=min_samples, window=window)
    stage.open(make_radar())
    edges = [0, *sorted(min(cut, count) for cut in cuts), count]
    whole = make_block(np.ones((count, 4)))
    for start, stop in pairwise(edges):
        columns = {"x_m": points[start:stop, 0], "y_m": points[start:stop, 1]}
        part = Block(whole.frames.part(start, stop), detections=Detections(np.arange(start, stop), **columns))
        wanted = [row for arrival in range(start, stop) for row in expected.take(arrival, points[arrival])]
        released = stage.step(part).detections
        assert list(zip(released.frame.tolist(), released["cluster"].tolist(), strict=True)) == wanted
        np.testing.assert_array_equal(released["x_m"], points[released.frame, 0])
        assert stage.clusterings == expected.rounds
    tail = stage.flush().detections
    assert list(zip(tail.frame.tolist(), tail["cluster"].tolist(), strict=True)) == expected.end()
    assert stage.clusterings == expected.rounds


def test_columns_that_only_some_blocks_have_are_empty_in_the_others(make_stage, make_radar, make_block):
    stage = make_stage("dbscan", every=3, min_samples=1)
    stage.open(make_radar())
    whole = make_block(np.ones((3, 4)))
    rows = [
        Detections([0], x_m=[0.0], y_m=[0.0], tap=[7.0]),
        Detections([1], x_m=[0.0], y_m=[0.0], flavour=[2.0]),
        Detections([2], x_m=[0.0], y_m=[0.0], tap=[9.0]),
    ]
    blocks = [Block(whole.frames.part(frame, frame + 1), detections=row) for frame, row in enumerate(rows)]
    first, second, third = (stage.step(block).detections for block in blocks)
    assert len(first) == len(second) == 0
    assert {"cluster", "flavour"} <= second.columns.keys()
    np.testing.assert_array_equal(third["tap"], [7, np.nan, 9])
    np.testing.assert_array_equal(third["flavour"], [np.nan, 2, np.nan])


def test_rows_that_were_handed_out_take_no_memory(make_stage, make_radar, make_block):
    stage = make_stage("dbscan", every=10, min_samples=5, window=20)
    stage.open(make_radar())
    block = make_block(np.ones((100, 4)))
    for start in range(0, 100 * 50, 100):
        found = Detections(np.arange(start, start + 100), x_m=np.zeros(100), y_m=np.zeros(100))
        assert len(stage.step(block.replace(detections=found)).detections) == 100
    assert len(stage._held._places) <= 200


def test_a_position_too_far_to_tell_neighbours_stops_the_detector_with_its_reason(make_stage, make_radar, make_block):
    stage = make_stage("dbscan", every=1)
    stage.open(make_radar())
    block = make_block(np.ones((2, 4)), detections=Detections([0, 1], x_m=[0.0, 1e200], y_m=[0.0, 0.0]))
    with pytest.raises(ValueError, match="too far to resolve neighbours"):
        stage.step(block)


def test_clustering_does_not_wait_for_scikit_learn_to_load():
    program = (
        "import sys; from uwbbench_detectors.clusters.dbscan import Dbscan, DbscanParams\n"
        "assert 'numba' not in sys.modules\n"
        "Dbscan(DbscanParams()).open(None)\n"
        "assert 'sklearn' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
