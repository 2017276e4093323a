"""Compiled functions: machine code that is stale or damaged is made again."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.api.compiled.conftest import SOURCE, VALUES, imported, kept
from uwbbench.api import compiled_files


@pytest.mark.slow
def test_a_changed_source_is_compiled_again_and_what_was_kept_of_it_removed(source: Path, fresh) -> None:
    imported(source).total(VALUES)
    old = kept(source.parent / "__pycache__")
    source.write_text(SOURCE.replace("SCALE = 2.0", "SCALE = 3.0"))
    fresh()
    assert imported(source).total(VALUES) == 30.0
    assert fresh() == 2
    new = kept(source.parent / "__pycache__")
    assert len(new) == 2
    assert not {*old} & {*new}


CALLER = """\
import {module} as other
from {module} import LIMIT, add
from uwbbench.api.compiling import compiled


@compiled
def direct(x):
    return add(x) + LIMIT


@compiled
def dotted(x):
    return other.add(x) + other.LIMIT
"""
CALLEE = """\
from uwbbench.api.compiling import compiled

LIMIT = 10.0


@compiled
def add(x):
    return x + 1.0
"""


@pytest.mark.parametrize("function", ["direct", "dotted"])
@pytest.mark.parametrize(("old", "new", "expected"), [("x + 1.0", "x + 5.0", 15.0), ("= 10.0", "= 20.0", 21.0)])
def test_a_change_in_a_module_that_is_called_or_read_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, function, old, new, expected
) -> None:
    """numba itself looks at the caller's file alone."""
    module = "callee_of_kernels"
    (tmp_path / f"{module}.py").write_text(CALLEE)
    (tmp_path / "caller.py").write_text(CALLER.format(module=module))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(sys.modules, module, imported(tmp_path / f"{module}.py"))
    assert getattr(imported(tmp_path / "caller.py"), function)(0.0) == 11.0
    (tmp_path / f"{module}.py").write_text(CALLEE.replace(old, new))
    monkeypatch.setitem(sys.modules, module, imported(tmp_path / f"{module}.py"))
    assert getattr(imported(tmp_path / "caller.py"), function)(0.0) == expected


def test_a_source_edited_before_the_first_call_is_not_taken_for_what_was_compiled(source: Path) -> None:
    module = imported(source)
    source.write_text(SOURCE.replace("value * SCALE", "value * SCALE * SCALE"))
    assert module.total(VALUES) == 20.0
    assert imported(source).total(VALUES) == 40.0


def answer(folder: Path, **texts: str) -> str:
    """What ``kernels.answer()`` gives in a new process, and how much was compiled there, given texts of modules."""
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    script = (
        "import kernels\nfrom uwbbench.api.compiling import compile_counts\n"
        "print(kernels.answer(), compile_counts().fresh)"
    )
    places = {**os.environ, "PYTHONPATH": str(folder), "UWBBENCH_CACHE_DIR": str(folder / "kept")}
    command = [sys.executable, "-B", "-c", script]  # a .pyc counts whole seconds
    return subprocess.run(command, env=places, capture_output=True, text=True, check=True).stdout.strip()


RECORDS = """\
from typing import NamedTuple

class Own(NamedTuple):
    near: float
    far: float

class Pair(NamedTuple):
    own: Own
    factor: int
"""
NEAREST = """\
from records import Own, Pair
from uwbbench.api import compiled

@compiled
def of_argument(own): return own.near

@compiled
def of_part(pair): return pair.own.near

@compiled
def made(near): return Own(near=near, far=2.0)

def answer():
    own = Own(near=1.0, far=2.0)
    return of_argument(own), of_part(Pair(own, 3)), made(1.0).near
"""


@pytest.mark.slow
def test_fields_of_a_named_tuple_of_another_module_that_change_places_are_noticed(tmp_path: Path) -> None:
    """They are places in memory to machine code: what was compiled for the old order would give the wrong one."""
    expected = str((1.0,) * 3)
    assert answer(tmp_path, kernels=NEAREST, records=RECORDS) == f"{expected} 3"
    swapped = RECORDS.replace("    near: float\n    far: float", "    far: float\n    near: float")
    assert answer(tmp_path, records=swapped) == f"{expected} 3"
    assert answer(tmp_path) == f"{expected} 0"


STEPS = """\
from uwbbench.api import compiled

@compiled
def add(x): return x + 1.0

@compiled
def scale(x): return x * 10.0
"""
CHAIN = """\
from hub import first, second
from uwbbench.api import compiled

@compiled
def chain(x): return second(first(x))

def answer(): return chain(1.0)
"""


@pytest.mark.slow
def test_names_that_change_their_meaning_in_another_module_are_noticed(tmp_path: Path) -> None:
    """Neither the function nor those that it calls are edited: only which is called by which name."""
    hub = "from steps import add as first, scale as second"
    assert answer(tmp_path, kernels=CHAIN, hub=hub, steps=STEPS) == "20.0 3"
    assert answer(tmp_path, hub="from steps import add as second, scale as first") == "11.0 1"


@pytest.mark.slow
def test_another_processor_does_not_load_this_ones_machine_code(source: Path) -> None:
    imported(source).total(VALUES)
    script = (
        "import kernels, numpy as np\nfrom uwbbench.api.compiling import compile_counts\n"
        "print(kernels.total(np.arange(5.0)), compile_counts().fresh)"
    )
    other = "nehalem" if os.environ.get("NUMBA_CPU_NAME") == "generic" else "generic"
    places = {**os.environ, "PYTHONPATH": str(source.parent), "NUMBA_CPU_NAME": other, "NUMBA_CPU_FEATURES": ""}
    done = subprocess.run([sys.executable, "-c", script], env=places, capture_output=True, text=True, check=True)
    assert done.stdout == "20.0 2\n"
    assert len(kept(source.parent / "__pycache__")) == 4


DAMAGES = {
    "empty": lambda content: b"",
    "cut within the checksum": lambda content: content[:20],
    "cut": lambda content: content[: len(content) // 2],
    "one bit turned": lambda content: content[:-100] + bytes([content[-100] ^ 1]) + content[-99:],
    "longer": lambda content: content + b"\0",
    "another text": lambda content: b"hello" * 100,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_made_again(source: Path, fresh, caplog: pytest.LogCaptureFixture, damage) -> None:
    imported(source).total(VALUES)
    files = kept(source.parent / "__pycache__")
    for path in files:
        path.write_bytes(DAMAGES[damage](path.read_bytes()))
    fresh()
    assert imported(source).total(VALUES) == 20.0
    assert fresh() == 2
    assert all(f"{path} is damaged, and made again" in caplog.text for path in files)
    imported(source).total(VALUES)
    assert fresh() == 0


def test_a_file_under_the_name_of_another_is_not_taken_for_it(source: Path, fresh) -> None:
    imported(source).total(VALUES)
    imported(source).total(VALUES.astype(np.float32))
    one, two = [path for path in kept(source.parent / "__pycache__") if "total" in path.name]
    two.write_bytes(one.read_bytes())
    fresh()
    for values in (VALUES, VALUES.astype(np.float32)):
        assert imported(source).total(values) == 20.0
    assert fresh() == 1


def test_a_whole_file_that_cannot_be_used_is_made_again(
    source: Path, fresh, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    imported(source).total(VALUES)
    fresh()
    with monkeypatch.context() as patch:
        patch.setattr(compiled_files.pickle, "loads", lambda data: (_ for _ in ()).throw(AttributeError("gone")))
        assert imported(source).total(VALUES) == 20.0
    assert fresh() == 2
    assert "cannot be used (AttributeError('gone')) and is compiled again" in caplog.text


def test_compiling_again_on_demand_forgets_what_was_kept(source: Path, fresh) -> None:
    module = imported(source)
    module.total(VALUES)
    before = {path: path.stat().st_mtime_ns for path in kept(source.parent / "__pycache__")}
    module.total.recompile()
    after = {path: path.stat().st_mtime_ns for path in kept(source.parent / "__pycache__")}
    assert before.keys() == after.keys()
    assert before != after
