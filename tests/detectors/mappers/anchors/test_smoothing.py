"""Looking at a whole run again, with landmarks that are known or found to be one."""

from collections.abc import Sequence

import numpy as np
import pytest

from uwbbench.api import ConfigError, FloatArray, compose
from uwbbench_detectors.mappers.logbook import Logbook
from uwbbench_detectors.mappers.motion import MotionParams
from uwbbench_detectors.mappers.point import PointModel
from uwbbench_detectors.mappers.smoothing import Solution, close_loops, load_gtsam, smooth

POINTS_M = np.array([[0.6, 1.4], [2.6, 0.6], [2.4, 2.6], [-0.4, 3.0], [1.0, 5.0]])
NOISE = np.diag([0.03**2, np.radians(3.0) ** 2])
MOTION = MotionParams(along_sd_m=0.02, across_sd_m=0.02)
STEPS = 126
needs_gtsam = pytest.mark.usefixtures("gtsam")


@pytest.fixture
def gtsam() -> None:
    pytest.importorskip("gtsam", reason="gtsam is not installed: pip install 'uwbbench[slam]'")


def circle() -> FloatArray:
    """Movements of two rounds on a circle of 2 m radius, nothing in the first step."""
    moved = np.tile([0.2, 0.0, 0.1], (STEPS, 1))
    moved[0] = 0
    return moved


def poses_after(moved: FloatArray) -> FloatArray:
    poses = [np.zeros(3)]
    for step in moved[1:]:
        poses.append(compose(poses[-1], step))
    return np.array(poses)


def driven(
    stretch: float = 1.0, turn: float = 1.0, error: float = 0.0, every: int = 3, names: Sequence[int] = range(5)
) -> tuple[Logbook, dict[int, int]]:
    """A log of the two rounds, with points that are in view seen every few steps; ``names``: who is who after 60 steps.

    Returns
    -------
    Logbook
    dict of int to int
        Handles of the points by name.
    """
    rng = np.random.default_rng(3)
    moved, truth = circle(), poses_after(circle())
    book, handles = Logbook(np.zeros(3), MOTION), dict[int, int]()
    for index, step in enumerate(moved):
        book.begin_step(index)
        book.predict(step * [stretch, stretch, turn])
        measured, _, _ = PointModel().expected(truth[index], POINTS_M)
        measured = measured + error * np.sqrt(np.diag(NOISE)) * rng.standard_normal(measured.shape)
        for point in range(5) if index % every == 0 else ():
            if measured[point, 0] > 3.0:
                continue
            name = point if index < 60 else names[point]
            if name in handles:
                book.update(PointModel(), handles[name], measured[point], NOISE)
            else:
                handles[name] = book.add(PointModel(), measured[point], NOISE)
    return book, handles


def solved(book: Logbook, handles: dict[int, int], close: float = 9.21) -> tuple[Solution, FloatArray]:
    """Solution and which landmark each is."""
    known = np.array(sorted(handles.values()))
    places = np.array([book.place(int(handle)) for handle in known]).reshape(-1, 2)
    return close_loops(book.close(known, places, 1.345), close)


def off(poses: FloatArray) -> float:
    """Root mean square distance from the true positions."""
    return float(np.sqrt(np.mean(np.sum((poses - poses_after(circle()))[:, :2] ** 2, axis=1))))


@needs_gtsam
def test_run_without_errors_is_smoothed_to_itself() -> None:
    book, handles = driven()
    solution, _ = solved(book, handles)
    smoothed = book.trajectory(solution)
    np.testing.assert_array_equal(smoothed.index, np.arange(STEPS))
    assert off(smoothed.pose) < 1e-6
    np.testing.assert_allclose(solution.landmarks, POINTS_M, atol=1e-6)


@needs_gtsam
def test_scale_errors_of_odometry_are_found_and_taken_out_of_every_step() -> None:
    book, handles = driven(stretch=0.96, turn=1.03)
    raw = off(poses_after(circle() * [0.96, 0.96, 1.03]))
    solution, _ = solved(book, handles)
    np.testing.assert_allclose(solution.scales, [1 / 0.96 - 1, 1 / 1.03 - 1], atol=2e-3)
    assert off(book.trajectory(solution).pose) < 0.02 * raw


@needs_gtsam
def test_smoothing_leaves_less_error_than_the_filter_had_on_the_way() -> None:
    book, handles = driven(stretch=0.96, turn=1.03, error=1.0)
    filtered = np.array(book._nodes)
    solution, _ = solved(book, handles)
    smoothed = book.trajectory(solution).pose
    nodes = np.arange(0, STEPS - 1, 3)
    assert np.sum((smoothed - poses_after(circle()))[nodes, :2] ** 2) < 0.5 * np.sum(
        (filtered[: len(nodes)] - poses_after(circle())[nodes])[:, :2] ** 2
    )


@needs_gtsam
def test_landmarks_that_lie_on_each_other_become_one_and_close_the_loop() -> None:
    book, handles = driven(error=1.0, names=[5, 6, 7, 8, 9])
    assert len(handles) == 10
    apart, _ = solved(*driven(error=1.0, names=[5, 6, 7, 8, 9]), close=0.0)
    closed, became = solved(book, handles)
    names = sorted(handles, key=lambda name: handles[name])
    assert [became[names.index(name)] for name in range(5)] == [became[names.index(name + 5)] for name in range(5)]
    assert np.trace(closed.covariance[-1]) < 0.5 * np.trace(apart.covariance[-1])


@needs_gtsam
def test_landmarks_seen_from_one_pose_stay_two() -> None:
    book, handles = driven()
    _, became = solved(book, handles, close=1e9)
    names = sorted(handles, key=lambda name: handles[name])
    assert became[names.index(0)] != became[names.index(1)]


@needs_gtsam
def test_one_sighting_far_off_moves_little() -> None:
    book, handles = driven(error=1.0)
    book.begin_step(STEPS)
    book.predict(np.array([0.2, 0.0, 0.1]))
    book.update(PointModel(), handles[0], np.array([1.0, 2.0]), NOISE)
    clean, _ = solved(*driven(error=1.0))
    struck, _ = solved(book, handles)
    np.testing.assert_allclose(struck.landmarks, clean.landmarks, atol=0.02)


@needs_gtsam
def test_without_landmarks_the_smoothed_run_is_odometry() -> None:
    book = Logbook(np.array([1.0, 2.0, 3.0]), MOTION)
    for index, step in enumerate(circle()):
        book.begin_step(index)
        book.predict(step)
    solution = smooth(book.close(np.zeros(0, np.int64), np.zeros((0, 2)), 1.345))
    smoothed = book.trajectory(solution)
    pose = np.array([1.0, 2.0, 3.0])
    for index, step in enumerate(circle()):
        pose = compose(pose, step)
        np.testing.assert_allclose(smoothed.pose[index], pose, atol=1e-6)


@needs_gtsam
def test_run_that_stands_still_is_smoothed() -> None:
    book = Logbook(np.zeros(3), MOTION)
    handle = book.add(PointModel(), np.array([1.0, 0.2]), NOISE)
    for index in range(5):
        book.begin_step(index)
        book.predict(np.zeros(3))
        book.update(PointModel(), handle, np.array([1.0, 0.2]), NOISE)
    solution = smooth(book.close(np.array([handle]), book.place(handle)[None], 1.345))
    np.testing.assert_allclose(book.trajectory(solution).pose, 0, atol=1e-4)


@needs_gtsam
def test_smoothing_twice_gives_the_same_bits() -> None:
    first, second = (solved(*driven(error=1.0))[0] for _ in range(2))
    for name in ("poses", "covariance", "landmarks", "joint", "scales"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_missing_gtsam_is_said_with_the_extra_that_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "gtsam", None)
    with pytest.raises(ConfigError, match=r"gtsam, which is not installed: pip install 'uwbbench\[slam\]'"):
        load_gtsam()
