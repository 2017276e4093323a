"""A direct path with an echo close behind it."""

import numpy as np
import pytest

FRAMES, NEAR = 150, 100


@pytest.fixture
def drift(make_radar, make_block, make_stage, run_stage):
    """Taps by which an echo that arrives two taps behind the direct path moves the aligned direct path."""
    tap = np.arange(50)

    def drift(trail_taps, phase):
        jitter = np.random.default_rng(1).uniform(-0.5, 0.5, (FRAMES, 1))
        direct = np.exp(-((tap - 7 - jitter) ** 2) / 2)
        echo = 0.8 * np.exp(-((tap - 9 - jitter) ** 2) / 2) * np.exp(1j * phase)
        echo[:NEAR] = 0
        way = np.zeros((FRAMES, 3))
        way[:, 0] = 0.01 * np.arange(FRAMES)
        block = make_block(direct + echo, position_m=way)
        stage = make_stage("align.template", trail_taps=trail_taps, crest_within_taps=4)
        frames = run_stage(stage, make_radar(), block).frames.preamble
        flank = np.abs(frames[:, 5] / frames[:, 6])  # steep: exp(-2.5) to 1 over a tap
        return abs(np.log(flank[-1]) - np.log(flank[NEAR - 1]))

    return drift


@pytest.mark.parametrize("phase", [0.0, 1.5, 3.0])
def test_a_fit_up_to_the_crest_bears_an_echo_behind_it(drift, phase):
    assert drift(0, phase) < 0.5 * drift(2, phase)
