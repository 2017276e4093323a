"""The front of a body."""

import numpy as np
import pytest

from uwbbench.api import Detections


@pytest.fixture
def front(make_radar, make_block, make_stage, run_stage):
    def run(energy, tap, noise=1e-3, first_path=-10.0, **params):
        """Tap that a detection is moved to; taps are 15 cm."""
        samples = np.sqrt(np.atleast_2d(energy)).astype(complex)
        found = Detections([0], tap=[float(tap)])
        block = make_block(samples, noise_rms=np.full(1, noise), first_path=np.full(1, first_path), detections=found)
        stage = make_stage("leading_edge", **params)
        return run_stage(stage, make_radar(samples.shape[1]), block).detections["tap"][0]

    return run


def test_the_front_is_the_first_crest_before_the_brightest_part(front):
    assert front([0, 0, 0.1, 0.3, 0.2, 1.0, 0.1], 5, depth_m=0.45) == 3
    assert front([0, 0, 0.1, 0.3, 0.2, 0.9, 1.0], 5, depth_m=0.45) == 3


def test_what_is_farther_than_a_body_is_deep_is_another_body(front):
    assert front([0, 0.5, 0.1, 0, 0, 1.0, 0], 5, depth_m=0.45) == 5


def test_side_lobes_and_noise_are_no_front(front):
    energy = [0, 0, 0, 0.05, 0.01, 1.0, 0]
    assert front(energy, 5) == 5
    assert front(energy, 5, fraction=0.02) == 3
    assert front(energy, 5, fraction=0.02, noise=0.1) == 5


def test_what_lies_at_the_first_path_is_no_front(front):
    energy = [0, 0, 0, 0.9, 0.1, 1.0, 0]
    assert front(energy, 5) == 3
    assert front(energy, 5, first_path=1.0) == 5


def test_a_detection_in_a_frame_of_zeros_stays(front):
    assert front(np.zeros(7), 4.25) == 4.25


def test_the_ends_of_a_frame_can_be_fronts(front):
    assert front([1.0, 0.2, 0.1, 0], 1) == 0
    assert front([0, 0, 0.2, 1.0], 3) == 3
