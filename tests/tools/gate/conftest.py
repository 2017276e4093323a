"""What the tests of gates share: a small capture, gate files, and stages that wait or crash in worker processes."""

from collections.abc import Callable
from pathlib import Path

import pytest
import waiting

from tests.fixtures.chance import seed
from uwbbench.api import registry, write_capture
from uwbbench.config.source import open_dataset


@pytest.fixture(scope="session")
def capture_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated capture of some seconds."""
    dataset = open_dataset("approach", {"speed_m_s": 0.25, "seed": seed()}, [])
    path = tmp_path_factory.mktemp("capture") / "run.h5"
    write_capture(path, dataset.open(dataset.names()[0]))
    return path


@pytest.fixture
def write_gate(tmp_path: Path, capture_file: Path) -> Callable[..., Path]:
    """Write a gate file; head and captures have defaults."""

    def write(**keys: object) -> Path:
        path = tmp_path / "gate.yaml"
        lines = {"schema": 1, "head": "paper-filtering", "captures": f"['{capture_file}']", **keys}
        path.write_text("".join(f"{key}: {value}\n" for key, value in lines.items() if value is not None), "utf-8")
        return path

    return write


@pytest.fixture
def waiting_site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The stages ``test.wait`` and ``test.crash``, here and in worker processes."""
    site = tmp_path / "site"
    waiting.install(site)
    monkeypatch.syspath_prepend(site)
    monkeypatch.setenv("PYTHONPATH", str(site))
    for known in (registry.entries, registry.load_plugin):
        known.cache_clear()
    yield site
    for known in (registry.entries, registry.load_plugin):
        known.cache_clear()
