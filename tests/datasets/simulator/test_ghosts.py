import numpy as np
import pytest

from uwbbench.api import SPEED_OF_LIGHT_M_S
from uwbbench_datasets.simulator.materials import reflection

SIDE_WALL = {
    "id": "w",
    "shape": "wall",
    "center_m": [1.5, 1.05],
    "yaw_deg": -90,
    "width_m": 6.0,
    "material": "concrete",
}
"""Its front stands at y = 1 m and looks towards -y."""
POST = {"id": "post", "shape": "point", "center_m": [2.0, 0.2]}
PLATE = {"id": "plate", "shape": "plate", "center_m": [0.801, 0.0], "yaw_deg": 180, "width_m": 0.25, "height_m": 0.28}


def brute_force(view, tx, rx, target, wall_y):
    """Lengths of both ways by searching the point of the wall that makes each shortest (Fermat)."""
    along = np.linspace(-2, 5, 700_001)
    hits = np.column_stack([along, np.full_like(along, wall_y), np.zeros_like(along)])
    legs = np.linalg.norm(hits - target, axis=1)
    return (
        np.linalg.norm(target - tx) + np.min(legs + np.linalg.norm(hits - rx, axis=1)),
        np.linalg.norm(target - rx) + np.min(legs + np.linalg.norm(hits - tx, axis=1)),
    )


def test_ghosts_in_a_wall_take_the_shortest_way_by_it(make_view, make_term, rng):
    view = make_view([[0.0, 0.0], [0.7, -0.3]], [POST, SIDE_WALL])
    paths = make_term("ghost.wall").paths(view, rng)
    for frame in range(2):
        expected = brute_force(
            view, view.transmitter_m[frame], view.receiver_m[frame], np.array([2.0, 0.2, 0.0]), wall_y=1.0
        )
        assert paths.delay_s[frame, :2] * SPEED_OF_LIGHT_M_S + 0.25 == pytest.approx(expected, abs=1e-9)


def test_one_ghost_shows_in_the_wall_and_the_other_at_the_target(make_view, make_term, rng):
    paths = make_term("ghost.wall").paths(make_view([[0.0, 0.0]], [POST, SIDE_WALL]), rng)
    assert paths.azimuth_rad[0, :2] == pytest.approx([np.arctan2(1.8, 2.0), np.arctan2(0.2, 2.0)])


def test_ghost_is_as_much_weaker_as_wall_and_way_make_it(make_view, make_term, rng):
    view = make_view([[0.0, 0.0]], [POST, SIDE_WALL])
    echo = np.abs(make_term("echo.point").paths(view, rng).amplitude[0, 0])
    direct = np.linalg.norm(view.transmitter_m[0] - [2.0, 0.2, 0]) + np.hypot(2.0, 0.2)
    for loss_db in (0.0, 6.0):
        paths = make_term("ghost.wall", loss_db=loss_db).paths(view, rng)
        length = paths.delay_s[0, :2] * SPEED_OF_LIGHT_M_S + 0.25
        wall = abs(reflection("concrete", view.radar.center_frequency_hz)) * 10 ** (-loss_db / 20)
        assert np.abs(paths.amplitude[0, :2]) == pytest.approx(echo * wall * direct / length)
        assert not np.any(paths.amplitude[0, 2:])  # nothing by way of the wall's back


@pytest.mark.parametrize(
    "wall",
    [
        {**SIDE_WALL, "center_m": [1.5, 0.15]},  # between radar and target
        {**SIDE_WALL, "center_m": [8.0, 1.05]},  # too far along for the reflection to fall on it
    ],
)
def test_no_ghost_where_the_reflection_misses_the_wall(make_view, make_term, rng, wall):
    paths = make_term("ghost.wall").paths(make_view([[0.0, 0.0]], [POST, wall]), rng)
    assert not np.any(paths.amplitude)


def test_second_echo_flies_between_target_and_robot_twice(make_view, make_term, rng):
    paths = make_term("ghost.robot").paths(make_view([[0.0, 0.0]], [PLATE], tx=(0.0, 0.0, 0.1)), rng)
    assert paths.delay_s[0] * SPEED_OF_LIGHT_M_S + 0.1 == pytest.approx([np.hypot(0.8, 0.1) + 3 * 0.8])
    assert paths.azimuth_rad[0] == pytest.approx([0.0])


def test_second_echo_of_a_large_mirror_is_the_radar_equation_of_the_robots_image(make_view, make_term, rng):
    mirror = {**PLATE, "width_m": 50.0, "height_m": 50.0}
    view = make_view([[0.0, 0.0]], [mirror], tx=(0.0, 0.0, 0.01))
    paths = make_term("ghost.robot", rcs_m2=0.2).paths(view, rng)
    legs = 2 * 0.8
    expected = view.radar.wavelength_m * np.sqrt(0.2) / ((4 * np.pi) ** 1.5 * legs**2)
    assert np.abs(paths.amplitude[0]) == pytest.approx([expected], rel=0.05)


def test_second_echo_matters_for_near_metal_only(make_view, make_term, rng):
    def level_db(x, material):
        view = make_view([[0.8 - x, 0.0]], [{**PLATE, "material": material}])
        ghost = np.abs(make_term("ghost.robot").paths(view, rng).amplitude).max()
        return 20 * np.log10(ghost / np.abs(make_term("echo.plate").paths(view, rng).amplitude).max())

    assert level_db(0.5, "metal") > level_db(1.0, "metal") > level_db(2.0, "metal")
    assert level_db(0.5, "metal") - level_db(0.5, "concrete") == pytest.approx(8.1 + 6.0, abs=0.1)


def test_a_third_ghost_goes_out_and_back_by_the_wall(make_view, make_term, rng):
    view = make_view([[0.0, 0.0]], [POST, SIDE_WALL])
    paths = make_term("ghost.wall", twice=True).paths(view, rng)
    image = np.array([2.0, 1.8, 0.0])
    legs = np.linalg.norm(image - view.transmitter_m[0]) + np.linalg.norm(image - view.receiver_m[0])
    assert paths.delay_s[0, 2] * SPEED_OF_LIGHT_M_S + 0.25 == pytest.approx(legs)
    assert paths.azimuth_rad[0, 2] == pytest.approx(np.arctan2(1.8, 2.0))
    echo = np.abs(make_term("echo.point").paths(view, rng).amplitude[0, 0])
    direct = np.linalg.norm(view.transmitter_m[0] - [2.0, 0.2, 0]) + np.hypot(2.0, 0.2)
    wall = abs(reflection("concrete", view.radar.center_frequency_hz))
    assert np.abs(paths.amplitude[0, 2]) == pytest.approx(echo * wall**2 * direct / legs)
    assert np.array_equal(paths.amplitude[:, :2], make_term("ghost.wall").paths(view, rng).amplitude[:, :2])


@pytest.mark.parametrize(("name", "params"), [("ghost.wall", {}), ("ghost.wall", {"twice": True}), ("ghost.robot", {})])
def test_bound_holds_in_every_frame(make_view, make_term, rng, name, params):
    rod = {"id": "rod", "shape": "rod", "center_m": [1.0, 0.5], "radius_m": 0.05, "height_m": 1.0}
    track = np.column_stack([np.linspace(-1, 0.7, 100), rng.uniform(-1, 0.9, 100)])
    view = make_view(track, [POST, PLATE, rod, SIDE_WALL], yaw_rad=rng.uniform(-3, 3, 100))
    view = make_term("antenna").prepare(view, rng)
    term = make_term(name, **params)
    assert 0 < np.max(np.sum(np.abs(term.paths(view, rng).amplitude), axis=1)) <= term.bound(view)


def test_hidden_targets_have_no_ghosts(make_view, make_term, rng):
    view = make_view([[0.0, 0.0]], [POST, SIDE_WALL])
    hidden = view.replace(visibility=np.array([[0.0, 1.0]]))
    for name in ("ghost.wall", "ghost.robot"):
        assert not np.any(make_term(name).paths(hidden, rng).amplitude)
