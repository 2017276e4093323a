"""The weighted sum of two responses."""

import numpy as np


def test_noise_falls_as_its_powers_say_and_echoes_stay(array_radar, make_drive, make_stage, run_stage):
    x_m = 0.006 * np.arange(800)
    block = make_drive([(9.0, 0.0)], x_m, noise=1e-3)
    rng = np.random.default_rng(9)
    louder = block.frames.sts1 + 1e-3 * (rng.normal(size=(800, 50)) + 1j * rng.normal(size=(800, 50)))
    block.frames.__dict__["sts1"] = louder  # noise of twice the power
    made = run_stage(make_stage("fuse.responses"), array_radar, block).frames.preamble
    quiet = made[400:, :6]
    # 1/p + 1/(2 p) = 1/(2/3 p); 4 800 samples know a power to 1.5 %.
    assert abs(np.mean(np.abs(quiet) ** 2) / (2e-6 * 2 / 3) - 1) < 0.1


def test_a_response_that_was_refused_adds_nothing(array_radar, make_drive, make_stage, run_stage):
    block = make_drive([(3.0, 0.0)], 0.006 * np.arange(5))
    block.frames.__dict__["sts1"] = np.zeros((5, 50), complex)
    made = run_stage(make_stage("fuse.responses"), array_radar, block).frames.preamble
    np.testing.assert_array_equal(made, block.frames.preamble.astype(np.complex64))


def test_any_cut_into_blocks_gives_the_same_bits(array_radar, make_drive, run_cut, one_by_one):
    run_cut("fuse.responses", {}, array_radar, make_drive([(3.0, 0.5)], 0.006 * np.arange(40)), one_by_one(40))
