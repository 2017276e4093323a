"""Rough bodies: against a plain sum by the radar equation, and what physics says of any body."""

import numpy as np
import pytest

from uwbbench.api import SPEED_OF_LIGHT_M_S
from uwbbench_datasets.simulator.materials import reflection

BOX = {"id": "box", "shape": "box", "center_m": [2.0, 0.3], "width_m": 0.6, "depth_m": 0.3, "height_m": 0.8}
ROD = {"id": "rod", "shape": "rod", "center_m": [1.5, -0.8], "radius_m": 0.1, "height_m": 1.0}


@pytest.fixture
def prepared(make_term):
    def build(view, **params):
        term = make_term("echo.scatterers", **params)
        term.prepare(view, np.random.default_rng(3))
        return term

    return build


def test_each_scatterer_follows_the_radar_equation_and_lamberts_law(make_view, prepared):
    view = make_view([[0.0, 0.0], [0.4, 0.5]], [BOX])
    term = prepared(view)
    paths, drawn = term.paths(view, None), term._drawn["box"]
    places = drawn.offset_m + np.array([2.0, 0.3, 0.0])
    for frame in range(2):
        for index, (place, normal, root) in enumerate(zip(places, drawn.normal, drawn.root, strict=True)):
            out, back = view.transmitter_m[frame] - place, view.receiver_m[frame] - place
            lengths = np.linalg.norm(out), np.linalg.norm(back)
            cosines = [max(way @ normal / length, 0) for way, length in zip((out, back), lengths, strict=True)]
            metal = abs(root * reflection("metal", 7987.2e6))
            expected = view.radar.wavelength_m * metal * np.sqrt(np.prod(cosines)) / (4 * np.pi) ** 1.5
            assert abs(paths.amplitude[frame, index]) == pytest.approx(expected / np.prod(lengths))
            assert paths.delay_s[frame, index] * SPEED_OF_LIGHT_M_S + 0.25 == pytest.approx(sum(lengths))


def test_scatterers_lie_behind_the_outline_all_round(make_view, prepared):
    drawn = prepared(make_view([[0.0, 0.0]], [BOX]), per_m=1000, depth_m=0.02)._drawn["box"]
    depth = np.abs(drawn.offset_m[:, 0]) - 0.15, np.abs(drawn.offset_m[:, 1]) - 0.3
    behind = -np.where(np.abs(drawn.normal[:, 0]) > 0.5, depth[0], depth[1])
    assert behind.min() >= 0
    assert behind.max() <= 0.02
    assert np.allclose(np.sum(drawn.normal * drawn.offset_m, axis=1) > 0, True)
    assert len(drawn.root) == pytest.approx(1800, abs=6 * np.sqrt(1800))
    on_front = np.sum(drawn.normal[:, 0] > 0.5)
    assert on_front == pytest.approx(len(drawn.root) / 3, abs=6 * np.sqrt(1800 / 3))


def test_the_power_is_that_of_the_outline_in_view(make_view, prepared):
    view = make_view([[0.0, 0.0]], [{**BOX, "center_m": [30.0, 0.0], "yaw_deg": 180}], tx=(0.0, 0.0, 0.1))
    power = np.sum(np.abs(prepared(view, per_m=1000, rcs_m2=2.0, depth_m=0.0).paths(view, None).amplitude) ** 2)
    expected = view.radar.wavelength_m**2 * 2.0 * 0.6 / ((4 * np.pi) ** 3 * 30.0**4)  # its front, 0.6 m wide
    assert power == pytest.approx(expected, rel=6 / np.sqrt(600))


def test_exchanging_the_antennas_changes_no_amplitude(make_view, prepared):
    objects = [BOX, ROD]
    here = make_view([[0.0, 0.0]], objects, tx=(0.3, 0.5, 0.0))
    there = here.replace(receiver_m=here.transmitter_m, transmitter_m=here.receiver_m)
    one, other = (prepared(view, seed=4).paths(view, None) for view in (here, there))
    assert one.amplitude == pytest.approx(other.amplitude)
    assert one.delay_s == pytest.approx(other.delay_s)


def test_the_pattern_is_the_objects_own_whatever_else_is_there(make_view, prepared):
    alone, beside = make_view([[0.0, 0.0]], [BOX]), make_view([[0.0, 0.0]], [ROD, BOX])
    own, with_rod = prepared(alone)._drawn["box"], prepared(beside)._drawn["box"]
    assert np.array_equal(own.root, with_rod.root)


def test_the_sum_fades_within_the_way_that_its_width_says(make_view, make_term):
    away, along = 4.0, np.linspace(0, 0.4, 21)
    track = np.column_stack([np.zeros(21), along])
    front = {**BOX, "center_m": [away, 0.2], "yaw_deg": 180, "depth_m": 0.01}
    view = make_view(track, [front], tx=(0.0, 0.0, 0.1))
    term, rng, sums = make_term("echo.scatterers", depth_m=0.0), np.random.default_rng(5), []
    for _ in range(150):
        term.prepare(view, rng)
        sums.append(term.paths(view, None).amplitude.sum(axis=1))
    kept = np.abs(np.mean(np.array(sums) * np.conj(np.array(sums)[:, :1]), axis=0))
    kept /= kept[0]
    gone = view.radar.wavelength_m * away / (2 * 0.6)  # the first zero of the sinc of a width of 0.6 m
    assert kept[1] > 0.8
    assert np.all(kept[along > gone] < 0.5)


def test_points_and_walls_are_no_rough_bodies(make_view, prepared):
    wall = {"id": "w", "shape": "wall", "center_m": [3.0, 0.0], "yaw_deg": 180, "width_m": 4.0}
    view = make_view([[0.0, 0.0]], [{"id": "p", "shape": "point", "center_m": [1.0, 0.0]}, wall])
    assert prepared(view).paths(view, None) is None


def test_a_body_that_moves_takes_its_scatterers_along(run_scene):
    person = {"id": "p", "shape": "person", "motion": {"kind": "waypoints", "points_m": [[1.0, 0.0], [3.0, 0.0]]}}
    capture = run_scene([{"use": "direct"}, {"use": "echo.scatterers"}], objects=[person])
    profile = np.abs(capture.frames().preamble)
    far = 7 + 2 * 2.6 / (SPEED_OF_LIGHT_M_S * capture.radar.sample_interval_s)
    late = np.arange(50) > far - 4
    assert (profile[-1, late] ** 2).sum() > 10 * (profile[0, late] ** 2).sum()
