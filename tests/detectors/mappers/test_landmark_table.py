import numpy as np
import pytest

from uwbbench_detectors.mappers import images
from uwbbench_detectors.mappers.landmark_table import AA, AB, BB, HIGH, LOW, POINT, SUPPORT, WALL, A, B, LandmarkTable

EAR, MOUTH, UP = np.array([0.3, 0.4]), np.array([0.1, -0.2]), np.array([0.0, 1.0])


@pytest.mark.parametrize(("of", "place"), [(images.of_wall, (2.5, 0.4)), (images.of_point, (1.5, -2.0))])
def test_derivatives_are_those_of_finite_differences(of, place):
    step = 1e-6
    found = of(EAR, MOUTH, *map(np.array, place))
    for k in range(2):
        h = step * np.eye(2)[k]
        ahead, behind = of(EAR, MOUTH, *(place + h))[0], of(EAR, MOUTH, *(place - h))[0]
        assert found[1 + k] == pytest.approx((ahead - behind) / (2 * step), abs=1e-8)


def test_an_echo_of_a_wall_comes_from_the_image_by_way_of_its_foot():
    rho, alpha = 2.5, 0.4
    normal, across = np.array([np.cos(alpha), np.sin(alpha)]), np.array([-np.sin(alpha), np.cos(alpha)])
    image = MOUTH + 2 * (rho - normal @ MOUTH) * normal
    half = images.of_wall(EAR, MOUTH, np.array(rho), np.array(alpha))[0]
    assert half == pytest.approx(np.linalg.norm(image - EAR) / 2, abs=1e-12)
    foot = rho * normal + images.foot_along(EAR, MOUTH, np.array(rho), np.array(alpha)) * across
    assert np.linalg.norm(foot - EAR) + np.linalg.norm(foot - MOUTH) == pytest.approx(2 * half, abs=1e-12)


def test_a_wall_is_not_heard_from_behind():
    assert np.isnan(images.of_wall(EAR, MOUTH, np.array(0.2), np.array(0.0))[0])


def planes(particles, a, b, low=0.0, high=1.0):
    made = np.zeros((8, particles))
    made[[A, B, AA, BB, LOW, HIGH, SUPPORT]] = np.array([a, b, 0.04, 0.01, low, high, 5.0])[:, None]
    return made


def test_one_particle_is_a_kalman_filter_of_its_landmark():
    table = LandmarkTable(1)
    table.add(WALL, planes(1, 2.4, 0.35))
    mean, covariance, rng = np.array([2.4, 0.35]), np.diag([0.04, 0.01]), np.random.default_rng(1)
    one = np.zeros(1, np.int64)
    for step in range(30):
        ear, mouth = EAR + 0.1 * step * UP, MOUTH + 0.1 * step * UP
        half = images.of_wall(ear, mouth, np.array(2.5), np.array(0.4))[0] + 0.05 * rng.standard_normal()
        expected = table.expected(one, ear[:, None], mouth[:, None])
        table.correct(one, one, half - expected[0, :, 0], expected[1:, :, 0], 0.05**2)

        path, *slopes = images.of_wall(ear, mouth, *mean)
        gain = covariance @ slopes / (slopes @ covariance @ np.array(slopes) + 0.05**2)
        mean, covariance = mean + gain * (half - path), covariance - np.outer(gain, slopes @ covariance)
    np.testing.assert_allclose(table.planes[[A, B], 0, 0], mean, atol=1e-12)
    np.testing.assert_allclose(table.planes[[AA, AB, BB], 0, 0], covariance[[0, 0, 1], [0, 1, 1]], atol=1e-14)
    assert table.planes[SUPPORT, 0, 0] == 35


def test_walls_that_are_one_are_merged_and_others_are_not():
    table = LandmarkTable(3)
    table.add(WALL, planes(3, 2.5, 0.0, -1, 0))
    table.add(WALL, planes(3, 2.0, np.pi / 2))
    assert table.twins(0, 0.2, np.radians(5)) is None
    table.add(WALL, planes(3, 2.6, 2 * np.pi + 0.02, 1, 2))
    assert table.twins(0, 0.2, np.radians(5)) == (0, 2)
    squared = table.merge(0, 2, (0.0, 0.0))
    assert len(table) == 2
    np.testing.assert_allclose(table.planes[[A, B, AA, LOW, HIGH, SUPPORT], 0, 0], [2.55, 0.01, 0.02, -1, 2, 10])
    np.testing.assert_allclose(squared, 0.1**2 / 0.08 + 0.02**2 / 0.02)


def test_only_what_is_near_is_asked():
    table = LandmarkTable(1)
    table.add(WALL, planes(1, 3.0, 0.0, -1, 1))
    table.add(WALL, planes(1, 3.0, 0.0, 8, 9))
    table.add(WALL, planes(1, 9.0, 0.0, -1, 1))
    table.add(POINT, planes(1, 3.0, 0.0))
    table.add(POINT, planes(1, 3.0, 7.0))
    assert table.near(np.zeros(3), 0, 5.0, 2.0).tolist() == [0, 3]
