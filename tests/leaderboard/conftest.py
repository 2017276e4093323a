"""Runs as several people would contribute them, and ways to make others of them."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from uwbbench.leaderboard import Content, read_runs, suites
from uwbbench.leaderboard.suites import Suite
from uwbbench.run import rescore, run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.store import Entry, RunFolder
from uwbbench.store.verify import latency_identity

EXPERIMENT = """\
schema: 1
name: suite
detectors: {detectors}
datasets: [{{use: approach, name: plate, params: {{speed_m_s: 0.7, runs: 2}}}}]
scoring: [frame, object]
latency: {latency}
stability: false
gate_m: {gate_m}
"""
TIMED = "{frames: 20, blocks: 8}"

Make = Callable[..., Path]


@pytest.fixture(scope="session")
def make(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Run a variant of the suite into a new folder."""

    def made(name: str, detectors: str, latency: str = "false", gate_m: float = 0.2) -> Path:
        folder = tmp_path_factory.mktemp(name)
        (folder / "suite.yaml").write_text(EXPERIMENT.format(detectors=detectors, latency=latency, gate_m=gate_m))
        return run_experiment(read_experiment(folder / "suite.yaml"), folder / name, jobs=1).path

    return made


@pytest.fixture(scope="session")
def alice(make: Make) -> Path:
    """Three detectors, two of them the same under different names, timed."""
    detectors = "[paper-filtering, {use: paper-filtering, name: twin}, 'null']"
    return make("alice", detectors, TIMED)


@pytest.fixture(scope="session")
def bob(make: Make) -> Path:
    """One detector of Alice's, and another one; not timed."""
    return make("bob", "[paper-filtering, cfar-os]")


@pytest.fixture(scope="session")
def carol(make: Make) -> Path:
    """A detector of Alice's name with another threshold."""
    return make("carol", "[{use: paper-filtering, set: {pipeline.filter.prominence.params.minimum: 0.06}}]")


@pytest.fixture(scope="session")
def dave(make: Make) -> Path:
    """The same detector under another gate."""
    return make("dave", "[paper-filtering]", gate_m=0.1)


def suites_of(*paths: Path) -> list[Suite]:
    return suites(read_runs(paths))


def content_of(*paths: Path) -> Content:
    runs = read_runs(paths)
    return Content(suites(runs), runs)


def changed(run: Path, target: Path, change: Callable[[dict[str, Any], list[dict[str, Any]]], None]) -> Path:
    """A copy of a run with another manifest and journal, in itself consistent and sealed."""
    shutil.copytree(run, target)
    manifest = json.loads((target / "manifest.json").read_text())
    entries = [json.loads(line) for line in (target / "journal.jsonl").read_text().splitlines()]
    change(manifest, entries)
    (target / "manifest.json").write_text(json.dumps(manifest))
    (target / "journal.jsonl").write_text("".join(json.dumps(entry) + "\n" for entry in entries))
    folder = RunFolder(target)
    folder.seal()
    rescore(folder)
    return target


def elsewhere(run: Path, target: Path, factor: float, cpu: str = "another processor") -> Path:
    """The same run as another machine would have made it, with other time ratios."""

    def change(manifest: dict[str, Any], entries: list[dict[str, Any]]) -> None:
        manifest["sessions"][-1]["machine"]["cpu"] = cpu
        for entry in entries:
            if entry["kind"] == "latency":
                ratio = entry["facts"]["ratio_to_reference"]
                ratio |= {key: ratio[key] * factor for key in ("ratio", "low", "high")}
                unit = Entry.from_dict(entry)
                sha256 = manifest["data"][unit.capture_id]
                entry["identity"] = latency_identity(manifest, unit, sha256, manifest["sessions"][-1])

    return changed(run, target, change)


def failing(run: Path, target: Path, detector: str, capture: str) -> Path:
    """The same run with a detector that failed on a capture."""

    def change(manifest: dict[str, Any], entries: list[dict[str, Any]]) -> None:
        for entry in entries:
            if (entry["kind"], entry["detector"], entry["capture"]) == ("accuracy", detector, capture):
                entry |= {"status": "failed", "reason": "ValueError: <b>no</b>", "scores": [], "facts": {}}
                entry |= {"identity": "", "capture_id": ""}
        manifest["sessions"][-1]["started"] = "2020-01-01T00:00:00+00:00"

    return changed(run, target, change)
