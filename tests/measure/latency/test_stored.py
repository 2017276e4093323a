"""Latencies in run folders, written now and by earlier versions."""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from uwbbench.results import Report
from uwbbench.results.comparison.scores import time_changes
from uwbbench.results.pareto import speeds_of_run
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.show.text.report import markdown

ADDED = (
    "timed",
    "step",
    "age",
    "missed_share_low",
    "missed_share_high",
    "clock_us",
    "plain",
    "paced",
    "instructions_per_frame",
    "instructions_note",
    "memory_growth_bytes",
    "resident_growth_bytes",
    "growth_frames",
    "quality",
    "machine",
)
"""Facts that the first run folders do not hold."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    tmp_path = tmp_path_factory.mktemp("latency")
    text = "schema: 1\ndetectors: ['null']\ndatasets: [{use: approach, params: {speed_m_s: 3.0}}]\nstability: false\n"
    text += "latency: {reference: 'null', frames: 40, paced_s: 0.2, rate_hz: 100}\n"
    (tmp_path / "tiny.yaml").write_text(text)
    return run_experiment(read_experiment(tmp_path / "tiny.yaml"), tmp_path / "run", jobs=1)


@pytest.mark.slow
def test_every_call_of_the_paced_pass_is_stored(folder: RunFolder) -> None:
    (entry,) = [entry for entry in folder.entries() if entry.kind == "latency"]
    times_us = folder.times_us(f"{entry.unit}-paced")
    assert len(times_us) == entry.facts["paced"]["n"] == 20
    assert entry.facts["paced"]["p50_us"] == pytest.approx(np.median(times_us))


@pytest.mark.slow
def test_runs_of_earlier_versions_are_still_reported(folder: RunFolder, tmp_path: Path) -> None:
    earlier = RunFolder(shutil.copytree(folder.path, tmp_path / "earlier"))
    journal = earlier.path / "journal.jsonl"
    lines = []
    for line in map(json.loads, journal.read_text().splitlines()):
        for name in ADDED:
            line.get("facts", {}).pop(name, None)
        if ratio := line.get("facts", {}).get("ratio_to_reference"):
            line["facts"]["ratio_to_reference"] = {
                key: ratio[key] for key in ("reference", "ratio", "low", "high", "blocks")
            }
        lines.append(json.dumps(line))
    journal.write_text("\n".join(lines) + "\n")
    (times,) = [path for path in (earlier.path / "times").iterdir() if "paced" not in path.name]
    pq.write_table(pq.read_table(times).select(["time_us"]), times)
    report = Report(earlier)
    row = report.latency.iloc[0]
    assert (row["n"], row["timed"], row["step_p50_us"]) == (40, "step", row["p50_us"])
    text = markdown(report)
    assert "THIS MACHINE ONLY" in text
    assert "null: measured by an earlier version, which timed the step alone" in text
    assert "of the step alone, and hold on this machine only" in text
    (unit,) = [entry.unit for entry in earlier.entries() if entry.kind == "latency"]
    assert np.array_equal(earlier.step_times_us(unit), earlier.times_us(unit))


@pytest.mark.slow
def test_times_of_the_step_alone_are_not_compared_with_times_to_rows(folder: RunFolder, tmp_path: Path) -> None:
    earlier = RunFolder(shutil.copytree(folder.path, tmp_path / "earlier"))
    journal = earlier.path / "journal.jsonl"
    lines = [json.loads(line) for line in journal.read_text().splitlines()]
    for line in lines:
        line["facts"].pop("timed", None)
    journal.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert time_changes(folder, folder)[0]
    compared, missing = time_changes(earlier, folder)
    assert compared == []
    assert missing == [
        "times not compared: those of the first run are of the step alone, of the second from samples to rows"
    ]
    mixed = [*folder.entries(), *earlier.entries()]
    assert {speed.timed for speed in speeds_of_run(mixed).values()} == {"samples to rows"}


def test_the_step_alone_of_every_call_is_stored_beside_its_time(folder: RunFolder) -> None:
    (entry,) = [entry for entry in folder.entries() if entry.kind == "latency"]
    step_us = folder.step_times_us(entry.unit)
    assert np.all(step_us < folder.times_us(entry.unit))
    assert entry.facts["step"]["p50_us"] == np.median(step_us)
    row = Report(folder).latency.iloc[0]
    assert (row["timed"], row["step_p50_us"]) == ("samples to rows", np.median(step_us))
