"""Measurements in a fresh process. Nothing here asserts how long anything takes."""

import dataclasses
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.fixtures.chance import seed
from uwbbench.api import Trajectory, write_capture
from uwbbench.config.detector import detector_from_text, read_detector
from uwbbench.config.source import CaptureRef
from uwbbench.measure.latency import LatencyError, launch, measure
from uwbbench.measure.latency.settings import LatencyModel

REF = CaptureRef("approach", {"speed_m_s": 3.0, "seed": seed()}, (), "approach-ch9-metal-1")


@pytest.mark.slow
def test_a_measurement_is_complete_and_consistent() -> None:
    found = measure(REF, read_detector("paper"), LatencyModel(reference="null"))
    assert found.timed == "samples to rows"
    assert found.n == len(found.times_us) == len(found.step_us) == 45
    assert found.step is not None
    assert found.step["p50_us"] == np.median(found.step_us) < found.p50_us
    assert np.all(found.step_us < found.times_us)
    assert found.age is not None
    assert found.age["end_share"] == 1.0  # fewer than the fifty points that start a clustering
    assert 0 < found.age["p50_frames"] <= found.age["max_frames"] <= 44
    assert found.p50_us == np.median(found.times_us)
    assert found.p90_us == pytest.approx(np.percentile(found.times_us, 90))
    assert (found.p95_us, found.p99_us) == (None, None)
    assert found.deadline_us == pytest.approx(1e6 / 48)
    assert found.throughput_best_us <= found.throughput_us
    assert found.threads == 1
    assert found.startup_s > 0
    assert found.peak_memory_bytes > 10e6
    assert found.ratio_to_reference is not None
    assert found.ratio_to_reference["reference"] == "null"
    assert found.ratio_to_reference["blocks"] >= 32
    assert found.ratio_to_reference["low"] <= found.ratio_to_reference["ratio"] <= found.ratio_to_reference["high"]
    assert found.ratio_to_reference["blocks"] >= found.ratio_to_reference["disturbed_blocks"]
    assert found.ratio_to_reference["total_low"] <= found.ratio_to_reference["total_high"]
    assert found.clustering is not None
    assert found.plain is not None
    assert found.clustering["n"] + found.plain["n"] == found.n
    assert found.clock_us > 0
    assert found.overhead_us > 0
    assert found.missed == 0 or found.missed_share_low > 0
    assert found.missed_share_high >= found.missed_share
    assert found.instructions_per_frame is not None or found.instructions_note.startswith("not counted: ")
    assert found.memory_growth_bytes is not None
    assert {"minor_faults", "involuntary_switches", "load_before", "load_after"} <= set(found.quality)
    assert found.quality["compilations"] == 0
    assert set(found.machine["versions"]) == {"python", "numpy", "numba"}
    assert (found.machine["core"] is not None) == found.pinned
    assert found.paced is None
    assert "times_us" not in found.to_dict()


@pytest.mark.slow
def test_frames_are_handed_out_at_a_rate_where_that_is_asked_for() -> None:
    settings = LatencyModel(reference=None, frames=10, paced_s=0.5, rate_hz=100.0)
    found = measure(REF, read_detector("null"), settings)
    assert found.paced is not None
    assert (found.paced["n"], found.paced["rate_hz"], found.paced["deadline_us"]) == (50, 100.0, 10000.0)
    assert len(found.paced_times_us) == 50
    assert found.paced["p50_us"] == pytest.approx(np.median(found.paced_times_us))


BUSY = """\
import math

from uwbbench.api import Detections, Params, Stage, ports


class Work(Params):
    rounds: int = 1


class Busy(Stage[Work]):
    \"\"\"Takes its time and finds nothing.\"\"\"

    produces = ports("detections")

    def step(self, block):
        for _ in range(500 * self.params.rounds):
            math.sqrt(2.0)
        return block.replace(detections=Detections.empty())
"""


@pytest.mark.slow
def test_a_detector_that_does_three_times_the_work_is_found_slower(
    install_plugin: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder = install_plugin("busy", {"stages": {"test.busy": "busy_stage:Busy"}}, {"busy_stage.py": BUSY})
    monkeypatch.setenv("PYTHONPATH", str(folder))
    text = "schema: 1\nname: {0}\npipeline:\n  - {{use: test.busy, params: {{rounds: {1}}}}}\n"
    (tmp_path / "once.yaml").write_text(text.format("once", 2))
    thrice = detector_from_text(text.format("thrice", 6))
    found = measure(REF, thrice, LatencyModel(reference=str(tmp_path / "once.yaml"), blocks=31)).ratio_to_reference
    assert found is not None
    assert found["reference"] == "once"
    assert found["low"] > 1
    assert found["ratio"] > 1.5


@pytest.mark.slow
def test_only_the_asked_frames_are_timed_and_that_is_said() -> None:
    found = measure(REF, read_detector("null"), LatencyModel(frames=10, reference=None))
    assert found.n == 10
    assert found.ratio_to_reference is None
    assert "timed the first 10 of 45 frames" in found.notes


@pytest.mark.slow
def test_parameters_by_channel_and_odd_names_reach_the_process() -> None:
    text = "schema: 1\nname: \"a\\n'b' | 10:30\"\npipeline:\n  - use: reference.constant\n    params:\n"
    text += "      range_m: {by_channel: {5: 0.5, 9: 1.5, other: 2.5}}\n"
    found = measure(REF, detector_from_text(text), LatencyModel(frames=3, reference=None))
    assert found.n == 3


def test_a_capture_that_cannot_be_opened_is_named() -> None:
    ref = CaptureRef("capture", {"files": ["gone.h5"]}, ("/nowhere",), "gone")
    with pytest.raises(LatencyError, match=r"could not be timed \(exit code 2\): .*gone"):
        measure(ref, read_detector("null"), LatencyModel(reference=None))


def test_an_empty_capture_says_that_there_is_nothing_to_time(tmp_path: Path) -> None:
    whole = REF.open()
    assert whole.sts1 is not None
    assert whole.sts2 is not None
    none = slice(0, 0)
    track = whole.trajectory
    tracks = dict.fromkeys(("first_path_index", "first_path_index_sts1", "first_path_index_sts2"))
    empty = dataclasses.replace(
        whole,
        radar=dataclasses.replace(whole.radar, has_sts=False, has_first_path=False),
        preamble=np.asarray(whole.preamble[none]),
        sts1=None,
        sts2=None,
        trajectory=Trajectory(track.timestamp_s[none], track.position_m[none], track.yaw_rad[none]),
        **tracks,
    )
    write_capture(tmp_path / "empty.h5", empty)
    ref = CaptureRef.of_file(tmp_path / "empty.h5")
    with pytest.raises(LatencyError, match="has no frames"):
        measure(ref, read_detector("null"), LatencyModel(reference=None))


def test_a_measurement_that_takes_too_long_is_given_up() -> None:
    with pytest.raises(LatencyError, match=r"'null' was not timed within 0\.01 s"):
        measure(REF, read_detector("null"), LatencyModel(reference=None, timeout_s=0.01))


def test_what_a_dying_process_said_is_kept() -> None:
    code = "import sys, os; sys.stderr.write('first\\nlast words\\n'); sys.stderr.flush(); os.kill(os.getpid(), 9)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    error = launch._failure("name", done)
    assert str(error) == "detector 'name' could not be timed (killed by signal 9): last words"
    assert error.__notes__ == ["first\nlast words"]


@pytest.mark.slow
def test_a_file_of_the_current_folder_is_not_mistaken_for_a_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit('wrong json')")
    monkeypatch.chdir(tmp_path)
    assert measure(REF, read_detector("null"), LatencyModel(frames=1, reference=None)).n == 1
