"""What a scene may say about the echo of one object: its loss, fading, tail and direction."""

import numpy as np
import pytest
from pydantic import ValidationError

from uwbbench_datasets.simulator.shapes import ObjectModel
from uwbbench_datasets.simulator.speckle import LARGEST, speckle, swing

BOX = {"id": "box", "shape": "box", "center_m": [3.0, 0.0], "width_m": 0.3, "depth_m": 0.2, "height_m": 0.3}
BOX |= {"yaw_deg": 180, "material": "concrete"}
POST = {"id": "post", "shape": "point", "center_m": [3.0, 0.4]}
WALL = {"id": "wall", "shape": "wall", "center_m": [3.0, 0.0], "width_m": 4.0, "yaw_deg": 180}
WAY = np.column_stack([np.linspace(0, 2, 400), np.zeros(400)])
ECHO = {"box": "echo.plate", "point": "echo.point", "wall": "echo.wall"}


@pytest.fixture
def echo(make_view, make_term):
    """Paths of one object along a way towards it."""

    def paths(thing, way=WAY, **changes):
        view = make_view(way, [{**thing, **changes}])
        return make_term(ECHO[thing["shape"]]).paths(view, None)

    return paths


@pytest.mark.parametrize(("thing", "usual_db"), [(BOX, 6.0), (WALL, 0.0)])
def test_a_loss_of_its_own_takes_the_place_of_the_materials(echo, thing, usual_db: float) -> None:
    usual, lossless, gain = (echo(thing, loss_db=loss).amplitude for loss in (None, 0.0, -3.0))
    assert usual == pytest.approx(lossless * 10 ** (-usual_db / 20))
    assert gain == pytest.approx(lossless * 10 ** (3.0 / 20))


def test_a_tail_lies_behind_the_strongest_echo_on_the_line_of_sight(make_view, make_term) -> None:
    tail = {"level_db": -6.0, "from_m": 0.2, "to_m": 0.5, "returns": 4, "decay_m": 0.3}
    view = make_view([[0, 0], [1, 0.3]], [{**POST, "tail": tail}])
    paths = make_term("echo.point").paths(view, None)
    sight = view.objects[0].center_m - view.receiver_m
    unit = sight / np.linalg.norm(sight, axis=1, keepdims=True)
    places = view.objects[0].center_m + np.array([0.0, 0.2, 0.3, 0.4, 0.5])[:, None] * unit[:, None]
    assert paths.delay_s == pytest.approx(view.delay_s(places))
    assert paths.azimuth_rad == pytest.approx(np.tile(paths.azimuth_rad[:, :1], 5))
    power = np.abs(paths.amplitude) ** 2
    assert power[:, 1:].sum(axis=1) / power[:, 0] == pytest.approx(10 ** (-6.0 / 10))
    assert power[:, 2:] / power[:, 1:-1] == pytest.approx(np.exp(-0.1 / 0.3))


def test_the_phases_of_a_tail_are_the_objects_own(echo) -> None:
    def tail(**changes):
        return echo({**POST, **changes}).amplitude[:, 1:]

    assert np.array_equal(tail(tail={}), tail(tail={}))
    assert not np.allclose(tail(tail={}), tail(tail={"seed": 1}))
    assert not np.allclose(tail(tail={}), tail(tail={}, id="other"))


def test_a_tail_fades_along_the_way_only_if_the_scene_says_so(echo) -> None:
    steady, fading = (echo(POST, tail={"length_m": length}).amplitude for length in (None, 0.1))
    assert np.ptp(np.abs(steady[:, 1] / steady[:, 0])) < 1e-12
    assert np.ptp(np.abs(fading[:, 1] / fading[:, 0])) > 0.1
    assert np.array_equal(steady[:, 0], fading[:, 0])


def test_fading_swings_the_level_of_the_object_and_not_of_its_tail(echo) -> None:
    plain = echo(POST, tail={}).amplitude
    faded = echo(POST, tail={}, fading={"sd_db": 3.0, "length_m": 0.05}).amplitude
    level_db = 20 * np.log10(np.abs(faded[:, 0] / plain[:, 0]))
    assert np.std(level_db) == pytest.approx(3.0, rel=0.5)  # fixed draws of about 40 independent levels
    assert np.array_equal(faded[:, 1:], plain[:, 1:])


def test_objects_that_say_nothing_neither_fade_nor_err(echo) -> None:
    plain = echo(BOX)
    said = echo(BOX, fading={"sd_db": 0.0}, bearing_bias_deg=0.0, bearing_sd_deg=0.0)
    assert np.array_equal(plain.amplitude, said.amplitude)
    assert np.array_equal(plain.azimuth_rad, said.azimuth_rad)


def test_a_wrong_direction_shifts_nothing_but_the_direction(echo) -> None:
    plain, wrong = echo(POST, tail={}), echo(POST, tail={}, bearing_bias_deg=4.0)
    assert wrong.azimuth_rad - plain.azimuth_rad == pytest.approx(np.full((400, 5), np.radians(4.0)))
    assert np.array_equal(plain.amplitude, wrong.amplitude)
    assert np.array_equal(plain.delay_s, wrong.delay_s)


def test_glint_wanders_along_the_way_and_stands_still_with_the_robot(echo) -> None:
    moving, still = (
        echo(POST, way, bearing_sd_deg=5.0).azimuth_rad - echo(POST, way).azimuth_rad
        for way in (WAY, np.zeros((50, 2)))
    )
    assert np.degrees(np.std(moving)) == pytest.approx(5.0, rel=0.5)  # fixed draws of about 40 independent errors
    assert np.ptp(still) == 0


@pytest.mark.parametrize("changes", [{"fading": {}}, {"tail": {}}, {"tail": {"length_m": 0.1}}, {"bearing_sd_deg": 5}])
def test_no_echo_exceeds_its_bound(make_view, make_term, changes) -> None:
    for thing in (BOX, POST):
        view, term = make_view(WAY, [{**thing, **changes}]), make_term(ECHO[thing["shape"]])
        most = np.abs(term.paths(view, None).amplitude).sum(axis=1).max()
        assert most <= term.bound(view)


def test_patterns_have_the_power_and_the_length_that_they_are_asked_for(make_view) -> None:
    places = np.random.default_rng(0).uniform(-50, 50, (4000, 2))
    view, near = (make_view(places + step, [POST]) for step in (0.0, [0.3, 0.0]))
    (body,) = view.objects
    pattern, beside = speckle(body, view, "any", 0.3), speckle(body, near, "any", 0.3)
    assert np.mean(np.abs(pattern) ** 2) == pytest.approx(1.0, abs=0.1)
    assert abs(np.mean(pattern)) < 0.1
    assert np.mean(pattern * np.conj(beside)).real == pytest.approx(np.exp(-0.5), abs=0.2)  # of 16 waves
    assert np.std(swing(body, view, "any", 0.3)) == pytest.approx(1.0, abs=0.1)
    assert np.max(np.abs(pattern)) <= LARGEST


def test_a_pattern_turns_with_its_object(make_view) -> None:
    turned = {**POST, "yaw_deg": 90}
    ahead = make_view([[2.0, 0.4]], [POST])
    beside = make_view([[3.0, -0.6]], [turned])  # the same place, as the object sees it
    assert speckle(ahead.objects[0], ahead, "any", 0.3) == pytest.approx(speckle(beside.objects[0], beside, "any", 0.3))


@pytest.mark.parametrize("field", ["fading", "tail", "bearing_sd_deg"])
def test_a_wall_is_a_mirror(field: str) -> None:
    with pytest.raises(ValidationError, match=f"a wall has no {field}: its echo is that of a mirror"):
        ObjectModel.model_validate({**WALL, field: 1.0 if field.endswith("deg") else {}})


def test_a_tail_ends_behind_its_start() -> None:
    with pytest.raises(ValidationError, match=r"to_m \(0.1\) must not lie before from_m \(0.2\)"):
        ObjectModel.model_validate({**POST, "tail": {"to_m": 0.1}})
