"""A dataset that is broken in one place is caught by the check that is about it."""

import pytest

from uwbbench.tools.check import all_checks
from uwbbench.tools.check.conduct import CHECKS as CONDUCT
from uwbbench.tools.check.declaration import CHECKS as DECLARATION
from uwbbench.tools.check.source import CHECKS as SOURCE

GOOD = '''"""A module."""

import itertools

import numpy as np
from uwbbench.api import (
    Capture, CaptureError, Card, Dataset, DatasetFile, Obstacle, Params, Radar, Trajectory, Truth, nearest
)

CALLS = itertools.count()
FILES = ()


class Broken(Dataset[Params]):
    """Noise and a target."""

    card = Card(title="Noise", license="CC0-1.0", citation="none", source="here", files=FILES, origin="simulated")

    def names(self):
        """Names."""
        return ["a", "b"]

    def open(self, name):
        """One."""
        if name not in self.names():
            raise CaptureError(f"no capture '{name}'.{nearest(name, self.names())}")
        samples = np.random.default_rng(1).normal(size=(20, 30)) + 0j
        return Capture(
            name=name,
            radar=Radar(model="x", center_frequency_hz=8e9, bandwidth_hz=5e8, sample_interval_s=1e-9,
                        frame_rate_hz=10.0, taps=30),
            trajectory=Trajectory(np.arange(20) / 10.0, np.zeros((20, 3)), np.zeros(20)),
            truth=Truth((Obstacle("t", "metal", np.array([[2.0, 0.0]])),)),
            source="simulated",
            license="CC0-1.0",
            preamble=samples,
        )
'''
PINNED = 'FILES = (DatasetFile("a.dat", "0" * 64, "https://example.org/a"),)'
BROKEN = {
    "card-is-complete": (('license="CC0-1.0", citation', 'license="", citation'), "no license"),
    "files-are-pinned": (("FILES = ()", PINNED.replace('"0" * 64', '"0"')), "'0'"),
    "names-are-unique-and-stable": (('["a", "b"]', '["a", "a"]'), "'a' twice"),
    "unknown-names-are-refused": (
        ("raise CaptureError(f\"no capture '{name}'.{nearest(name, self.names())}\")", "raise KeyError(name)"),
        "KeyError: 'ax'",
    ),
    "missing-files-are-told": (("FILES = ()", PINNED), "2 captures"),
    "capture-says-what-it-is": (('source="simulated",\n', ""), "'measured'"),
    "capture-is-sound": (("np.arange(20) / 10.0", "np.arange(20) * 1.0"), "1 a second"),
    "truth-is-in-sight": (("[[2.0, 0.0]]", "[[2000.0, 0.0]]"), "2000.00 m"),
    "hash-is-stable": (("default_rng(1)", "default_rng(next(CALLS))"), ""),
    "blocks-equal-the-whole": (("preamble=samples", "preamble=Flickering(samples)"), "preamble: "),
    "capture-can-be-kept": (("preamble=samples", "preamble=samples * 1e60"), ""),
    "detectors-take-it": (("preamble=samples", "preamble=Flickering(samples * 1e3)"), ""),
    "same-twice": (("default_rng(1)", "default_rng(next(CALLS))"), "preamble: "),
    "prints-nothing": (("        samples =", "        print(name)\n        samples ="), "'a'"),
}
FLICKERING = """

class Flickering:
    def __init__(self, samples):
        self.samples, self.shape = samples, samples.shape

    def __getitem__(self, key):
        return np.where(next(CALLS) % 2, np.nan, 1.0) * self.samples[key]
"""


@pytest.mark.parametrize("check", BROKEN)
def test_a_broken_dataset_is_caught_by_the_check_that_is_about_it(judged, check):
    (old, new), found = BROKEN[check]
    assert old in GOOD
    result = judged("dataset", GOOD.replace(old, new) + FLICKERING, check)
    assert result.status in ("failed", "error"), result
    assert found in result.found


def test_names_that_open_captures_are_caught(judged):
    source = GOOD.replace('return ["a", "b"]', 'return [self.open("a").name, "b"]').replace(
        "if name not in self.names()", 'if name not in ("a", "b")'
    )
    assert judged("dataset", source, "names-open-nothing").found == "1 captures opened"


def test_a_dataset_whose_files_are_missing_is_told_and_not_blamed(judged):
    result = judged("dataset", GOOD.replace("FILES = ()", PINNED), "capture-is-sound")
    assert result.status == "not applicable"
    assert "a.dat" in result.detail


def test_every_check_of_datasets_alone_is_broken_once():
    shared = {one.name for one in (*CONDUCT, *SOURCE, *DECLARATION)}
    assert {one.name for one in all_checks("dataset")} - shared == {*BROKEN, "names-open-nothing"} - {
        "same-twice",
        "prints-nothing",
    }


def test_the_same_dataset_unbroken_passes_all(examine_plugin):
    found = examine_plugin("dataset", GOOD)
    assert found.passed, [one.explain() for one in found.results if not one.passed]
