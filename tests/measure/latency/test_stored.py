"""Latencies in run folders, written now and by earlier versions."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from uwbbench.results import Report
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.show.text.report import markdown

ADDED = (
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


def test_every_call_of_the_paced_pass_is_stored(folder: RunFolder) -> None:
    (entry,) = [entry for entry in folder.entries() if entry.kind == "latency"]
    times_us = folder.times_us(f"{entry.unit}-paced")
    assert len(times_us) == entry.facts["paced"]["n"] == 20
    assert entry.facts["paced"]["p50_us"] == pytest.approx(np.median(times_us))


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
    report = Report(earlier)
    assert report.latency.iloc[0]["n"] == 40
    assert "THIS MACHINE ONLY" in markdown(report)
