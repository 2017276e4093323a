"""A detector in C against a shipped one: compiled here, run on the samples of captures, compared in one experiment."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import uwbbench
from uwbbench.api import Capture

SOURCE = Path(__file__).parents[2] / "examples" / "strongest_peak.c"
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
PARAMS = {"speed_m_s": 3.0, "runs": 2}

needs_a_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc or clang) is installed")


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """The compiled detector."""
    target = tmp_path / "strongest_peak"
    assert COMPILER is not None
    done = subprocess.run([COMPILER, "-O2", "-o", target, SOURCE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return target


def run_on(program: Path, capture: Capture, folder: Path) -> Path:
    """Results file of the program on a capture; samples reach it as plain 32-bit amplitudes."""
    samples, results = folder / f"{capture.name}.f32", folder / f"{capture.name}.csv"
    capture.frames().amplitude.astype("<f4").tofile(samples)
    words = [program, samples, str(capture.radar.taps), repr(capture.radar.sample_interval_s)]
    with results.open("w") as file:
        subprocess.run(words, stdout=file, check=True)
    return results


@needs_a_compiler
def test_a_detector_in_c_is_compared_with_a_shipped_one_without_a_plugin(program, tmp_path):
    folder = tmp_path / "peak"
    folder.mkdir()
    dataset = uwbbench.open_dataset("approach", PARAMS)
    for name in dataset.names():
        run_on(program, dataset.open(name), folder)
    run = uwbbench.run(
        {
            "detectors": ["paper-filtering", "null", {"results": str(folder), "name": "C program"}],
            "datasets": [{"use": "approach", "params": PARAMS}],
            "scoring": "frame",
            "latency": False,
            "stability": False,
        },
        tmp_path / "run",
        jobs=1,
    )
    board = run.leaderboard.set_index("detector")
    assert board.loc["C program", "results_file"]
    assert board.loc["C program", "frames"] == board.loc["paper-filtering", "frames"]
    assert board.loc["C program", "recall"] > 0.9 > board.loc["null", "recall"]
    assert run.verify().passed


@needs_a_compiler
def test_what_the_program_writes_is_what_numpy_finds(program, tmp_path):
    dataset = uwbbench.open_dataset("approach", PARAMS)
    capture = dataset.open(dataset.names()[0])
    rows = np.loadtxt(run_on(program, capture, tmp_path), delimiter=",", skiprows=1)
    amplitude = capture.frames().amplitude.astype(np.float32)
    for frame, delay_s, peak in rows:
        taps = amplitude[int(frame)]
        behind = taps[np.argmax(taps) + 5 :]
        maxima = [k for k in range(len(behind) - 1) if taps[-len(behind) + k - 1] < behind[k] >= behind[k + 1]]
        best = max(maxima, key=lambda k: behind[k])
        assert delay_s == pytest.approx((best + 5) * capture.radar.sample_interval_s, rel=1e-8)
        assert peak == pytest.approx(behind[best], rel=1e-6)
