"""A stage that is broken in one place is caught by the check that is about it."""

import pytest

from uwbbench.tools.check import all_checks

GOOD = '''"""A module after nobody."""

import numpy as np
from pydantic import BaseModel, Field

from uwbbench.api import Block, Detections, Filter, Params, Stage, ports

SHARED = []


class BrokenParams(Params):
    """Parameters."""

    gain: float = Field(2.0, gt=0, description="Factor.")


class Broken(Stage[BrokenParams]):
    """Amplitudes times a gain, as a profile."""

    consumes = ports("frames")
    produces = ports("profile")

    def open(self, radar):
        """Start."""
        super().open(radar)
        self.count = 0

    def step(self, block):
        """Block with a profile."""
        return block.replace(profile=self.params.gain * block.frames.amplitude)
'''

STEP = "        return block.replace(profile=self.params.gain * block.frames.amplitude)\n"
FILTER = '''"""A module."""

import numpy as np

from uwbbench.api import Filter, Params, ports


class Broken(Filter[Params]):
    """Rows that are late."""

    consumes = ports("detections", "tap")

    def keep(self, block):
        """Mask."""
        return block.detections["tap"] > 10
'''
ROWS = '''"""A module."""

import numpy as np

from uwbbench.api import Params, Stage, ports


class Broken(Stage[Params]):
    """Rank of each row."""

    consumes = ports("detections", "tap")
    produces = ports("rank")
    rowwise = True

    def step(self, block):
        """Block with ranks."""
        return block.with_columns(rank=block.detections["tap"] * 2)
'''


def stage(*lines: str, source: str = GOOD) -> str:
    """The good stage with other lines in its step."""
    return source.replace(STEP, "".join(f"        {line}\n" for line in lines))


def swapped(old: str, new: str, source: str = GOOD) -> str:
    assert old in source
    return source.replace(old, new)


SHOWN = swapped(
    'produces = ports("profile")\n',
    """produces = ports("profile")
    needs = ports("background")

    def show_background(self, blocks):
        \"\"\"Remember the strongest sample.\"\"\"
        self.level = 0.0
        for block in blocks:
            self.level = max(self.level, block.frames.amplitude.max(initial=0.0))
""",
    stage("return block.replace(profile=block.frames.amplitude - self.level)"),
)
PROFILE = "return block.replace(profile=block.frames.amplitude)"
BROKEN = {
    "docstring-says-what-it-is": (swapped('"""Amplitudes times a gain, as a profile."""', "pass"), "no docstring"),
    "origin-is-stated": (
        swapped('produces = ports("profile")', 'produces = ports("profile"); fidelity = "from-source"'),
        "none in",
    ),
    "parameters-are-documented": (swapped(', description="Factor."', ""), "none for gain"),
    "defaults-are-valid": (swapped("Field(2.0", "Field(-2.0"), "gain: Input should be greater than 0"),
    "unknown-parameters-are-refused": (
        swapped("gain: float", 'model_config = {"extra": "ignore"}\n    gain: float'),
        "the parameter was taken",
    ),
    "parameters-do-not-change": (
        swapped("gain: float", 'model_config = {"frozen": False}\n    gain: float'),
        "'frozen': False",
    ),
    "schema-is-made": (swapped("gain: float = Field(2.0, gt=0, ", "gain: type = Field(int, "), "JsonSchema"),
    "imports-are-light": (swapped("SHARED = []", "import sklearn"), "broken_module.py:8 imports sklearn"),
    "imports-are-public": (
        swapped("SHARED = []", "from uwbbench.config import detector"),
        "imports uwbbench.config.detector",
    ),
    "runs-no-foreign-code": (
        stage("np.load('x.npy', allow_pickle=True) if self.count else 0", PROFILE),
        "allow_pickle=True",
    ),
    "ports-are-sets-of-names": (swapped('ports("profile")', '["profile"]'), "['profile']"),
    "methods-take-what-is-given": (stage("return block.frames.amplitude"), "ndarray"),
    "produces-what-it-declares": (stage("return block"), "no profile"),
    "declares-what-it-makes": (
        stage("block = block.replace(noise_rms=np.zeros(len(block.frames)))", PROFILE),
        "noise undeclared",
    ),
    "declares-what-it-changes": (
        stage(
            "frames = block.frames.with_preamble(2 * block.frames.preamble)",
            PROFILE.replace("(profile", "(frames=frames, profile"),
        ),
        "frames: ",
    ),
    "uses-only-what-it-declares": (
        stage(
            "late = block.part('first_path')", "return block.replace(profile=block.frames.amplitude - late[:, None])"
        ),
        "without it: a stage uses 'first_path'",
    ),
    "frames-stay-in-order": (
        stage(
            "frames = block.frames.part(0, len(block.frames) // 2)",
            "return block.replace(frames=frames, profile=frames.amplitude)",
        ),
        "64 frames",
    ),
    "stream-equals-batch": (
        stage(
            "amplitude = block.frames.amplitude",
            "return block.replace(profile=amplitude - amplitude.mean() if len(block.frames) else amplitude)",
        ),
        "profile: ",
    ),
    "open-starts-anew": (
        swapped(
            "        self.count = 0\n",
            "        self.count = getattr(self, 'count', 0)\n",
            stage(
                "self.count += len(block.frames)",
                "profile = block.frames.amplitude + self.count",
                "return block.replace(profile=profile)",
            ),
        ),
        "against",
    ),
    "background-may-come-in-blocks": (
        swapped("max(self.level, block.frames.amplitude.max(initial=0.0))", "block.frames.amplitude.sum()", SHOWN),
        "profile: ",
    ),
    "instances-share-nothing": (
        stage(
            "SHARED.append(len(block.frames))",
            "first = sum(SHARED) - len(block.frames) == block.frames.first",
            "return block.replace(profile=block.frames.amplitude * (1 if first or not len(block.frames) else 2))",
        ),
        "profile: ",
    ),
    "no-frames-are-fine": (stage("block.frames.amplitude.max()", PROFILE), "ValueError: zero-size array"),
    "notes-come-from-note": (stage("self.notes.append('seen')", PROFILE), "seen"),
    "same-twice": (
        stage(
            "profile = np.random.default_rng().normal(size=block.frames.preamble.shape)",
            "return block.replace(profile=profile)",
        ),
        "profile: ",
    ),
    "same-in-another-process": (
        stage("gain = 1 + hash('gain') % 2**40", "return block.replace(profile=block.frames.amplitude * gain)"),
        "hash ",
    ),
    "inputs-unchanged": (stage("block.frames.preamble[:] *= 2", PROFILE), "attempt to write"),
    "prints-nothing": (stage("print('at work')", PROFILE), "'at work'"),
    "warns-of-nothing": (stage("import warnings", "warnings.warn('slow', stacklevel=2)", PROFILE), "UserWarning: slow"),
    "leaves-the-process-alone": (stage("np.random.seed(1)", PROFILE), "numpy's global random state"),
    "zero-frames-are-fine": (
        stage(
            "amplitude = block.frames.amplitude",
            "return block.replace(profile=amplitude / amplitude.max(axis=1, keepdims=True))",
        ),
        "RuntimeWarning: invalid value",
    ),
    "constant-frames-are-fine": (
        stage(
            "amplitude = block.frames.amplitude",
            "return block.replace(profile=amplitude / np.ptp(amplitude, axis=1)[:, None])",
        ),
        "RuntimeWarning",
    ),
    "invalid-frames-are-fine": (
        stage("if len(block.frames) > 5 and not block.frames.valid.any(): raise KeyError(5)", PROFILE),
        "KeyError: 5",
    ),
    "faint-samples-are-fine": (
        stage("power = block.frames.amplitude ** 2", "return block.replace(profile=1 / power)"),
        "RuntimeWarning: divide by zero",
    ),
    "loud-samples-are-fine": (stage("return block.replace(profile=block.frames.amplitude ** 60)"), "overflow"),
    "single-precision-is-fine": (
        stage("if block.frames.preamble.dtype != np.complex128: raise TypeError('complex128')", PROFILE),
        "TypeError: complex128",
    ),
    "spikes-are-fine": (
        stage(
            "amplitude = block.frames.amplitude",
            "return block.replace(profile=amplitude / np.median(amplitude, axis=1)[:, None])",
        ),
        "RuntimeWarning",
    ),
    "short-frames-are-fine": (stage("return block.replace(profile=block.frames.amplitude[:, [30]])"), "IndexError"),
    "no-noise-taps-are-fine": (stage("1 / self.radar.noise_taps", PROFILE), "ZeroDivisionError"),
    "no-channel-is-fine": (stage("gain = {5: 1, 9: 2}[self.radar.channel]", PROFILE), "KeyError: None"),
    "delays-from-transmission-are-fine": (stage("1 / self.radar.baseline_length_m", PROFILE), "ZeroDivisionError"),
    "one-frame-is-in-time": (stage("import time", "time.sleep(0.03 * (len(block.frames) == 1))", PROFILE), ""),
    "threads-agree": (
        stage(
            "import time",
            "SHARED.append(self)",
            "time.sleep(0.05)",
            "crowd = len(SHARED)",
            "SHARED.remove(self)",
            "return block.replace(profile=block.frames.amplitude * crowd)",
        ),
        "profile: ",
    ),
    "filters-reject-nan": (
        swapped('block.detections["tap"] > 10', '~(block.detections["tap"] <= 10)', FILTER),
        "rows of NaN kept",
    ),
    "filters-give-a-mask": (
        swapped('block.detections["tap"] > 10', 'np.flatnonzero(block.detections["tap"] > 10)', FILTER),
        "int64",
    ),
    "rowwise-is-true": (
        swapped('block.detections["tap"] * 2', "np.arange(len(block.detections)) * 1.0", ROWS),
        "rank: ",
    ),
    "no-rows-are-fine": (
        swapped("return block.with", "block.detections['tap'].min()\n        return block.with", ROWS),
        "ValueError",
    ),
    "finds-something": (
        stage(
            "return block.replace(detections=Detections.empty(block.frames.index))",
            source=swapped('ports("profile")', 'ports("detections")'),
        ),
        "none in 128 frames",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("check", BROKEN)
def test_a_broken_stage_is_caught_by_the_check_that_is_about_it(judged, check):
    source, found = BROKEN[check]
    result = judged("stage", source, check)
    assert result.status in ("failed", "error"), result
    assert found in result.found
    assert result.expected
    assert "read more" in result.explain()


def test_every_check_of_stages_is_broken_once():
    assert {one.name for one in all_checks("stage")} == BROKEN.keys()


@pytest.mark.slow
@pytest.mark.parametrize("source", [GOOD, FILTER, ROWS, SHOWN])
def test_the_same_stage_unbroken_passes_all(examine_plugin, source):
    found = examine_plugin("stage", source)
    assert found.passed, [one.explain() for one in found.results if not one.passed]


def test_an_undeclared_column_that_decides_what_is_kept_is_named(judged):
    source = swapped('ports("detections", "tap")', 'ports("detections")', FILTER)
    assert "no use of tap" in judged("stage", source, "uses-only-what-it-declares").expected


def test_an_undeclared_column_that_is_taken_where_it_is_there_is_told_and_allowed(judged):
    source = swapped('["tap"] * 2', '["tap"] + np.nan_to_num(block.detections["azimuth_rad"])', ROWS)
    assert judged("stage", source, "uses-only-what-it-declares").detail == "optional: azimuth_rad"


def test_samples_that_are_used_undeclared_are_found_by_other_samples(judged):
    source = swapped('ports("frames")', "ports()")
    assert "other samples give" in judged("stage", source, "uses-only-what-it-declares").found


def test_a_port_that_nobody_makes_is_named(judged):
    source = swapped('ports("frames")', 'ports("frames", "phase_of_moon")')
    assert "'phase_of_moon'" in judged("stage", source, "stream-equals-batch").found
