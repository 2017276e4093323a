import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from sklearn.cluster import DBSCAN

from uwbbench.api import Block, Detections


def scene(seed, points, objects=3, share_noise=0.3):
    """Points (n, 2) around a few objects, with noise among them, in random order."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(0, 4, (objects, 2))
    clustered = centres[rng.integers(objects, size=points)] + rng.normal(0, 0.08, (points, 2))
    noise = rng.uniform(0, 4, (points, 2))
    return np.where(rng.uniform(size=points)[:, None] < share_noise, noise, clustered)


@pytest.fixture(scope="module")
def block_of(make_block):
    """A block with one detection a frame; ``amplitude`` counts them."""

    def block(points_m):
        frames = np.arange(len(points_m))
        columns = {"x_m": points_m[:, 0], "y_m": points_m[:, 1], "amplitude": frames}
        return make_block(np.ones((len(points_m), 50)), detections=Detections(frames, **columns))

    return block


@pytest.fixture(scope="module")
def clustered(make_stage, run_stage, make_radar, block_of):
    """Detections of a scene after clustering, handed over as one block."""

    def found(points_m, **params):
        return run_stage(make_stage("dbscan", **params), make_radar(), block_of(points_m)).detections

    return found


def by_arrival(found: Detections) -> np.ndarray:
    return found["cluster"][np.argsort(found["amplitude"])]


@given(
    seed=st.integers(0, 10_000), points=st.integers(0, 160), min_samples=st.integers(1, 12), every=st.integers(1, 60)
)
@settings(max_examples=40, deadline=None)
def test_over_all_points_the_clustered_ones_are_those_of_a_single_clustering(
    clustered, seed, points, min_samples, every
):
    points_m = scene(seed, points)
    found = clustered(points_m, min_samples=min_samples, every=every)
    assert sorted(found["amplitude"]) == list(range(points))
    if points:
        oracle = DBSCAN(eps=0.2, min_samples=min_samples, algorithm="kd_tree").fit(points_m - points_m[0])
        np.testing.assert_array_equal(by_arrival(found) >= 0, oracle.labels_ >= 0)


@pytest.mark.parametrize(("when", "releases"), [("reached", [6, 13]), ("exceeded", [7, 15])])
def test_clustering_starts_with_the_last_new_point_or_with_the_one_after(
    make_stage, make_radar, block_of, when, releases
):
    stage = make_stage("dbscan", every=7, min_samples=3, when=when)
    steps, _ = one_at_a_time(stage, make_radar(), block_of(np.zeros((16, 2))))
    assert [frame for frame, step in enumerate(steps) if len(step)] == releases


@given(seed=st.integers(0, 10_000), points=st.integers(1, 160), every=st.integers(1, 60))
@settings(max_examples=30, deadline=None)
def test_final_labels_are_those_of_a_single_clustering_in_order_of_arrival(clustered, seed, points, every):
    points_m = scene(seed, points)
    found = clustered(points_m, min_samples=5, every=every, labels="final")
    oracle = DBSCAN(eps=0.2, min_samples=5, algorithm="kd_tree").fit(points_m - points_m[0])
    np.testing.assert_array_equal(found["cluster"], oracle.labels_)
    np.testing.assert_array_equal(found["amplitude"], np.arange(points))


@given(
    seed=st.integers(0, 10_000),
    params=st.sampled_from(
        [
            {"every": 7},
            {"every": 50, "min_samples": 8},
            {"every": 10, "window": 20, "min_samples": 4},
            {"labels": "final", "min_samples": 5},
        ]
    ),
    cuts=st.lists(st.integers(0, 130), max_size=8),
)
@settings(max_examples=40, deadline=None)
def test_blocks_do_not_matter(run_cut, make_radar, block_of, seed, params, cuts):
    points_m = scene(seed, 130)
    points_m[::9] = np.nan
    run_cut("dbscan", params, make_radar(), block_of(points_m), cuts)


def one_at_a_time(stage, radar, block):
    """Detections that each frame releases, and those of the flush."""
    stage.open(radar)
    steps = []
    for frame in range(len(block.frames)):
        part = block.detections.take(block.detections.frame == frame)
        steps.append(stage.step(Block(block.frames.part(frame, frame + 1), detections=part)).detections)
    return steps, stage.flush().detections


def test_a_cluster_comes_out_with_the_point_that_completes_a_round_and_noise_at_the_end(
    make_stage, make_radar, block_of
):
    points_m = np.zeros((25, 2))
    points_m[3] = (50.0, 50.0)
    stage = make_stage("dbscan", every=10, min_samples=5)
    steps, tail = one_at_a_time(stage, make_radar(), block_of(points_m))
    released = {frame: found["amplitude"].tolist() for frame, found in enumerate(steps) if len(found)}
    assert released == {9: [0, 1, 2, 4, 5, 6, 7, 8, 9], 19: list(range(10, 20))}
    assert tail["amplitude"].tolist() == [20, 21, 22, 23, 24, 3]
    assert tail["cluster"].tolist() == [0, 0, 0, 0, 0, -1]


def test_points_without_position_come_out_at_once_and_do_not_count(make_stage, make_radar, block_of):
    points_m = np.zeros((10, 2))
    points_m[[2, 5, 9], 1] = np.nan
    steps, tail = one_at_a_time(make_stage("dbscan", every=7, min_samples=3), make_radar(), block_of(points_m))
    assert [len(found) for found in steps] == [0, 0, 1, 0, 0, 1, 0, 0, 7, 1]
    assert [steps[frame]["cluster"].tolist() for frame in (2, 5, 9)] == [[-1]] * 3
    assert len(tail) == 0


def test_a_cluster_keeps_its_number_and_merging_clusters_take_the_smaller(clustered):
    west, east = np.zeros((5, 2)), np.tile([0.5, 0.0], (5, 1))
    bridge = np.stack([np.linspace(0.1, 0.4, 10), np.zeros(10)], axis=1)
    rounds = [east, west, east, bridge, west, east]
    points_m = np.concatenate([np.concatenate([part, part]) if len(part) == 5 else part for part in rounds])
    found = clustered(points_m, every=10, min_samples=5)
    assert found["amplitude"].tolist() == list(range(60))
    assert [set(part.tolist()) for part in found["cluster"].reshape(6, 10)] == [{0}, {1}, {0}, {0}, {0}, {0}]


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_growing_scene_never_gives_one_number_to_two_clusters_of_the_end(clustered, seed):
    points_m = scene(seed, 150, objects=6)
    numbers = by_arrival(clustered(points_m, every=10, min_samples=5))
    model = DBSCAN(eps=0.2, min_samples=5, algorithm="kd_tree").fit(points_m - points_m[0])
    core = np.zeros(150, bool)
    core[model.core_sample_indices_] = True
    owners = {}
    for number, label in zip(numbers[core].tolist(), model.labels_[core].tolist(), strict=True):
        # A point that was a border of one cluster first and core of it later stays there: core points tell clusters.
        assert owners.setdefault(number, label) == label


def test_a_point_that_leaves_the_window_as_noise_comes_out_as_noise(make_stage, make_radar, block_of):
    points_m = np.zeros((40, 2))
    points_m[:, 0] = 10.0 * np.arange(40)
    stage = make_stage("dbscan", every=5, window=10, min_samples=2)
    steps, tail = one_at_a_time(stage, make_radar(), block_of(points_m))
    released = {frame: found["amplitude"].tolist() for frame, found in enumerate(steps) if len(found)}
    assert released == {end: list(range(end - 14, end - 9)) for end in range(14, 40, 5)}
    assert tail["amplitude"].tolist() == list(range(30, 40))
    assert all((found["cluster"] == -1).all() for found in [*steps, tail])


def test_a_cluster_split_by_the_window_gets_a_second_number(clustered):
    west, east = np.zeros((10, 2)), np.tile([0.5, 0.0], (10, 1))
    bridge = np.stack([np.linspace(0.1, 0.4, 10), np.zeros(10)], axis=1)
    found = clustered(np.concatenate([bridge, west, east, west, east]), every=10, window=30, min_samples=5)
    last_west, last_east = by_arrival(found)[30:40], by_arrival(found)[40:50]
    assert set(last_west) != set(last_east)
    assert len(set(last_west)) == len(set(last_east)) == 1


@given(seed=st.integers(0, 10_000))
@settings(max_examples=10, deadline=None)
def test_map_coordinates_give_the_same_clusters(clustered, seed):
    points_m = np.round(scene(seed, 80) * 1024) / 1024  # exact in binary, also after the shift
    far_m = points_m + np.array([500_000.0, 5_600_000.0])
    np.testing.assert_array_equal(
        clustered(far_m, min_samples=5)["cluster"], clustered(points_m, min_samples=5)["cluster"]
    )


def test_nothing_in_nothing_out(clustered):
    assert len(clustered(np.empty((0, 2)))) == 0
    assert clustered(np.full((3, 2), np.nan))["cluster"].tolist() == [-1, -1, -1]
    assert clustered(np.full((3, 2), np.nan), labels="final")["cluster"].tolist() == [-1, -1, -1]


def test_noise_of_the_papers_density_makes_no_cluster(clustered):
    points_m = np.random.default_rng(3).uniform(0, 6, (200, 2))
    assert (clustered(points_m)["cluster"] == -1).all()


@pytest.mark.parametrize(
    "params",
    [
        {"window": 100, "labels": "final"},
        {"window": 10, "every": 50},
        {"window": 10, "every": 5, "min_samples": 20},
        {"eps_m": 0.0},
        {"every": 0},
    ],
)
def test_settings_that_cannot_work_are_refused(make_stage, params):
    with pytest.raises(ValidationError):
        make_stage("dbscan", **params)
