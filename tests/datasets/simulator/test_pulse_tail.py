"""What a robot's radio makes of pulses: copies behind each, and ringing that differs between antennas."""

import numpy as np
import pytest

POST = {"id": "post", "shape": "point", "center_m": [2.0, 0.2]}
TAILED = {"use": "pulse.tail", "params": {"taps": [{"delay_ns": 2.5, "level_db": -12.0, "phase_deg": 90.0}]}}


def test_every_pulse_is_followed_by_its_copies(run_scene) -> None:
    terms = [{"use": "direct"}, {"use": "echo.point"}]
    plain, tailed = (run_scene(list(all_of), objects=[POST]) for all_of in (terms, [TAILED, *terms]))
    moved = {"radar": {"crest_tap": 7.0 + 2.5e-9 * 2 * 499.2e6}}
    later = run_scene(terms, objects=[POST], **moved)
    copy = 10 ** (-12 / 20) * 1j
    for name in ("preamble", "sts1", "sts2"):
        expected = getattr(plain.frames(0, 3), name) + copy * getattr(later.frames(0, 3), name)
        assert getattr(tailed.frames(0, 3), name) == pytest.approx(expected, abs=1e-9)


def test_a_tail_moves_the_crest_of_echo_and_direct_path_alike(run_scene) -> None:
    terms = [{"use": "direct"}, {"use": "echo.point", "params": {"rcs_m2": 50.0}}]
    capture = run_scene([{"use": "pulse.tail", "params": {"taps": [{"delay_ns": 1.5, "level_db": -8}]}}, *terms])
    alone = np.abs(capture.frames(0, 1).preamble[0])
    crest = np.argmax(alone)
    parabola = np.log(alone[crest - 1 : crest + 2])
    moved = (parabola[0] - parabola[2]) / (2 * (parabola[0] - 2 * parabola[1] + parabola[2]))
    assert 0.2 < crest + moved - 7.0 < 0.8


@pytest.fixture
def ringing(make_view, make_term):
    def build(**params):
        view, term = make_view([[0.0, 0.0]]), make_term("ringing", **params)
        term.prepare(view, np.random.default_rng(2))
        return view, term.paths(view, None)

    return build


def test_ringing_comes_from_where_the_scene_says_and_is_else_the_same(ringing) -> None:
    (_, alike), (_, spread) = ringing(), ringing(spread_deg=60)
    assert np.array_equal(alike.amplitude, spread.amplitude)
    assert not np.any(alike.azimuth_rad)
    assert 0.2 < np.max(np.abs(spread.azimuth_rad)) <= np.pi / 3


@pytest.mark.parametrize(("spread_deg", "alike"), [(0.0, True), (80.0, False)])
def test_spread_ringing_has_another_shape_at_the_second_antenna(run_scene, spread_deg, alike) -> None:
    frames = run_scene([{"use": "ringing", "params": {"spread_deg": spread_deg}}]).frames(0, 1)
    first, second = (one[0] / np.linalg.norm(one[0]) for one in (frames.sts1, frames.sts2))
    assert (np.abs(np.vdot(first, second)) == pytest.approx(1, abs=1e-6)) == alike
