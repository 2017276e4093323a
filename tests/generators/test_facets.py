"""The generator of facets, against the limits that physical optics has, images, and plain sums."""

from dataclasses import replace

import numpy as np
import pytest

from tests.generators.driving import encoders, steered
from tests.generators.facet_rooms import CREST, TAP_S, drawn, spectrum
from tests.generators.facets import BASEBAND_HZ, Ways, bounced, cut, hidden, image, polygon, scattered, transfer
from uwbbench.api import SPEED_OF_LIGHT_M_S

WAVE_M = 0.04


def plate(width_m: float, rough_m: float = 0.0):
    """A thin plate whose front looks from x = 0 towards -x, 10 m high and of metal."""
    half = width_m / 2
    outline = np.array([[0, half], [0, -half], [0.001, -half], [0.001, half]])
    facets = cut(outline, 1.0, 0, rough_m, np.random.default_rng(0))
    front = facets.some(np.flatnonzero(facets.normal[:, 0] < -0.5))
    return replace(front, strength=np.ones(len(front.body)), height_m=np.full(len(front.body), 10.0))


def summed(ways: Ways) -> np.ndarray:
    """Strength (frames,) of all ways together."""
    return np.sum(ways.strength * np.exp(-2j * np.pi * ways.length_m / WAVE_M), axis=1)


def test_a_wide_smooth_plate_is_a_mirror() -> None:
    away = np.array([[-2.0, 0.0], [-3.0, 0.0]])
    level = np.abs(summed(scattered(plate(3.0), away, away, WAVE_M)))
    assert level == pytest.approx(WAVE_M / (8 * np.pi * np.array([2.0, 3.0])), rel=0.15)


def test_a_small_plate_far_away_follows_the_sinc_of_its_tilt() -> None:
    away, angle = 60.0, np.array([0.0, 0.02, 0.035, 0.05])
    place = -away * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    level = np.abs(summed(scattered(plate(0.3), place, place, WAVE_M)))
    expected = np.abs(np.sinc(2 * 0.3 * np.sin(angle) / WAVE_M))
    assert level / level[0] == pytest.approx(expected, abs=0.02)


def test_a_rough_plate_sends_power_where_a_smooth_one_does_not() -> None:
    askew = np.array([[-2.0, 1.5]])
    smooth, rough = (np.abs(summed(scattered(plate(1.0, r), askew, askew, WAVE_M)))[0] for r in (0.0, 6e-3))
    assert rough > 3 * smooth


@pytest.mark.parametrize("double", [False, True])
def test_exchanging_the_antennas_changes_nothing(double: bool) -> None:
    rng = np.random.default_rng(3)
    near = cut(polygon("box", rng), 1.0, 0, 3e-3, rng)
    far = cut(polygon("many", rng) + np.array([1.5, 1.0]), 0.5, 1, 3e-3, rng)
    out, back = np.array([[0.2, 2.0]]), np.array([[-0.1, 2.3]])
    if double:
        one, other = bounced(near, far, out, back, WAVE_M), bounced(far, near, back, out, WAVE_M)
    else:
        one, other = scattered(near, out, back, WAVE_M), scattered(near, back, out, WAVE_M)
    assert summed(one) == pytest.approx(summed(other))
    assert np.abs(summed(one))[0] > 0


def test_a_ghost_is_as_long_as_the_shortest_way_by_the_wall() -> None:
    half, point, antenna = np.array([3.0, 2.0]), np.array([1.0, 0.5]), np.array([-1.0, -0.5])
    for wall, along in ((0, lambda x: [3.0, x]), (1, lambda x: [x, 2.0]), (2, lambda x: [-3.0, x])):
        hits = np.array([along(x) for x in np.linspace(-4, 4, 80_001)])
        shortest = np.min(np.linalg.norm(hits - point, axis=1) + np.linalg.norm(hits - antenna, axis=1))
        assert np.linalg.norm(image(point, wall, half) - antenna) == pytest.approx(shortest, abs=1e-6)


def test_what_stands_in_the_way_hides() -> None:
    square = np.array([[1, -0.2], [1.4, -0.2], [1.4, 0.2], [1, 0.2]])
    behind, beside, before = [2.0, 0.0], [2.0, 1.0], [0.5, 0.0]
    eyes, points = np.array([[0.0, 0.0], [2.0, 2.0]]), np.array([behind, beside, before, [1.2, 0.2]])
    found = hidden(eyes, points, np.array([1, 1, 1, 0]), [square, square + 50])
    assert found.tolist() == [[True, False, False, False], [False, False, False, False]] or (
        found[0].tolist() == [True, False, False, False]
    )


def test_the_sum_over_frequencies_puts_a_way_on_its_tap() -> None:
    late_m = 4.0
    ways = Ways(np.array([[0.2 + late_m]]), np.ones((1, 1), complex), np.zeros((1, 1, 2)))
    shape = spectrum(np.random.default_rng(1))
    for response, expected in ((np.ones(80), CREST), (transfer(ways, np.ones((1, 1)), 0.2)[0], None)):
        tap = np.arange(0, 50, 0.01)
        levels = np.abs((shape * response) @ np.exp(2j * np.pi * BASEBAND_HZ[:, None] * (tap - CREST) * TAP_S))
        late = 0.0 if expected else late_m / SPEED_OF_LIGHT_M_S / TAP_S
        assert tap[np.argmax(levels)] == pytest.approx(CREST + late, abs=0.6)  # its filters bend the phase


def test_ways_later_than_the_sums_period_are_left_out() -> None:
    ways = Ways(np.array([[30.0]]), np.ones((1, 1), complex), np.zeros((1, 1, 2)))
    assert not np.any(transfer(ways, np.ones((1, 1)), 0.2))


def test_the_robot_goes_through_its_points_turns_halts_and_its_odometry_follows() -> None:
    points = np.array([[0.0, 0.0], [1.5, 0.0], [0.2, 1.0], [1.8, 1.2]])
    poses = steered(points, 0.4, np.radians(60), {2: 2.0}, 50.0)
    for point in points:
        assert np.min(np.linalg.norm(poses[:, :2] - point, axis=1)) < 0.1
    step, turn = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1), np.abs(np.diff(poses[:, 2]))
    assert step.max() * 50 < 0.4 + 1e-6
    assert turn.max() * 50 <= np.radians(60) + 0.1
    assert np.sum((step < 1e-9) & (turn < 1e-9)) > 90
    assert np.sum((step < 1e-9) & (turn > 1e-4)) > 25
    believed = encoders(poses, 0, np.random.default_rng(0))
    assert np.linalg.norm(believed[-1, :2] - poses[-1, :2]) < 0.4
    slipped = encoders(poses, 6, np.random.default_rng(0))
    assert np.linalg.norm(slipped[-1] - believed[-1]) > 0.01


@pytest.mark.slow
def test_a_room_keeps_its_robot_clear_of_everything() -> None:
    room = drawn(np.random.default_rng([90210, 1003]))
    gaps = np.linalg.norm(room.poses[:, None, :2] - room.facets.center_m[::4], axis=2)
    assert gaps.min() > 0.35
    assert np.all(np.abs(room.poses[:, :2]) < room.half_m)
