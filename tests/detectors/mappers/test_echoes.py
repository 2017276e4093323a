import numpy as np
import pytest

from uwbbench_detectors.mappers.echoes import Echoes, Spread, fit_line, fit_point
from uwbbench_detectors.mappers.line import normal

SPREAD = Spread(0.08, np.radians(9.0))
NONE = Spread(0.0, 0.0)
LINE = np.array([3.0, 2.9])


def echoes_of(line, receiver_m, farther_m=0.0, leftward=0.0):
    range_m = line[0] - receiver_m @ normal(line[1]) + farther_m
    return Echoes(receiver_m, range_m, np.full(len(receiver_m), line[1]) + leftward)


def way(count=40, length=1.2):
    return np.column_stack([np.linspace(0, length, count), 0.1 * np.sin(np.arange(count))])


def test_without_errors_the_line_is_that_of_a_singular_value_decomposition():
    echoes = echoes_of(LINE, way())
    line, _ = fit_line(echoes, SPREAD, NONE, LINE + np.array([0.3, -0.2]))
    feet = echoes.place_m
    _, _, rows = np.linalg.svd(feet - feet.mean(axis=0))
    across = rows[1] * np.sign(rows[1] @ feet.mean(axis=0))
    np.testing.assert_allclose([line[0] * normal(line[1])], [(across @ feet.mean(axis=0)) * across], atol=1e-9)


def test_ranges_alone_are_fitted_as_least_squares_fits_them():
    rng = np.random.default_rng(1)
    receiver_m = way()
    echoes = echoes_of(np.array([3.0, 1.6]), receiver_m, 0.01 * rng.standard_normal(40), rng.uniform(-1, 1, 40))
    line, _ = fit_line(echoes, Spread(0.01, 1e4), NONE, np.array([3.0, 1.5]))
    # range = rho - x cos(alpha) - y sin(alpha) with a cosine and a sine that are free to be no pair
    matrix = np.column_stack([np.ones(40), -receiver_m])
    free, *_ = np.linalg.lstsq(matrix, echoes.range_m, rcond=None)
    misfit = echoes.range_m - matrix @ np.concatenate([line[:1], normal(line[1])])
    least = echoes.range_m - matrix @ free
    gradient = matrix.T @ misfit
    tangent = np.array([0.0, -np.sin(line[1]), np.cos(line[1])])
    assert abs(gradient[0]) < 1e-9
    assert abs(gradient @ tangent) < 1e-9
    assert least @ least <= misfit @ misfit


@pytest.mark.parametrize("shared", [NONE, Spread(0.04, np.radians(4.0))])
def test_the_covariance_is_that_of_many_repetitions(shared):
    rng = np.random.default_rng(2)
    receiver_m = way(30)

    def drawn():
        own, common = rng.standard_normal((2, 30)), rng.standard_normal(2)
        farther_m = SPREAD.range_m * own[0] + shared.range_m * common[0]
        leftward = SPREAD.heading_rad * own[1] + shared.heading_rad * common[1]
        return fit_line(echoes_of(LINE, receiver_m, farther_m, leftward), SPREAD, shared, LINE)[0]

    off = np.array([drawn() for _ in range(300)]) - LINE
    _, covariance = fit_line(echoes_of(LINE, receiver_m), SPREAD, shared, LINE)
    np.testing.assert_allclose(off.T @ off / 300, covariance, rtol=0.25)


def test_errors_of_direction_do_not_draw_a_far_wall_nearer():
    rng = np.random.default_rng(3)
    wall = np.array([4.6, np.pi / 2])
    echoes = echoes_of(wall, way(400, 2.4), 0.0, np.radians(10.0) * rng.standard_normal(400))
    line, _ = fit_line(echoes, SPREAD, NONE, wall)
    assert abs(line[0] - 4.6 - 1.2 * (line[1] - wall[1])) < 0.01  # at the middle of the way
    assert np.mean(echoes.place_m[:, 1]) < 4.55  # points are drawn, by 1 - cos


def test_the_point_of_its_own_echoes_is_found():
    point = np.array([0.4, -1.5])
    offset = point - way()
    echoes = Echoes(way(), np.hypot(*offset.T), np.arctan2(offset[:, 1], offset[:, 0]))
    np.testing.assert_allclose(fit_point(echoes, SPREAD, point + np.array([0.3, 0.2])), point, atol=1e-9)


@pytest.mark.parametrize("pose", [(0.3, -0.4, 2.0), (-5.0, 1.0, -3.0)])
def test_echoes_seen_from_a_pose_come_from_the_same_places(pose):
    echoes = echoes_of(LINE, way())
    own = echoes.seen_from(np.array(pose))
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    back = own.place_m @ np.array([[cosine, sine], [-sine, cosine]]) + pose[:2]
    np.testing.assert_allclose(back, echoes.place_m, atol=1e-12)
