"""Plugins that want to end the program, or to change what the others are given."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from uwbbench.api import Capture, Frames
from uwbbench.api.interruption import by_plugin, listening
from uwbbench.cli import app
from uwbbench.run import run_experiment
from uwbbench.run.experiment import Experiment

MakeExperiment = Callable[..., Experiment]
DetectorFile = Callable[..., Path]

ENDS = {
    "exit": "SystemExit: 0",
    "interrupt": "KeyboardInterrupt",
    "close": "GeneratorExit",
    "other": "BaseException: of",
}


@pytest.mark.parametrize("how", ENDS)
def test_a_stage_that_asks_the_program_to_end_is_a_failed_unit(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path, how: str
) -> None:
    bad = detector_file("bad", f"{{use: misbehaving.end, params: {{how: {how}}}}}")
    folder = run_experiment(make_experiment(f"[{bad}, 'null']"), tmp_path / "run", jobs=1)
    entries = {entry.detector: entry for entry in folder.entries()}
    assert (entries["bad"].status, entries["null"].status) == ("failed", "done")
    assert entries["bad"].reason.startswith(ENDS[how])


@pytest.mark.slow
def test_a_stage_that_asks_a_worker_to_end_is_a_failed_unit(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path
) -> None:
    bad = [detector_file(how, f"{{use: misbehaving.end, params: {{how: {how}}}}}") for how in ("exit", "interrupt")]
    experiment = make_experiment(f"[{bad[0]}, {bad[1]}, 'null']", stability="true")
    folder = run_experiment(experiment, tmp_path / "run", jobs=2)
    entries = {(entry.kind, entry.detector): entry for entry in folder.entries()}
    assert entries["accuracy", "null"].status == entries["stability", "null"].status == "done"
    for how in ("exit", "interrupt"):
        assert entries["accuracy", how].reason.startswith(ENDS[how])
        assert entries["stability", how].status == "failed"


@pytest.mark.parametrize("how", ["exit", "interrupt"])
def test_a_command_never_succeeds_by_the_wish_of_a_plugin(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path, how: str
) -> None:
    from uwbbench.api import write_capture

    capture = make_experiment().datasets[0].references()[0].open()
    write_capture(tmp_path / "approach.h5", capture)
    bad = detector_file("bad", f"{{use: misbehaving.end, params: {{how: {how}}}}}")
    words = ["detect", str(tmp_path / "approach.h5"), "--detector", str(bad), "--output", str(tmp_path / "found.csv")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code in (2, 130), done.output
    assert "asked the program to end" in done.stderr or "interrupted" in done.stderr


WRITTEN = (
    "preamble",
    "sts1",
    "timestamp_s",
    "position_m",
    "yaw_rad",
    "valid",
    "first_path_index",
    "outline_m",
    "track_m",
)


def test_what_a_stage_is_handed_cannot_be_changed_for_the_others(
    make_experiment: MakeExperiment, detector_file: DetectorFile, tmp_path: Path, misbehaving: Path
) -> None:
    captures = "[{use: approach, params: {speed_m_s: 3.0, sts: true}}]"
    alone = run_experiment(make_experiment("[paper]", datasets=captures), tmp_path / "alone", jobs=1)
    bad = [detector_file(name, f"{{use: misbehaving.write, params: {{how: {name}}}}}") for name in WRITTEN]
    experiment = make_experiment(f"[{', '.join(map(str, bad))}, paper]", datasets=captures)
    folder = run_experiment(experiment, tmp_path / "run", jobs=1)
    for entry in folder.entries():
        if entry.detector != "paper":
            assert entry.status == "failed", entry.detector
            assert "read-only" in entry.reason
    scores = folder.scores()
    of_paper = scores[scores["detector"] == "paper"].reset_index(drop=True)
    # Failed rows have no counts, so that whole numbers stand among them as floats.
    pd.testing.assert_frame_equal(of_paper[alone.scores().columns], alone.scores(), check_dtype=False)


def test_no_array_of_a_capture_can_be_written_to(approach: Capture) -> None:
    for frames in (approach.frames(0, 10), approach.frames(0, 10).part(2, 5), approach.frames(0, 1).without_invalid()):
        arrays = {item.name: getattr(frames, item.name) for item in dataclasses.fields(Frames)}
        arrays |= {"amplitude": frames.amplitude}
        assert not [name for name, array in arrays.items() if hasattr(array, "flags") and array.flags.writeable]
    assert approach.truth is not None
    assert not approach.truth.objects[0].outline_m.flags.writeable
    assert not approach.radar.baseline_m.flags.writeable


def test_an_interrupt_is_the_users_where_nobody_listens_and_a_plugins_where_the_user_has_not_asked() -> None:
    assert not by_plugin(KeyboardInterrupt())
    with listening():
        assert by_plugin(KeyboardInterrupt())
    assert not by_plugin(KeyboardInterrupt())
    assert by_plugin(SystemExit(0))
