"""What the tests of compiled functions share: a small module of them, its machine code, and empty places for it."""

import importlib.util
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from uwbbench.api import compiled_files
from uwbbench.api.compiling import compile_counts

SOURCE = """\
import numpy as np
from uwbbench.api.compiling import compiled

SCALE = 2.0


@compiled
def scaled(value):
    return value * SCALE


@compiled
def total(values):
    sum_ = values[0] * 0
    for value in values:
        sum_ += scaled(value)
    return sum_
"""
VALUES = np.arange(5.0)


def imported(path: Path) -> ModuleType:
    """The module as another process would import it: with nothing compiled yet."""
    spec = importlib.util.spec_from_file_location("kernels", path)
    module = sys.modules["kernels"] = importlib.util.module_from_spec(spec)
    code = compile(path.read_text(), str(path), "exec")  # never from a .pyc, whose stamp counts whole seconds
    exec(code, module.__dict__)  # noqa: S102
    return module


def kept(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.kernel"))


def block(folder: Path) -> None:
    """Put a file where a folder would be: nobody, not even root, can write into that."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.touch()


@pytest.fixture(autouse=True)
def user_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache folder of the user; what was told before is told again."""
    monkeypatch.delenv("UWBBENCH_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(compiled_files, "_warned", set())
    monkeypatch.setitem(sys.modules, "kernels", ModuleType("kernels"))  # as it is replaced in a test, gone after it
    return tmp_path / "cache" / "uwbbench" / "compiled"


@pytest.fixture
def source(tmp_path: Path) -> Path:
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "kernels.py").write_text(SOURCE)
    return tmp_path / "package" / "kernels.py"


@pytest.fixture
def fresh() -> Iterator[Callable[[], int]]:
    """How many functions were compiled since last asked."""
    last = compile_counts().fresh

    def count() -> int:
        nonlocal last
        before, last = last, compile_counts().fresh
        return last - before

    return count
