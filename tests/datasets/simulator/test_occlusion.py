import numpy as np
import pytest

from uwbbench.api import Trajectory, Truth

SCREEN = {"id": "screen", "shape": "plate", "center_m": [1.0, 0.0], "yaw_deg": 180, "width_m": 0.5, "height_m": 1.0}
BEHIND = {"id": "behind", "shape": "box", "center_m": [2.5, 0.0], "width_m": 0.3, "depth_m": 0.3, "height_m": 1.0}
POST = {"id": "post", "shape": "point", "center_m": [0.5, 0.0]}


def test_object_behind_another_is_hidden_and_the_screen_is_not(make_view, make_term, rng):
    view = make_term("occlusion").prepare(make_view([[0.0, 0.0], [0.0, 2.0]], [SCREEN, BEHIND]), rng)
    assert view.visibility.tolist() == [[1, 0], [1, 1]]


def test_points_hide_nothing(make_view, make_term, rng):
    view = make_term("occlusion").prepare(make_view([[0.0, 0.0]], [POST, SCREEN]), rng)
    assert view.visibility.tolist() == [[1, 1]]


def test_screen_before_the_transmitter_hides_too(make_view, make_term, rng):
    side = {**SCREEN, "center_m": [0.5, -0.25], "width_m": 0.2}
    view = make_view([[0.0, 0.0]], [side, BEHIND], tx=(0.0, -0.3, 0.0))
    assert make_term("occlusion").prepare(view, rng).visibility.tolist() == [[1, 0]]


def test_something_may_pass_a_hiding_object(make_view, make_term, rng):
    view = make_view([[0.0, 0.0]], [SCREEN, BEHIND])
    assert make_term("occlusion", transmission_db=-20).prepare(view, rng).visibility[0, 1] == pytest.approx(0.1)


def test_receivers_side_agrees_with_the_ground_truth(make_view, make_term, rng):
    things = [SCREEN, BEHIND, POST, {"id": "rod", "shape": "rod", "center_m": [1.5, 1], "radius_m": 0.2, "height_m": 1}]
    track = rng.uniform([-1, -3], [5, 3], (300, 2))
    view = make_view(track, things, tx=(0.0, 0.0, 0.2))  # above the receiver: both see the same from above
    position = np.column_stack([track, np.zeros(len(track))])
    trajectory = Trajectory(view.timestamp_s, position, view.boresight_rad)
    sight = Truth(tuple(one.obstacle for one in view.objects)).seen_from(view.radar, trajectory)
    hidden = make_term("occlusion").prepare(view, rng).visibility == 0
    assert 0.02 < hidden.mean() < 0.9
    assert np.array_equal(hidden, sight.occluded)


def test_hidden_objects_leave_the_frames(run_scene):
    terms = [{"use": "direct"}, {"use": "occlusion"}, {"use": "echo.plate"}]
    both = run_scene(terms, objects=[SCREEN, BEHIND])
    alone = run_scene(terms, objects=[SCREEN])
    in_sight = run_scene([terms[0], terms[2]], objects=[SCREEN, BEHIND])
    floor = 1e-6 * np.max(np.abs(alone.preamble))
    assert np.max(np.abs(both.preamble - alone.preamble)) < floor
    assert np.max(np.abs(both.preamble - in_sight.preamble)) > 1e3 * floor
