"""A detector that is broken in one place is caught by the check that is about it."""

import pytest

from uwbbench.tools.check import examine, subject_of

GOOD = """\
schema: 1
name: broken
description: Strongest peak.
citation: none
pipeline:
  - {use: first_path.crest}
  - {use: profile.amplitude}
  - {use: peaks}
  - {use: broken}
  - {use: filter.first_path, params: {guard_taps: 6}}
  - {use: select.strongest}
  - {use: range}
"""
STAGE = '''"""A stage."""

import time

import numpy as np
from uwbbench.api import Filter, Params, ports

COUNT = []


class Broken(Filter[Params]):
    """Keeps all."""

    consumes = ports("detections", "tap")

    def keep(self, block):
        """Mask."""
        LINE
        return np.ones(len(block.detections), bool)
'''
HALF = "return np.arange(len(block.detections)) < len(block.detections) / 2"
BROKEN = {
    "file-says-what-it-is": ("pass", GOOD.replace("description: Strongest peak.\n", ""), "no description"),
    "detections-have-a-range": ("pass", GOOD.replace("  - {use: range}\n", ""), "columns frame"),
    "stream-equals-batch": (HALF, GOOD, "detections: "),
    "streams-share-nothing": (
        "COUNT.append(0); return np.full(len(block.detections), len(COUNT) < 20)",
        GOOD,
        "",
    ),
    "captures-without-sts-are-fine": ("block.frames.sts1.shape", GOOD, "AttributeError"),
    "captures-without-truth-are-fine": (
        "pass",
        GOOD.replace("  - {use: range}\n", "  - {use: reference.oracle}\n"),
        "refused: ",
    ),
    "other-channels-are-fine": ("{9: 1}[self.radar.channel]", GOOD, "KeyError: None"),
    "empty-captures-are-fine": ("len(block.frames) > 1 or 1 / 0", GOOD, "ZeroDivisionError"),
    "candidates-change-nothing": (
        "return np.zeros(len(block.detections), bool)\n\n    def step(self, block):\n        return block",
        GOOD,
        "detections: ",
    ),
    "one-frame-is-in-time": ("time.sleep(0.03 * (len(block.frames) == 1))", GOOD, " ms"),
    "hard-rippled-constant-frames": ("pass", GOOD, "detections of rounding errors"),
    "warns-of-nothing": ("import warnings; warnings.warn('slow')", GOOD, "UserWarning: slow"),
    "same-in-another-process": (
        # Every detection by a coin of its own: that all fall alike under two seeds has a chance of 2**-100 and less.
        "rows = block.detections; "
        "return np.array([hash(f'{f} {t}') % 2 == 0 for f, t in zip(rows['frame'], rows['tap'], strict=True)], bool)",
        GOOD,
        "hash ",
    ),
}


@pytest.fixture
def broken_detector(install_plugin, tmp_path):
    def make(line: str, text: str):
        install_plugin(
            "broken", {"stages": {"broken": "broken_module:Broken"}}, {"broken_module.py": STAGE.replace("LINE", line)}
        )
        (tmp_path / "broken.yaml").write_text(text)
        return subject_of("detector", str(tmp_path / "broken.yaml"))

    return make


@pytest.mark.slow
@pytest.mark.parametrize("check", BROKEN)
def test_a_broken_detector_is_caught_by_the_check_that_is_about_it(broken_detector, check):
    line, text, found = BROKEN[check]
    (result,) = examine(broken_detector(line, text), [check]).results
    assert result.status in ("failed", "error"), result
    assert found in result.found


@pytest.mark.slow
def test_the_same_detector_unbroken_passes_all_but_the_hard_case_that_it_fails(broken_detector):
    found = examine(broken_detector("pass", GOOD))
    assert [one.check.name for one in found.results if not one.passed] == ["hard-rippled-constant-frames"]


def test_a_detector_that_needs_sts_says_so(broken_detector):
    text = GOOD.replace("  - {use: select", "  - {use: pdoa}\n  - {use: select")
    (result,) = examine(broken_detector("pass", text), ["captures-without-sts-are-fine"]).results
    assert result.status == "passed"
    assert "refused: " in result.detail
    assert "STS" in result.detail


def test_a_detector_that_needs_a_background_is_given_one_and_says_so_where_there_is_none(broken_detector):
    line = 'return block.detections["tap"] > self.level'
    made = broken_detector(
        f"{line}\n\n    needs = ports('background')\n\n    def show_background(self, blocks):\n"
        "        for block in blocks:\n            self.level = 0.0",
        GOOD,
    )
    results = examine(made, ["stream-equals-batch", "captures-without-background-are-fine"]).results
    assert [one.status for one in results] == ["passed", "passed"]
    assert "refused: " in results[1].detail
    assert "has no background" in results[1].detail


def test_a_name_that_differs_from_the_registered_one_is_told(install_plugin):
    files = {"mine/__init__.py": "", "mine/other.yaml": GOOD.replace("  - {use: broken}\n", "")}
    install_plugin("mine", {"detectors": {"other": "mine:other.yaml"}}, files)
    (result,) = examine(subject_of("detector", "other"), ["file-says-what-it-is"]).results
    assert result.expected == "name: other"
