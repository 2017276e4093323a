"""TUM files: written, read back, and refused with one message where a line is no planar pose."""

from pathlib import Path

import numpy as np
import pytest

from uwbbench.api import ScoringError
from uwbbench.detect.tum import read_tum, tum_text

PATH = Path("mine/run-1.tum")


def read(text):
    return read_tum(PATH, text.encode())


def test_poses_are_read_back_as_they_were_written():
    rng = np.random.default_rng(7001)
    time_s = np.cumsum(rng.uniform(0.01, 0.1, 200)) + 1.7e9
    pose = np.column_stack([rng.normal(0, 10, (200, 2)), rng.uniform(-np.pi, np.pi, 200)])
    read_s, found = read(tum_text(time_s, pose))
    np.testing.assert_array_equal(read_s, time_s)
    np.testing.assert_array_equal(found[:, :2], pose[:, :2])
    np.testing.assert_allclose(found[:, 2], pose[:, 2], atol=1e-14)


def test_files_of_other_programs_are_read():
    text = "\ufeff# made by\r\n\r\n 1.0\t2 3 0.4 0 0 0.7071068 0.7071068\r\n0.5 1e0 -2 0 0 0 0 1\r\n"
    time_s, pose = read(text)
    assert time_s.tolist() == [0.5, 1.0]
    assert pose[0].tolist() == [1.0, -2.0, 0.0]
    assert pose[1] == pytest.approx([2.0, 3.0, np.pi / 2], abs=1e-6)


@pytest.mark.parametrize("turn", [0.1, 3.0, -3.0])
def test_a_robot_that_leans_a_little_keeps_its_heading(turn):
    """First a turn about z, then a roll of 0.1 rad about the robot's own x."""
    half, roll = turn / 2, 0.05
    x, y = np.cos(half) * np.sin(roll), np.sin(half) * np.sin(roll)
    z, w = np.sin(half) * np.cos(roll), np.cos(half) * np.cos(roll)
    _, pose = read(f"0 0 0 0 {x} {y} {z} {w}")
    assert pose[0, 2] == pytest.approx(turn)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "mine/run-1.tum: holds no poses; expected lines of time tx ty tz qx qy qz qw"),
        ("# only a comment\n", "holds no poses"),
        ("0 0 0 0 0 0 0 1\n1 2 3", "line 2: 3 values, expected 8"),
        ("0,1,2,0,0,0,0,1", "line 1: 1 values, expected 8.* Are there commas between them"),
        ("0 a 0 0 0 0 0 1", "line 1: tx 'a' is no number"),
        ("0 0 nan 0 0 0 0 1", "line 1: ty is nan"),
        ("0 0 0 0 0 0 0 0", "line 1: qx qy qz qw has the length 0, expected a unit quaternion"),
        ("0 0 0 0 1 0 0 0", "line 1: the robot leans by 180 degrees. Is qw the last of the four"),
        ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n0 1 0 0 0 0 0 1", "line 3: time 0.0 has another pose already"),
    ],
)
def test_what_cannot_be_right_is_one_message(text, said):
    with pytest.raises(ScoringError, match=said) as caught:
        read(text)
    assert "\n" not in str(caught.value)


def test_what_is_no_text_is_refused():
    with pytest.raises(ScoringError, match="is no text: byte 1 is no UTF-8"):
        read_tum(PATH, b"0\xff\xfe")
