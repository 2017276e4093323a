"""What a detector does to its process: a row of its own at worst, and nothing to the others."""

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from uwbbench.run import run_experiment
from uwbbench.run.experiment import Experiment

MakeExperiment = Callable[..., Experiment]
DetectorFile = Callable[..., Path]

HOSTILE = '''
import ctypes, os, sys, threading, time, warnings
import numpy as np
from uwbbench.api import Block, Detections, Params, Stage, ports


class How(Params):
    how: str


def score_all_well():
    import uwbbench.run.unit as unit

    real = unit.score_rows
    unit.score_rows = lambda *given: [{**row, "tp": 10**6} for row in real(*given)]


def other_settings():
    np.seterr(all="raise")
    warnings.simplefilter("error")
    sys.setrecursionlimit(120)
    os.environ.clear()
    sys.path.clear()
    os.chdir("/")


def write_poses(block):
    for array in (block.frames.position_m, block.frames.preamble):
        array.setflags(write=True)
        array[...] = 0


class Hostile(Stage[How]):
    """Does harm to the process that it is in, in the way that it is asked to."""

    consumes = ports("frames")
    produces = ports("detections")

    def step(self, block: Block) -> Block:
        match self.params.how:
            case "hangs":
                time.sleep(600)
            case "hangs natively":
                ctypes.CDLL(None).pause()
            case "exits":
                os._exit(0)
            case "crashes":
                ctypes.string_at(0)
            case "closes":
                os.closerange(0, 256)
            case "cheats":
                score_all_well()
            case "unsettles":
                other_settings()
            case "writes":
                write_poses(block)
            case "stays":
                threading.Thread(target=time.sleep, args=(600,)).start()
            case "prints":
                print("FOUND IT")
                os.write(1, b"FOUND IT")
            case "recurses":
                return self.step(block)
        return block.replace(detections=Detections.empty())
'''

POINTS = "[uwbbench.stages]\nhostile = uwbbench_hostile:Hostile\n"

FAIL = {
    "hangs": "took longer than 3 s, its limit (limits.unit_s)",
    "hangs natively": "took longer than 3 s, its limit (limits.unit_s)",
    "exits": "its process ended itself (exit code 0)",
    "crashes": "its process was ended by SIGSEGV",
    "closes": "its process closed the line to the run",
    "recurses": "RecursionError: maximum recursion depth exceeded",
    "writes": "ValueError: cannot set WRITEABLE flag to True of this array",
}
DONE = ("cheats", "unsettles", "stays", "prints")


@pytest.fixture
def hostile(install_plugin, detector_file: DetectorFile) -> Callable[[str], Path]:
    """Files of detectors that do harm."""
    install_plugin("hostile", {"stages": {"hostile": "uwbbench_hostile:Hostile"}}, {"uwbbench_hostile.py": HOSTILE})
    return lambda how: detector_file(how, f"{{use: hostile, params: {{how: {json.dumps(how)}}}}}")


def scores_of(folder, detector: str) -> pd.DataFrame:
    scores = folder.scores()
    return scores[scores["detector"] == detector].reset_index(drop=True)


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_detector_is_scored_as_if_it_were_alone(
    make_experiment: MakeExperiment, hostile, tmp_path: Path, capfd, jobs: int
) -> None:
    datasets = "[{use: approach, params: {speed_m_s: 3.0, runs: 2}}]"
    alone = run_experiment(make_experiment("[cfar-os]", datasets=datasets), tmp_path / "alone", jobs=1)
    names = [json.dumps(str(hostile(how))) for how in (*FAIL, *DONE)]
    experiment = make_experiment(f"[{', '.join([*names, 'cfar-os'])}]", datasets=datasets, limits="{unit_s: 3}")
    folder = run_experiment(experiment, tmp_path / "run", jobs=jobs)
    reasons = {entry.detector: entry.reason for entry in folder.entries()}
    assert {how: reasons[how][: len(said)] for how, said in FAIL.items()} == FAIL
    assert {reasons[how] for how in (*DONE, "cfar-os")} == {""}
    expected = scores_of(alone, "cfar-os")
    pd.testing.assert_frame_equal(scores_of(folder, "cfar-os")[expected.columns], expected, check_dtype=False)
    assert set(scores_of(folder, "cheats")["tp"]) == {0}
    assert "FOUND IT" not in capfd.readouterr().out


def test_one_unit_that_takes_its_process_down_is_an_entry_of_a_sealed_run(
    make_experiment: MakeExperiment, hostile, tmp_path: Path
) -> None:
    folder = run_experiment(make_experiment(f"[{hostile('crashes')}]"), tmp_path / "run", jobs=1)
    (entry,) = folder.entries()
    assert (entry.status, entry.reason) == ("failed", FAIL["crashes"])
    assert folder.sealed
    assert folder.intact


def test_a_detector_that_is_no_faster_than_its_limit_is_named_with_the_limit(
    make_experiment: MakeExperiment, hostile, tmp_path: Path
) -> None:
    folder = run_experiment(
        make_experiment(f"[{hostile('hangs')}, oracle]", limits="{unit_s: 1.5}"), tmp_path / "run", jobs=1
    )
    entries = {entry.detector: entry for entry in folder.entries()}
    assert entries["hangs"].reason == "took longer than 1.5 s, its limit (limits.unit_s)"
    assert entries["oracle"].status == "done"
    assert folder.manifest["sessions"][0]["limits"] == {"unit_s": 1.5, "memory_mb": None}


def test_without_isolation_everything_runs_here_and_the_run_says_so(
    make_experiment: MakeExperiment, tmp_path: Path
) -> None:
    apart = run_experiment(make_experiment("[cfar-os]"), tmp_path / "apart", jobs=1)
    here = run_experiment(make_experiment("[cfar-os]"), tmp_path / "here", isolated=False)
    assert here.manifest["sessions"][0]["isolated"] is False
    pd.testing.assert_frame_equal(here.scores(), apart.scores())
