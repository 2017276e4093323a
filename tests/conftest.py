"""Captures that many tests share."""

import gc
import importlib
import os
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from hypothesis import settings

from tests.fixtures.chance import SHIFT, seed
from uwbbench.api import Capture, registry
from uwbbench.api.registry import load_plugin

pytest_plugins = [
    "tests.fixtures.shared",
    "tests.fixtures.compiling",
    "tests.fixtures.runs",
    "tests.fixtures.drives",
    "tests.fixtures.contributions",
]

# The same examples on every machine, however slow; others, and more of them, come with another seed.
settings.register_profile("usual", derandomize=SHIFT == 0, max_examples=40 if SHIFT == 0 else 100, deadline=None)
settings.load_profile("usual")

# The file that compiles every shipped detector, and rooms whose tests compile next to nothing: two workers that start
# with one and the others do not compile the same at the same time.
_COMPILES_ALL = "detect/test_shipped_detectors.py"
_COMPILE_LITTLE = ("config", "api", "measure/accuracy", "tools/fit", "docs")


# Every other worker goes through the files from the last to the first: from a fresh checkout both would rewrite and
# compile every file of tests at the same time, and so each does half of them and finds the other half on disk.
_FROM_THE_LAST = os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:] in ("1", "3", "5", "7")

# What is imported to stay need not be looked through for garbage again and again.
gc.disable()


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    """List the files of a folder from the last to the first, in a worker that goes so."""
    report = yield
    if _FROM_THE_LAST and isinstance(collector, pytest.Session | pytest.Directory) and report.passed:
        report.result.reverse()
    return report


@pytest.hookimpl(tryfirst=True)  # before pytest groups tests by fixture, which hangs on their order
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put first what compiles all, then what compiles little; else by name, whichever way they were found."""

    @cache
    def place(path: Path) -> tuple[int, tuple[str, ...]]:
        here = Path(__file__).parent
        inside = path.relative_to(here).as_posix() if path.is_relative_to(here) else ""
        return 0 if inside == _COMPILES_ALL else 1 if inside.startswith(_COMPILE_LITTLE) else 2, path.parts

    items.sort(key=lambda item: place(item.path))
    gc.collect()
    gc.freeze()
    gc.enable()


_DATA = Path(os.environ.get("UWBBENCH_DATA", Path(__file__).parents[2] / "shared" / "data"))


def simulated_approach(**params: object) -> Capture:
    """One run of the built-in simulated approach."""
    adapter = load_plugin("datasets", "approach")
    dataset = adapter(adapter.params_type().model_validate({"seed": seed(), **params}), ())
    return dataset.open(dataset.names()[0])


@pytest.fixture(scope="module", autouse=True)
def names_of_this_file() -> Iterator[None]:
    """Take back the names of plugins that tests of a file have given: the next would find them among the shipped."""
    before = dict(registry._registered)
    yield
    if registry._registered != before:
        registry._registered.clear()
        registry._registered.update(before)
        registry.entries.cache_clear()
        registry.load_plugin.cache_clear()


@pytest.fixture(scope="session")
def approach() -> Capture:
    """A metal plate approached on channel 9, with STS."""
    return simulated_approach()


@pytest.fixture(scope="session")
def approach_without_sts() -> Capture:
    """The same plate, without STS."""
    return simulated_approach(sts=False)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the measured captures; tests that need them skip where it is missing."""
    if not _DATA.is_dir():
        pytest.skip(f"measured captures not found in {_DATA}; set UWBBENCH_DATA")
    return _DATA


@pytest.fixture
def install_plugin(tmp_path, monkeypatch):
    """Install a small distribution: ``install_plugin("name", {"stages": {...}}, {"module.py": source})``."""

    def forget() -> None:
        for known in (registry.entries, registry.load_plugin):
            known.cache_clear()
        importlib.invalidate_caches()

    def install(name: str, groups: dict[str, dict[str, str]], files: dict[str, str]) -> Path:
        folder = tmp_path / f"site-{name}"
        facts = folder / f"{name}-1.0.dist-info"
        facts.mkdir(parents=True)
        (facts / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = []
        for kind, points in groups.items():
            lines += [f"[uwbbench.{kind}]", *(f"{key} = {target}" for key, target in points.items())]
        (facts / "entry_points.txt").write_text("\n".join(lines))
        for path, text in files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text)
        monkeypatch.syspath_prepend(str(folder))
        forget()
        return folder

    before = set(sys.modules)
    yield install
    monkeypatch.undo()
    for module in set(sys.modules) - before:
        if str(tmp_path) in str(getattr(sys.modules[module], "__file__", "")):
            del sys.modules[module]
    forget()
