"""Compiling ahead."""

from pathlib import Path

import numpy as np
import pytest

from uwbbench.api import Capture, open_capture, write_capture
from uwbbench.api.compiling import compile_counts
from uwbbench.api.numba_internals import counts_of
from uwbbench.detect.pipeline import load_detector
from uwbbench.tools.warmup import captures, installed_detectors, warm_up

KERNELS = """\
from uwbbench.api.compiling import compiled


@compiled
def energy(samples):
    total = 0.0
    for frame in samples:
        for sample in frame:
            total += abs(sample) ** 2
    return total
"""
STAGES = """\
from uwbbench.api import Filter, Stage, ports


class Energy(Filter):
    consumes = ports("frames", "detections")

    def keep(self, block):
        from theirs.kernels import energy

        assert energy(block.frames.preamble) >= 0
        return block.detections.frame >= 0


class Sonar(Energy):
    needs = ports("sonar")


class Broken(Energy):
    def keep(self, block):
        raise ZeroDivisionError("far away")
"""
DETECTOR = """\
schema: 1
name: {name}
pipeline:
  - {{use: peaks}}
  - {{use: their.{name}}}
"""
NAMES = ("energy", "sonar", "broken")


@pytest.fixture
def theirs(install_plugin) -> Path:
    """A distribution with three detectors: one that compiles, one that fits no capture, and one that breaks."""
    files = {f"theirs/{name}.yaml": DETECTOR.format(name=name) for name in NAMES}
    return install_plugin(
        "theirs",
        {
            "stages": {f"their.{name}": f"theirs.stages:{name.title()}" for name in NAMES},
            "detectors": {f"their-{name}": f"theirs:{name}.yaml" for name in NAMES},
        },
        {"theirs/__init__.py": "", "theirs/stages.py": STAGES, "theirs/kernels.py": KERNELS, **files},
    )


def run_in_all_ways(name: str, capture: Capture) -> None:
    detector = load_detector(name)
    for candidates in (False, True):
        detector.run(capture, candidates=candidates)
    stream = detector.open(capture)
    for frames in capture.blocks(1):
        stream.step(frames)


def test_the_captures_are_of_all_kinds_that_compiled_functions_tell_apart() -> None:
    kinds = {
        (
            one.radar.channel,
            one.radar.has_sts,
            np.asarray(one.preamble).dtype.name,
        )
        for one in captures()
    }
    assert len(kinds) == 8
    assert {kind[:2] for kind in kinds} == {(5, True), (5, False), (9, True), (9, False)}


@pytest.mark.slow
def test_a_detector_of_another_package_is_compiled_for_all_kinds_of_samples(theirs) -> None:
    (done,) = warm_up(["their-energy"])
    assert (done.detector, done.failure) == ("their-energy", None)
    from theirs.kernels import energy  # type: ignore[import-not-found]

    assert counts_of(energy).fresh == 2  # two precisions
    (again,) = warm_up(["their-energy"])
    assert (again.compiled, again.loaded) == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper", "cfar-ca"])
def test_behind_the_warm_up_no_run_compiles_anything(name, approach, approach_without_sts, tmp_path: Path) -> None:
    assert [one.failure for one in warm_up([name])] == [None]
    before = compile_counts().fresh
    for number, capture in enumerate((approach, approach_without_sts)):
        run_in_all_ways(name, capture)
        write_capture(tmp_path / f"{number}.h5", capture)
        run_in_all_ways(name, open_capture(tmp_path / f"{number}.h5"))
    assert compile_counts().fresh == before


def test_a_detector_that_breaks_or_does_not_fit_does_not_stop_the_others(theirs) -> None:
    names = ["their-broken", "their-sonar", "null"]
    broken, sonar, null = warm_up(names)
    assert broken.failure == "ZeroDivisionError: far away"
    assert sonar.failure.startswith("fits none of the built-in captures: ")
    assert "has no sonar" in sonar.failure
    assert null.failure is None


def test_all_shipped_and_registered_detectors_are_known(theirs) -> None:
    assert {"paper", "null", *(f"their-{name}" for name in NAMES)} <= set(installed_detectors())
