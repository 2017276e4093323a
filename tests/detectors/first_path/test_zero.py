"""Responses moved to their direct paths."""

import dataclasses

import numpy as np
import pytest

from uwbbench.api import ConfigError


def pulse(tap):
    return np.exp(-((np.arange(50) - tap) ** 2) / 3).astype(complex)


def test_each_response_moves_by_its_own_zero(make_radar, make_block, make_stage, run_stage):
    samples = np.stack([pulse(20.0)])
    block = make_block(samples, sts1=np.stack([pulse(20.3)]), sts2=np.stack([pulse(19.5)]), first_path=np.full(1, 7.0))
    stage = make_stage("align.zero", sts1_ns=0.3, sts2_ns={"test": -0.5, "main": -0.5})
    moved = run_stage(stage, make_radar(has_sts=True), block).frames
    np.testing.assert_array_equal(moved.preamble, block.frames.preamble)
    for name in ("sts1", "sts2"):
        np.testing.assert_allclose(getattr(moved, name), samples, atol=3e-4)


def test_without_a_zero_the_block_passes_as_it_is(make_radar, make_block, make_stage):
    block, stage = make_block(np.zeros((2, 50)), first_path=np.zeros(2)), make_stage("align.zero")
    stage.open(make_radar())
    assert stage.step(block) is block
    stage = make_stage("align.zero", preamble_ns=0.2)
    stage.open(dataclasses.replace(make_radar(), first_tap_delay_s=0.0))
    assert stage.step(block) is block


def test_samples_keep_their_precision(make_radar, make_block, make_stage, run_stage):
    block = make_block(np.stack([pulse(20.0)]), first_path=np.full(1, 7.0))
    single = block.replace(frames=block.frames.with_preamble(block.frames.preamble.astype(np.complex64)))
    assert (
        run_stage(make_stage("align.zero", preamble_ns=0.2), make_radar(), single).frames.preamble.dtype == np.complex64
    )


def test_a_receiver_that_is_not_named_is_one_message(make_radar, make_stage):
    with pytest.raises(ConfigError, match=r"sts1_ns has values for the receivers front; the capture's is 'main'"):
        make_stage("align.zero", sts1_ns={"front": 0.1}).open(make_radar())


def test_calibration_adds_to_the_zero_of_a_response(make_stage):
    stage = make_stage("align.zero", sts1_ns=0.1)
    assert stage.recalibrated("sts1_delay_s", 0.2e-9) == pytest.approx({"sts1_ns": 0.3})
    assert stage.recalibrated("range_m", 0.2) == stage.recalibrated("preamble", 0.2) == {}
