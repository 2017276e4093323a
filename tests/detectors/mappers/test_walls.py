import numpy as np

from uwbbench_detectors.mappers.echoes import Echoes
from uwbbench_detectors.mappers.line import normal
from uwbbench_detectors.mappers.walls import WallParams, find_walls

PARAMS = WallParams()
WALL = np.array([3.0, np.pi / 2])


def noisy(rng, range_m, heading_rad, receiver_m):
    count = len(range_m)
    return Echoes(
        receiver_m,
        range_m + 0.06 * rng.standard_normal(count),
        heading_rad + np.radians(8.0) * rng.standard_normal(count),
    )


def way(per_m=60, length=2.4):
    count = round(per_m * length)
    return np.column_stack([np.linspace(-length, 0, count), np.zeros(count)])


def of_wall(rng, line=WALL, receiver_m=None):
    receiver_m = way() if receiver_m is None else receiver_m
    return noisy(rng, line[0] - receiver_m @ normal(line[1]), np.full(len(receiver_m), line[1]), receiver_m)


def of_point(rng, point_m, receiver_m=None):
    receiver_m = way() if receiver_m is None else receiver_m
    offset = np.asarray(point_m) - receiver_m
    return noisy(rng, np.hypot(*offset.T), np.arctan2(offset[:, 1], offset[:, 0]), receiver_m)


def scattered(rng, count=150):
    return Echoes(rng.choice(way(), count), rng.uniform(1.2, 6.0, count), rng.uniform(-np.pi, np.pi, count))


def test_a_wall_is_found_among_scattered_echoes():
    rng = np.random.default_rng(1)
    walls = find_walls(Echoes.join([scattered(rng), of_wall(rng)]), PARAMS)
    assert len(walls) == 1
    off = (walls[0].line - WALL) @ np.linalg.solve(walls[0].covariance, walls[0].line - WALL)
    assert off < 25.0


def test_two_walls_are_found_apart():
    rng = np.random.default_rng(2)
    other = np.array([2.0, -np.pi / 2])
    walls = find_walls(Echoes.join([of_wall(rng), of_wall(rng, other)]), PARAMS)
    found = sorted(wall.line[1] for wall in walls)
    np.testing.assert_allclose(found, [other[1], WALL[1]], atol=np.radians(4.0))


def test_a_rod_is_no_wall():
    rng = np.random.default_rng(3)
    assert not find_walls(Echoes.join([of_point(rng, (-1.2, 2.0)), scattered(rng)]), PARAMS)


def test_two_rods_side_by_side_are_no_wall():
    rng = np.random.default_rng(4)
    nearest = way()[:, 0] < -1.2
    echoes = [of_point(rng, (-2.0, 1.8), way()[nearest]), of_point(rng, (-0.2, 1.8), way()[~nearest])]
    assert not find_walls(Echoes.join(echoes), PARAMS)


def test_driving_straight_towards_something_says_not_that_it_is_a_wall():
    rng = np.random.default_rng(5)
    assert not find_walls(of_wall(rng, np.array([3.0, 0.0])), PARAMS)


def test_no_echoes_make_no_wall():
    assert find_walls(Echoes.none(), PARAMS) == []


def test_the_same_echoes_make_the_same_walls():
    echoes = Echoes.join([scattered(np.random.default_rng(6)), of_wall(np.random.default_rng(7))])
    one, other = find_walls(echoes, PARAMS), find_walls(echoes, PARAMS)
    assert [wall.line.tobytes() for wall in one] == [wall.line.tobytes() for wall in other]
