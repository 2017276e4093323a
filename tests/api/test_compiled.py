"""Compiled functions: what they compute, and how their machine code is kept."""

import importlib.util
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numba
import numpy as np
import pytest

from uwbbench.api import ConfigError, compiled_files
from uwbbench.api.compiling import compile_counts, compiled

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
ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


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


def imported(path: Path) -> ModuleType:
    """The module as another process would import it: with nothing compiled yet."""
    spec = importlib.util.spec_from_file_location("kernels", path)
    module = sys.modules["kernels"] = importlib.util.module_from_spec(spec)
    code = compile(path.read_text(), str(path), "exec")  # never from a .pyc, whose stamp counts whole seconds
    exec(code, module.__dict__)  # noqa: S102
    return module


@pytest.fixture
def fresh() -> Iterator[Callable[[], int]]:
    """How many functions were compiled since last asked."""
    last = compile_counts().fresh

    def count() -> int:
        nonlocal last
        before, last = last, compile_counts().fresh
        return last - before

    return count


def kept(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.kernel"))


def block(folder: Path) -> None:
    """Put a file where a folder would be: nobody, not even root, can write into that."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.touch()


# Computing.


@compiled
def _ratio(a, b):
    return a / b


def test_a_division_by_zero_is_as_in_numpy() -> None:
    assert _ratio(1.0, 0.0) == np.inf
    assert np.isnan(_ratio(0.0, 0.0))


def test_a_function_is_handed_back_where_compiling_is_switched_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)

    def plain() -> int:
        return 1

    assert compiled(plain) is plain


def test_a_function_without_a_source_file_is_compiled_in_memory(user_cache: Path) -> None:
    names = {"compiled": compiled}
    exec("@compiled\ndef typed(x):\n    return x + 1\n", names)  # noqa: S102
    assert names["typed"](2) == 3
    assert not user_cache.exists()


# Keeping.


def test_what_one_process_compiled_another_loads(source: Path, fresh) -> None:
    assert imported(source).total(VALUES) == 20.0
    assert fresh() == 2
    loaded = compile_counts().loaded
    assert imported(source).total(VALUES) == 20.0
    assert fresh() == 0
    assert compile_counts().loaded == loaded + 1


def test_each_combination_of_types_is_compiled_once(source: Path, fresh) -> None:
    for values in (VALUES, VALUES.astype(np.float32)):
        imported(source).total(values)
    assert fresh() == 4
    for values in (VALUES, VALUES.astype(np.float32)):
        assert imported(source).total(values) == 20.0
    assert fresh() == 0


def test_machine_code_lies_beside_the_source_where_that_can_be_written(source: Path, user_cache: Path) -> None:
    imported(source).total(VALUES)
    assert len(kept(source.parent / "__pycache__")) == 2
    assert not user_cache.exists()


def test_machine_code_lies_in_the_users_cache_where_the_source_cannot_be_written_beside(
    source: Path, user_cache: Path, fresh
) -> None:
    block(source.parent / "__pycache__")
    imported(source).total(VALUES)
    assert len(kept(user_cache)) == 2
    assert fresh() == 2
    imported(source).total(VALUES)
    assert fresh() == 0


def test_the_environment_names_the_folder(source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UWBBENCH_CACHE_DIR", str(tmp_path / "mine" / "deep"))
    imported(source).total(VALUES)
    assert len(kept(tmp_path / "mine" / "deep")) == 2
    assert not (source.parent / "__pycache__").exists()


def test_where_nothing_can_be_written_functions_still_run_with_one_warning(
    source: Path, user_cache: Path, caplog: pytest.LogCaptureFixture
) -> None:
    block(source.parent / "__pycache__")
    block(user_cache)
    module = imported(source)
    assert module.total(VALUES) == module.total(VALUES.astype(np.float32)) == 20.0
    (record,) = caplog.records
    for part in (str(source.parent / "__pycache__"), str(user_cache), "set UWBBENCH_CACHE_DIR to a folder that can"):
        assert part in record.getMessage()


READ_ONLY = """\
import os, sys
import numpy as np
from uwbbench.api.compiling import compile_counts, compiled

assert compiled(lambda x: x + 1)(1) == 2  # numba is loaded, which another user may not be allowed to
if os.geteuid() == 0:
    os.setgroups([])
    os.setresgid(65534, 65534, 65534)
    os.setresuid(65534, 65534, 65534)
before = compile_counts()
sys.path.insert(0, sys.argv[1])
import kernels

print(kernels.total(np.arange(5.0)), compile_counts().fresh - before.fresh, compile_counts().loaded)
"""


def test_a_prepared_read_only_installation_is_used_by_another_user() -> None:
    """As in a container: prepared by root, then run by somebody who can write nowhere."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "kernels.py").write_text(SOURCE)
        imported(folder / "kernels.py").total(VALUES)
        (folder / "__pycache__").chmod(0o555)
        folder.chmod(0o555)
        places = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-c", READ_ONLY, name]
        done = subprocess.run(command, env=places, capture_output=True, text=True, check=False)
        folder.chmod(0o755)
        (folder / "__pycache__").chmod(0o755)
    assert (done.stdout, done.stderr) == ("20.0 0 1\n", "")


def test_cold_processes_that_start_at_once_all_succeed(source: Path, tmp_path: Path) -> None:
    script = (
        "import kernels, numpy as np\nfrom uwbbench.api.compiling import compile_counts\n"
        "kinds = [np.float64, np.float32, np.int64, np.complex64]\n"
        "print([complex(kernels.total(np.arange(5).astype(kind))) for kind in kinds])\n"
        "print(compile_counts().fresh)"
    )
    places = {"PYTHONPATH": str(source.parent), "UWBBENCH_CACHE_DIR": str(tmp_path / "shared")}
    command = [sys.executable, "-c", script]

    def start() -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        return subprocess.Popen(command, env={**os.environ, **places}, stdout=pipe, stderr=pipe, text=True)

    told = [process.communicate(timeout=120) for process in [start() for _ in range(4)]]
    results = {out.splitlines()[0] for out, _ in told}
    assert results == {str([20 + 0j] * 4)}
    assert [err for _, err in told] == [""] * 4
    assert start().communicate(timeout=120)[0].splitlines() == [*results, "0"]
    assert len(list((tmp_path / "shared").iterdir())) == len(kept(tmp_path / "shared")) == 8


# Stale and damaged files.


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


def test_names_that_change_their_meaning_in_another_module_are_noticed(tmp_path: Path) -> None:
    """Neither the function nor those that it calls are edited: only which is called by which name."""
    hub = "from steps import add as first, scale as second"
    assert answer(tmp_path, kernels=CHAIN, hub=hub, steps=STEPS) == "20.0 3"
    assert answer(tmp_path, hub="from steps import add as second, scale as first") == "11.0 1"


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


# Folders that others can write to.


def test_a_named_folder_that_everyone_can_write_to_is_refused(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o1777)
    monkeypatch.setenv("UWBBENCH_CACHE_DIR", str(tmp_path / "open"))
    with pytest.raises(ConfigError, match=r"UWBBENCH_CACHE_DIR: .*open belongs to another user, or everyone can write"):
        imported(source)


@pytest.mark.skipif(not ROOT, reason="only root can give folders away")
def test_a_named_folder_of_another_user_is_refused(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "theirs").mkdir()
    os.chown(tmp_path / "theirs", 65534, 65534)
    monkeypatch.setenv("UWBBENCH_CACHE_DIR", str(tmp_path / "theirs"))
    with pytest.raises(ConfigError, match=r"theirs belongs to another user"):
        imported(source)


def test_a_default_folder_that_everyone_can_write_to_is_passed_over(source: Path, user_cache: Path) -> None:
    (source.parent / "__pycache__").mkdir()
    (source.parent / "__pycache__").chmod(0o777)
    imported(source).total(VALUES)
    assert kept(source.parent / "__pycache__") == []
    assert len(kept(user_cache)) == 2


def test_files_and_folders_are_made_for_one_writer_whatever_the_umask(source: Path, user_cache: Path) -> None:
    block(source.parent / "__pycache__")
    old = os.umask(0)
    try:
        imported(source).total(VALUES)
    finally:
        os.umask(old)
    assert [path.stat().st_mode & 0o777 for path in [user_cache, *kept(user_cache)]] == [0o755, 0o644, 0o644]
