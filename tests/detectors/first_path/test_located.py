"""First paths that look for the direct path inside what the robot rings."""

import numpy as np
import pytest
from pydantic import ValidationError

from tests.api.ringing_robot import frames_of, gauss, tailed

KNOWN = ("first_path.known_pulse", {"shape": "gauss", "width_ns": 3.2})
ECHO = ("first_path.echo_pulse", {})


@pytest.mark.parametrize(("name", "params"), [KNOWN, ECHO])
def test_any_cut_into_blocks_gives_the_same_bits(name, params, make_radar, make_block, run_cut):
    samples, _ = frames_of(frames=110)
    samples[5], samples[11], samples[17] = np.nan, 0, samples[17] * 1e6
    whole = run_cut(name, params, make_radar(), make_block(samples), [1, 2, 50, 51, 96, 100]).first_path
    assert np.flatnonzero(np.isnan(whole)).tolist() == [5, 11]


@pytest.mark.parametrize(
    ("name", "params", "pulse"), [(*KNOWN, gauss), (*ECHO, gauss), (*ECHO, tailed)], ids=["known", "echo", "tailed"]
)
def test_the_first_path_moves_from_the_crest_to_the_direct_path(
    name, params, pulse, make_radar, make_block, make_stage, run_stage
):
    samples, off = frames_of(pulse)
    stage = make_stage(name, **params)
    error = run_stage(stage, make_radar(), make_block(samples)).first_path - 7 - off
    crest = run_stage(make_stage("first_path.crest", interpolate=True), make_radar(), make_block(samples)).first_path
    assert np.abs(error[:48] - (crest - 7 - off)[:48]).max() < 0.05
    assert abs(np.median(error[:48])) > 0.1
    assert abs(np.median(error[-4:])) < 0.07
    assert stage.notes == []


def test_a_pulse_that_is_not_the_radar_s_is_refused_and_the_zero_stays_at_the_crest(
    make_radar, make_block, make_stage, run_stage
):
    block = make_block(frames_of(tailed)[0])
    stage = make_stage(KNOWN[0], **KNOWN[1])
    refused = run_stage(stage, make_radar(), block).first_path
    assert "refused after" in stage.notes[0]
    assert "another pulse" in stage.notes[0]
    narrow = make_stage(KNOWN[0], shape="raised_cosine")
    at_crest = run_stage(narrow, make_radar(), block).first_path
    assert "does not rise like the pulse" in narrow.notes[0]
    np.testing.assert_array_equal(refused[-4:], at_crest[-4:])


def test_radars_that_count_from_transmission_keep_their_zero(make_radar, make_block, make_stage, run_stage):
    radar = make_radar(first_tap_delay_s=2e-9)
    assert (
        run_stage(make_stage(KNOWN[0], **KNOWN[1]), radar, make_block(np.zeros((3, 50)))).first_path.tolist()
        == [-2.0] * 3
    )


def test_the_pulse_has_no_default(make_stage):
    with pytest.raises(ValidationError, match="shape"):
        make_stage("first_path.known_pulse")
    with pytest.raises(ValidationError, match="width_ns"):
        make_stage("first_path.known_pulse", shape="gauss")
