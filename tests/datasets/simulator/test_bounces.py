"""Echoes by way of two bodies: against images, shortest ways and the radar equation leg by leg."""

import numpy as np
import pytest
from scipy.optimize import minimize

from uwbbench.api import SPEED_OF_LIGHT_M_S
from uwbbench_datasets.simulator.materials import reflection
from uwbbench_datasets.simulator.shapes import ObjectModel

ONE = {"id": "one", "shape": "box", "center_m": [2.0, 1.0], "width_m": 0.4, "depth_m": 0.4, "height_m": 0.1}
OTHER = {"id": "other", "shape": "rod", "center_m": [2.0, -1.0], "radius_m": 0.2, "height_m": 0.1}
EAST = {"id": "e", "shape": "wall", "center_m": [3.05, 0.0], "yaw_deg": 180, "width_m": 8.0, "material": "concrete"}
NORTH = {"id": "n", "shape": "wall", "center_m": [0.0, 2.05], "yaw_deg": -90, "width_m": 8.0, "material": "brick"}
CORNER = np.array([3.0, 2.0, 0.0])


@pytest.fixture
def bounces(make_term):
    def build(view, **params):
        term = make_term("bounce.objects", **{"seed": 4, **params})
        term.prepare(view, np.random.default_rng(3))
        return term

    return build


def test_each_bounce_is_the_radar_equation_applied_twice(make_view, bounces):
    view = make_view([[0.0, 0.0], [0.5, 0.3]], [ONE, OTHER])
    term = bounces(view, points=5)
    paths, drawn = term.paths(view, None), term._drawn
    place = {name: drawn[name].offset_m + np.array([2.0, y, 0.0]) for name, y in (("one", 1.0), ("other", -1.0))}

    def cosine(normal, way):
        return max(normal @ way / np.linalg.norm(way), 0.0)

    expected = []
    for first, second in (("one", "other"), ("other", "one")):
        for i in range(5):
            for j in range(5):
                start, end = place[first][i], place[second][j]
                normals = drawn[first].normal[i], drawn[second].normal[j]
                row = []
                for tx, rx in zip(view.transmitter_m, view.receiver_m, strict=True):
                    facing = cosine(normals[0], tx - start) * cosine(normals[0], end - start)
                    facing *= cosine(normals[1], start - end) * cosine(normals[1], rx - end)
                    legs = [np.linalg.norm(way) for way in (start - tx, end - start, rx - end)]
                    root = np.abs(drawn[first].root[i] * drawn[second].root[j] * reflection("metal", 7987.2e6) ** 2)
                    level = view.radar.wavelength_m * root * np.sqrt(facing) / ((4 * np.pi) ** 2 * np.prod(legs))
                    row.append((sum(legs), level, np.arctan2(end[1] - rx[1], end[0] - rx[0])))
                expected.append(row)
    found = np.stack([paths.delay_s * SPEED_OF_LIGHT_M_S + 0.25, np.abs(paths.amplitude), paths.azimuth_rad], axis=2)
    assert found == pytest.approx(np.swapaxes(expected, 0, 1))
    assert np.any(paths.amplitude)


def test_exchanging_the_antennas_exchanges_the_orders(make_view, bounces):
    here = make_view([[0.0, 0.0]], [ONE, OTHER], tx=(0.3, 0.5, 0.0))
    there = here.replace(receiver_m=here.transmitter_m, transmitter_m=here.receiver_m)
    one, other = (bounces(view).paths(view, None) for view in (here, there))
    assert np.sort_complex(one.amplitude[0]) == pytest.approx(np.sort_complex(other.amplitude[0]))
    assert one.amplitude.sum() == pytest.approx(other.amplitude.sum())


def test_a_wall_between_two_objects_keeps_them_from_each_other(make_view, bounces):
    wall = {"id": "w", "shape": "wall", "center_m": [2.0, 0.0], "yaw_deg": 90, "width_m": 1.5}
    free, closed = make_view([[0.0, 0.0]], [ONE, OTHER]), make_view([[0.0, 0.0]], [ONE, OTHER, wall])
    assert np.any(bounces(free).paths(free, None).amplitude)
    assert not np.any(bounces(closed).paths(closed, None).amplitude)


def test_no_bounce_by_a_hidden_object_and_none_of_a_single_one(make_view, bounces):
    view = make_view([[0.0, 0.0]], [ONE, OTHER])
    hidden = view.replace(visibility=np.array([[0.0, 1.0]]))
    assert not np.any(bounces(view).paths(hidden, None).amplitude)
    alone = make_view([[0.0, 0.0]], [ONE])
    assert bounces(alone).paths(alone, None) is None
    assert bounces(alone).bound(alone) == 0


def test_a_bounce_from_an_object_that_moves_has_the_place_of_each_frame(make_view, bounces):
    rods = [{**OTHER, "center_m": place} for place in ([2.0, -1.0], [2.5, -1.5])]
    still = [make_view([[0.0, 0.0]], [ONE, rod]) for rod in rods]
    walk = {**OTHER, "motion": {"kind": "waypoints", "points_m": [rod["center_m"] for rod in rods], "speed_m_s": 50}}
    del walk["center_m"]
    moving = ObjectModel.model_validate(walk).moving(np.array([0.0, 1.0]), np.random.default_rng(0))
    view = make_view([[0.0, 0.0]] * 2, [ONE])
    view = view.replace(objects=(*view.objects, moving), visibility=np.ones((2, 2)))
    paths = bounces(view, points=8).paths(view, None)
    for frame in range(2):
        alone = bounces(still[frame], points=8).paths(still[frame], None)
        assert paths.amplitude[frame] == pytest.approx(alone.amplitude[0])
        assert paths.delay_s[frame] == pytest.approx(alone.delay_s[0])


def shortest_m(view, frame):
    """Length of the shortest way over the wall in the east and then that in the north, by where it meets them."""
    tx, rx = view.transmitter_m[frame], view.receiver_m[frame]

    def length(ends):
        on_east, on_north = np.array([3.0, ends[0], 0.0]), np.array([ends[1], 2.0, 0.0])
        legs = (on_east - tx, on_north - on_east, rx - on_north)
        return sum(np.linalg.norm(leg) for leg in legs)

    return minimize(length, [1.0, 1.0], tol=1e-10).fun


def test_a_corner_sends_back_by_the_shortest_way_over_both_walls(make_view, make_term):
    view = make_view([[0.0, 0.0], [1.5, 1.2]], [EAST, NORTH], tx=(0.3, -0.6, 0.0))
    apart = view.radar.baseline_length_m
    paths = make_term("bounce.walls").paths(view, None)
    for frame in range(2):
        there = np.abs(paths.amplitude[frame]) > 0
        lengths = paths.delay_s[frame, there] * SPEED_OF_LIGHT_M_S + apart
        assert lengths == pytest.approx([shortest_m(view, frame)], abs=1e-6)
        walls = abs(reflection("concrete", 7987.2e6) * reflection("brick", 7987.2e6))
        level = walls * view.radar.wavelength_m / (4 * np.pi * lengths)
        assert np.abs(paths.amplitude[frame, there]) == pytest.approx(level)


def test_with_one_antenna_above_the_other_both_orders_share_the_one_image_of_a_corner(make_view, make_term):
    view = make_view([[0.0, 0.0], [1.5, 1.2]], [EAST, NORTH], tx=(0.0, 0.0, 0.02))
    paths = make_term("bounce.walls").paths(view, None)
    for frame in range(2):
        there = np.abs(paths.amplitude[frame]) > 0
        far = 2 * np.linalg.norm(CORNER - view.receiver_m[frame])
        assert paths.delay_s[frame, there] * SPEED_OF_LIGHT_M_S + 0.02 == pytest.approx([far] * 2, abs=1e-3)
        walls = abs(reflection("concrete", 7987.2e6) * reflection("brick", 7987.2e6))
        level = walls * view.radar.wavelength_m / (4 * np.pi * far)
        assert np.abs(paths.amplitude[frame].sum()) == pytest.approx(level, rel=1e-3)


def test_there_is_no_corner_where_walls_do_not_meet_the_way(make_view, make_term):
    short = {**NORTH, "center_m": [-3.5, 2.05], "width_m": 1.0}
    view = make_view([[0.0, 0.0]], [EAST, short], tx=(0.0, 0.0, 0.02))
    assert not np.any(make_term("bounce.walls").paths(view, None).amplitude)
    alone = make_view([[0.0, 0.0]], [EAST])
    assert make_term("bounce.walls").paths(alone, None) is None


@pytest.mark.parametrize(
    ("name", "params"), [("bounce.objects", {"points": 20}), ("bounce.walls", {}), ("echo.scatterers", {})]
)
def test_bound_holds_in_every_frame(make_view, make_term, rng, name, params):
    track = np.column_stack([np.linspace(-1, 1.5, 100), rng.uniform(-1, 0.9, 100)])
    view = make_view(track, [ONE, OTHER, EAST, NORTH], yaw_rad=rng.uniform(-3, 3, 100))
    view = make_term("antenna").prepare(view, rng)
    term = make_term(name, **params)
    term.prepare(view, rng)
    assert 0 < np.max(np.sum(np.abs(term.paths(view, rng).amplitude), axis=1)) <= term.bound(view)
