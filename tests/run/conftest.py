"""What the tests of runs share: small experiments on the built-in capture, and a plugin that misbehaves."""

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from joblib.externals.loky import get_reusable_executor

from tests.fixtures.chance import reseeded
from uwbbench.api import registry
from uwbbench.run.experiment import Experiment, read_experiment

MISBEHAVING = '''
import os, pathlib, time
from uwbbench.api import Card, Dataset, Detections, Params, Stage, ports

class Crash(Stage[Params]):
    """Takes its process down."""
    produces = ports("detections")
    def step(self, block):
        os._exit(7)

class FileParams(Params):
    file: str = ""

class Raise(Stage[FileParams]):
    """Fails unless a file is there."""
    produces = ports("detections")
    def step(self, block):
        if not pathlib.Path(self.params.file).is_file():
            raise ValueError("no luck\\ntoday | at all")
        return block.replace(detections=Detections.empty())

class Wait(Stage[FileParams]):
    """Waits for a file, and finds nothing."""
    produces = ports("detections")
    def step(self, block):
        while not pathlib.Path(self.params.file).is_file():
            time.sleep(0.05)
        return block.replace(detections=Detections.empty())

class HowParams(Params):
    how: str = "SystemExit(0)"

class End(Stage[HowParams]):
    """Asks the program to end."""
    produces = ports("detections")
    def step(self, block):
        raise {
            "exit": SystemExit(0),
            "interrupt": KeyboardInterrupt(),
            "close": GeneratorExit(),
            "other": BaseException("of no known kind"),
        }[self.params.how]

class Write(Stage[HowParams]):
    """Writes into what it is handed."""
    needs = frozenset({"truth", "sts"})
    produces = ports("detections")
    def show_truth(self, truth, trajectory):
        self.shown = {"outline_m": truth.objects[0].outline_m, "track_m": trajectory.position_m}
    def step(self, block):
        values = self.shown.get(self.params.how)
        if values is None:
            values = getattr(block.frames, self.params.how)
        values[:] = 0
        return block.replace(detections=Detections.empty())

class NoListing(Dataset[Params]):
    """Cannot say what it holds."""
    card = Card(title="t", license="l", citation="c", source="s")
    def names(self):
        raise RuntimeError("the shelf is empty")
'''

ENTRY_POINTS = """\
[uwbbench.stages]
misbehaving.crash = misbehaving:Crash
misbehaving.raise = misbehaving:Raise
misbehaving.wait = misbehaving:Wait
misbehaving.end = misbehaving:End
misbehaving.write = misbehaving:Write
[uwbbench.datasets]
misbehaving.listing = misbehaving:NoListing
"""


@pytest.fixture
def make_experiment(tmp_path: Path) -> Callable[..., Experiment]:
    """Write an experiment file and read it: two detectors on 45 frames, without latency, unless told otherwise."""

    def make(detectors: str = "[oracle, paper-filtering]", **keys: Any) -> Experiment:
        lines = {"schema": 1, "detectors": detectors, "latency": "false", "stability": "false"}
        lines["datasets"] = "[{use: approach, params: {speed_m_s: 3.0}}]"
        path = tmp_path / "tiny.yaml"
        path.write_text(reseeded("".join(f"{key}: {value}\n" for key, value in {**lines, **keys}.items())))
        return read_experiment(path)

    return make


@pytest.fixture
def misbehaving(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An installed package whose stages fail; its folder."""
    site = tmp_path / "site"
    info = site / "misbehaving-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "misbehaving.py").write_text(MISBEHAVING)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: misbehaving\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(site)
    monkeypatch.setenv("PYTHONPATH", str(site))
    registry.entries.cache_clear()
    registry.load_plugin.cache_clear()
    get_reusable_executor().shutdown(wait=True)  # idle workers of an earlier test know nothing of the package
    yield site
    registry.entries.cache_clear()
    registry.load_plugin.cache_clear()
    get_reusable_executor().shutdown(wait=True)


@pytest.fixture
def detector_file(tmp_path: Path) -> Callable[..., Path]:
    """Write a detector file of a name and its steps."""

    def write(name: str, *steps: str) -> Path:
        path = tmp_path / f"{hashlib.sha256(name.encode()).hexdigest()[:8]}.yaml"
        lines = "".join(f"  - {step}\n" for step in steps)
        path.write_text(f"schema: 1\nname: {json.dumps(name, ensure_ascii=False)}\npipeline:\n{lines}", "utf-8")
        return path

    return write
