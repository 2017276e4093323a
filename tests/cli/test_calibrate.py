"""``calibrate`` without truth, on several receivers, and without a detector."""

import json

import numpy as np
import pytest
import yaml

import uwbbench as package
from tests.api.ringing_robot import frames_of
from tests.measure.test_own_path import capture_of
from uwbbench.api import write_capture

DETECTOR = """
schema: 1
name: simple
pipeline: [{use: first_path.crest, params: {interpolate: true}}, {use: profile.amplitude}, {use: peaks}, {use: range}]
"""


@pytest.fixture
def detector(tmp_path):
    (tmp_path / "simple.yaml").write_text(DETECTOR)
    return "simple.yaml"


@pytest.fixture
def robot(tmp_path):
    """A capture file of two receivers with an echo, and one with nothing in view."""
    front, side = (
        capture_of(frames_of(frames=60, seed=seed)[0], receiver=name) for seed, name in ((1, "front"), (2, "side"))
    )
    write_capture(tmp_path / "robot.h5", front, side)
    write_capture(tmp_path / "empty.h5", capture_of(frames_of(frames=60, echo=0.0)[0]))
    return tmp_path


def test_each_receiver_is_calibrated_by_its_own_echoes(uwbbench, robot, detector):
    result = uwbbench("calibrate", "robot.h5", "-d", detector, "-o", "better.yaml", "--by", "echoes", "--json")
    printed = json.loads(result.stdout)
    assert list(printed) == ["front", "side"]
    written = yaml.safe_load((robot / "better.yaml").read_text())
    assert written["set"]["pipeline.range.params.bias_m"] == {
        name: pytest.approx(facts["range_bias_m"]) for name, facts in printed.items()
    }
    assert "standard deviation" in (robot / "better.yaml").read_text()
    before, after = package.load_detector(robot / detector), package.load_detector(robot / "better.yaml")
    opened = package.open_capture(robot / "robot.h5", "side")
    shift = before.run(opened).range_m - after.run(opened).range_m
    shorter = np.isfinite(shift)  # than the baseline no range can be
    assert shorter.mean() > 0.9
    assert shift[shorter] == pytest.approx(printed["side"]["range_bias_m"])


def test_an_empty_drive_needs_a_pulse_that_is_stated(uwbbench, robot, detector):
    to = ("-d", detector, "-o", "better.yaml")
    assert "unless the pulse is stated" in uwbbench("calibrate", "empty.h5", *to, "--by", "echoes", code=2).stderr
    uwbbench("calibrate", "empty.h5", *to, "--by", "pulse", "--pulse", "gauss", "--width-ns", "3.2")
    assert "by a known pulse" in (robot / "better.yaml").read_text()


def test_without_a_detector_the_robot_itself_is_shown(uwbbench, robot):
    shown = uwbbench("calibrate", "robot.h5").stdout
    assert "crest scatter (cm)" in shown
    assert "no zero to rely on: only 0 echoes" in uwbbench("calibrate", "empty.h5").stdout
    (facts,) = json.loads(uwbbench("calibrate", "empty.h5", "--json").stdout)
    assert facts["zero_m"] is None
    assert len(facts["template"]["real"]) == 50
    assert facts["template"]["real"][facts["template"]["crest_tap"]] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-d", "simple.yaml"), "--detector, --output"),
        (("--set", "a=1"), "--set changes a detector"),
        (("--by", "pulse"), "--by pulse needs the pulse"),
        (("--by", "pulse", "--pulse", "gauss"), "needs its width"),
        (("--by", "pulse", "--pulse", "gauss", "--width-ns", "-1"), "must be positive"),
        (("--pulse", "gauss", "--width-ns", "3.2"), "--by pulse alone asks for"),
        (("--width-ns", "3.2"), "belongs to --pulse"),
    ],
)
def test_options_that_do_not_fit_together_are_one_message(uwbbench, robot, detector, options, message):
    assert message in uwbbench("calibrate", "empty.h5", *options, code=2).stderr
