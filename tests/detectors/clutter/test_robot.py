"""The robot's own response, subtracted."""

import numpy as np

TAP = np.arange(50)
FRAMES = 120


def _frames(place_m, wavelength_m=0.0375):
    """Ringing that never changes, and an echo that comes nearer as the robot moves."""
    range_m = 3.0 - place_m[:, None]
    echo = 0.1 * np.exp(-((TAP - 7 - range_m / 0.15) ** 2) / 4) * np.exp(-4j * np.pi * range_m / wavelength_m)
    return np.exp(-((TAP - 7) ** 2) / 4) + 0.3j * np.exp(-((TAP - 10) ** 2) / 9) + echo, echo


def _position(place_m):
    return np.stack([place_m, 0 * place_m, 0 * place_m], axis=1)


def test_a_moving_robot_is_left_with_its_echoes(make_radar, make_block, make_stage, run_stage):
    place_m = 0.006 * np.arange(FRAMES)
    samples, echo = _frames(place_m)
    block = make_block(samples, position_m=_position(place_m))
    left = run_stage(make_stage("clutter.robot_template"), make_radar(), block).frames.preamble
    assert np.abs(left[60:] - echo[60:]).max() < 0.01


def test_what_a_standing_robot_sees_never_becomes_a_part_of_it(make_radar, make_block, make_stage, run_stage):
    place_m = 0.006 * np.minimum(np.arange(2000), FRAMES)
    samples, echo = _frames(place_m)
    block = make_block(samples, position_m=_position(place_m))
    left = run_stage(make_stage("clutter.robot_template"), make_radar(), block).frames.preamble
    np.testing.assert_allclose(left[-1], left[FRAMES + 1], atol=1e-6)
    assert np.abs(left[-1] - echo[-1]).max() < 0.01


def test_a_robot_that_has_never_moved_is_left_with_nothing(make_radar, make_block, make_stage, run_stage):
    samples, _ = _frames(np.zeros(50))
    left = run_stage(make_stage("clutter.robot_template"), make_radar(), make_block(samples)).frames.preamble
    assert not left.any()


def test_a_long_stand_at_the_start_is_forgotten_within_a_second(make_radar, make_block, make_stage, run_stage):
    place_m = 0.006 * np.maximum(np.arange(348) - 300, 0)
    samples, echo = _frames(place_m)
    block = make_block(samples, position_m=_position(place_m))
    left = run_stage(make_stage("clutter.robot_template"), make_radar(), block).frames.preamble
    assert np.abs(left[-1] - echo[-1]).max() < 0.01


def test_any_cut_into_blocks_gives_the_same_bits(make_radar, make_block, make_echoes, run_cut, one_by_one):
    block = make_block(make_echoes(40), position_m=_position(0.006 * np.arange(40)))
    run_cut("clutter.robot_template", {}, make_radar(), block, one_by_one(40))
