import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fixtures.chance import SIGMAS
from uwbbench.api import SPEED_OF_LIGHT_M_S
from uwbbench_datasets.simulator.materials import reflection
from uwbbench_datasets.simulator.shapes import faces
from uwbbench_datasets.simulator.terms.walls import mirrored

WALL = {"id": "wall", "shape": "wall", "center_m": [3.05, 0.0], "yaw_deg": 180, "width_m": 4.0, "material": "concrete"}
"""Its front stands at x = 3 m and looks at the origin."""


def strongest(paths):
    """Delay, amplitude and azimuth (frames,) of the strongest path."""
    best = np.argmax(np.abs(paths.amplitude), axis=1)[:, None]
    parts = (paths.delay_s, paths.amplitude, paths.azimuth_rad)
    return [np.take_along_axis(one, best, axis=1)[:, 0] for one in parts]


@given(st.floats(-0.5, 2.0), st.floats(-1.0, 1.0), st.floats(-3.1, 3.1))
@settings(max_examples=40, deadline=None)
def test_endless_wall_is_an_image_of_the_transmitter(make_view, make_term, x, y, yaw):
    view = make_view([[x, y]], [WALL], yaw_rad=yaw)
    image = view.transmitter_m * [-1, 1, 1] + [6.0, 0.0, 0.0]
    length = np.linalg.norm(image - view.receiver_m)
    delay_s, amplitude, azimuth = strongest(make_term("echo.wall", infinite=True).paths(view, None))
    assert delay_s * SPEED_OF_LIGHT_M_S == pytest.approx(length - 0.25, abs=1e-12)
    strength = reflection("concrete", view.radar.center_frequency_hz)
    carrier = np.exp(-2j * np.pi * view.radar.center_frequency_hz * delay_s)
    assert amplitude == pytest.approx(strength * carrier * view.radar.wavelength_m / (4 * np.pi * length))
    toward = np.arctan2(image[0, 1] - y, image[0, 0] - x) - yaw
    assert np.exp(1j * azimuth) == pytest.approx(np.exp(1j * toward))


def test_middle_of_a_wide_wall_reflects_as_if_it_had_no_ends(make_view, make_term):
    view = make_view(np.column_stack([np.linspace(0, 2, 50), np.zeros(50)]), [{**WALL, "height_m": 4.0}])
    ends = np.abs(strongest(make_term("echo.wall").paths(view, None))[1])
    endless = np.abs(strongest(make_term("echo.wall", infinite=True).paths(view, None))[1])
    assert ends == pytest.approx(endless, rel=0.2)  # edges still ripple
    assert np.mean(ends / endless) == pytest.approx(1.0, abs=0.03)


def test_half_of_the_field_is_left_at_the_end_of_a_wall_and_little_beyond(make_view, make_term):
    high = {**WALL, "width_m": 40.0, "center_m": [3.05, 20.0], "height_m": 40.0}  # it ends at y = 0
    view = make_view([[1.0, 10.0], [1.0, 0.0], [1.0, -1.0]], [high], tx=(0.0, 0.0, 0.1))
    inside, end, beyond = np.abs(strongest(make_term("echo.wall").paths(view, None))[1])
    assert end / inside == pytest.approx(0.5, abs=0.02)
    assert beyond / inside < 0.1


def test_receiver_behind_a_wall_sees_its_other_side_alone(make_view, make_term):
    paths = make_term("echo.wall", infinite=True).paths(make_view([[5.0, 0.0]], [WALL]), None)
    assert np.count_nonzero(paths.amplitude) == 1
    assert strongest(paths)[0] * SPEED_OF_LIGHT_M_S == pytest.approx(np.hypot(3.8, 0.25) - 0.25)


def test_hidden_wall_is_silent(make_view, make_term):
    view = make_view([[0.0, 0.0]], [WALL])
    hidden = view.replace(visibility=np.zeros((1, 1)))
    assert not np.any(make_term("echo.wall").paths(hidden, None).amplitude)
    assert make_term("echo.wall").bound(hidden) == 0


def test_scenes_without_walls_have_nothing_of_them(make_view, make_term, rng):
    view = make_view([[0.0, 0.0]], [{"id": "a", "shape": "point", "center_m": [1, 0]}])
    for name in ("echo.wall", "clutter.wall", "ghost.wall"):
        term = make_term(name)
        term.prepare(view, rng)
        assert term.paths(view, rng) is None
        assert term.bound(view) == 0


@pytest.mark.parametrize(
    ("name", "params"), [("echo.wall", {}), ("echo.wall", {"infinite": True}), ("clutter.wall", {})]
)
def test_bound_holds_in_every_frame(make_view, make_term, rng, name, params):
    track = np.column_stack([np.linspace(-1, 2.9, 100), rng.uniform(-3, 3, 100)])
    view = make_view(track, [WALL, {**WALL, "id": "other", "center_m": [0, 3.05], "yaw_deg": -90}])
    term = make_term(name, **params)
    view = term.prepare(view, rng)
    assert 0 < np.max(np.sum(np.abs(term.paths(view, rng).amplitude), axis=1)) <= term.bound(view) * (1 + 1e-12)


def test_clutter_follows_the_radar_equation_scatterer_by_scatterer(make_view, make_term):
    view = make_view([[0.0, 0.0], [1.5, 0.4]], [WALL])
    term = make_term("clutter.wall")
    term.prepare(view, np.random.default_rng(3))
    paths = term.paths(view, None)
    front, place, root = next((face, place, root) for _, face, place, root in term._scatterers)
    assert front.normal[0] == pytest.approx(-1)
    wavelength = view.radar.wavelength_m
    for frame in range(2):
        for index, point in enumerate(place):
            out = np.linalg.norm(point - view.transmitter_m[frame])
            back = np.linalg.norm(point - view.receiver_m[frame])
            expected = wavelength * abs(root[index]) / ((4 * np.pi) ** 1.5 * out * back)
            assert abs(paths.amplitude[frame, index]) == pytest.approx(expected)
            delay = (out + back - 0.25) / SPEED_OF_LIGHT_M_S
            assert paths.delay_s[frame, index] == pytest.approx(delay, abs=1e-20)
    assert not np.any(paths.amplitude[:, len(place) :])  # those on the back are out of sight


def test_clutter_has_the_density_and_cross_section_asked_for(make_view, make_term):
    wide = {**WALL, "width_m": 100.0, "height_m": 10.0}
    term = make_term("clutter.wall", per_m2=2.0, rcs_m2=1e-3, depth_m=0.2)
    term.prepare(make_view([[0.0, 0.0]], [wide]), np.random.default_rng(4))
    _, _, place, root = term._scatterers[0]
    assert len(place) == pytest.approx(2000, abs=SIGMAS * np.sqrt(2000))
    assert np.mean(np.abs(root) ** 2) == pytest.approx(1e-3, rel=SIGMAS / np.sqrt(len(place)))
    assert np.all((place[:, 0] >= 2.8) & (place[:, 0] <= 3.0))
    assert np.all(np.abs(place[:, 1]) <= 50)
    assert np.std(place[:, 2]) == pytest.approx(10 / np.sqrt(12), rel=0.1)


@given(st.lists(st.floats(-10, 10), min_size=3, max_size=3), st.floats(-180, 180))
@settings(max_examples=50)
def test_mirroring_twice_returns_and_keeps_the_middle_in_the_plane(make_view, point, yaw_deg):
    face = faces(make_view([[0.0, 0.0]], [{**WALL, "yaw_deg": yaw_deg}]).objects[0])[0]
    points = np.array([point])
    image = mirrored(points, face)
    assert mirrored(image, face) == pytest.approx(points, abs=1e-12)
    assert ((points + image) / 2 - face.center_m) @ face.normal == pytest.approx(0, abs=1e-12)


def test_scene_with_a_wall_shows_its_echo_where_the_image_says(run_scene):
    capture = run_scene([{"use": "direct"}, {"use": "echo.wall"}], objects=[{**WALL, "material": "metal"}])
    frame = np.abs(capture.frames(0, 1).preamble[0])
    delay_s = (np.hypot(6.0, 0.25) - 0.25) / SPEED_OF_LIGHT_M_S
    assert np.argmax(frame[15:]) + 15 == round(7 + delay_s / capture.radar.sample_interval_s)
