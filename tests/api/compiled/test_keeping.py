"""Compiled functions: what they compute, and where their machine code is kept."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numba
import numpy as np
import pytest

from tests.api.compiled.conftest import SOURCE, VALUES, block, imported, kept
from uwbbench.api import ConfigError, compiled_files
from uwbbench.api.compiling import compile_counts, compiled

ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


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


@pytest.mark.slow
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


@pytest.mark.slow
def test_cold_processes_that_start_at_once_all_succeed(source: Path, tmp_path: Path) -> None:
    script = (
        "import kernels, numpy as np\nfrom uwbbench.api.compiling import compile_counts\n"
        "kinds = [np.float64, np.complex64]\n"
        "print([complex(kernels.total(np.arange(5).astype(kind))) for kind in kinds])\n"
        "print(compile_counts().fresh)"
    )
    places = {"PYTHONPATH": str(source.parent), "UWBBENCH_CACHE_DIR": str(tmp_path / "shared")}
    command = [sys.executable, "-c", script]

    def start() -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        return subprocess.Popen(command, env={**os.environ, **places}, stdout=pipe, stderr=pipe, text=True)

    told = [process.communicate(timeout=300) for process in [start() for _ in range(3)]]
    results = {out.splitlines()[0] for out, _ in told}
    assert results == {str([20 + 0j] * 2)}
    assert [err for _, err in told] == [""] * 3
    assert start().communicate(timeout=300)[0].splitlines() == [*results, "0"]
    assert len(list((tmp_path / "shared").iterdir())) == len(kept(tmp_path / "shared")) == 4


# Folders that others can write to.


def test_a_named_folder_that_everyone_can_write_to_is_refused(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o1777)
    monkeypatch.setenv("UWBBENCH_CACHE_DIR", str(tmp_path / "open"))
    with pytest.raises(ConfigError, match=r"UWBBENCH_CACHE_DIR: .*open belongs to another user, or others can write"):
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


@pytest.mark.parametrize("mode", [0o1777, 0o770])
def test_a_named_folder_that_others_have_opened_since_is_not_read_from(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh, caplog: pytest.LogCaptureFixture, mode: int
) -> None:
    monkeypatch.setenv("UWBBENCH_CACHE_DIR", str(tmp_path / "mine"))
    monkeypatch.setattr(compiled_files, "_private", lambda group: False)
    imported(source).total(VALUES)
    module = imported(source)  # its folder was found safe
    (tmp_path / "mine").chmod(mode)
    assert fresh() == 2
    assert module.total(VALUES) == 20.0
    assert fresh() == 2
    assert "others can write to it: machine code in it is not used" in caplog.text


def test_a_file_that_others_can_write_to_is_not_read(source: Path, monkeypatch: pytest.MonkeyPatch, fresh) -> None:
    monkeypatch.setattr(compiled_files, "_private", lambda group: False)
    imported(source).total(VALUES)
    for path in kept(source.parent / "__pycache__"):
        path.chmod(0o664)
    assert fresh() == 2
    imported(source).total(VALUES)
    assert fresh() == 2


def test_a_link_is_not_read(source: Path, tmp_path: Path, fresh) -> None:
    imported(source).total(VALUES)
    for path in kept(source.parent / "__pycache__"):
        path.rename(tmp_path / path.name)
        path.symlink_to(tmp_path / path.name)
    assert fresh() == 2
    imported(source).total(VALUES)
    assert fresh() == 2


def test_a_named_folder_that_a_group_can_write_to_is_refused(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours").chmod(0o775)
    monkeypatch.setattr(compiled_files, "_private", lambda group: False)
    monkeypatch.setenv("UWBBENCH_CACHE_DIR", str(tmp_path / "ours"))
    with pytest.raises(ConfigError, match="ours belongs to another user, or others can write to it"):
        imported(source)


def test_a_missing_folder_and_those_above_it_are_made_for_one_writer(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UWBBENCH_CACHE_DIR", str(tmp_path / "a" / "b" / "c"))
    old = os.umask(0)
    try:
        imported(source).total(VALUES)
    finally:
        os.umask(old)
    made = [tmp_path / "a", tmp_path / "a" / "b", tmp_path / "a" / "b" / "c"]
    assert [path.stat().st_mode & 0o777 for path in made] == [0o755] * 3
    assert len(kept(tmp_path / "a" / "b" / "c")) == 2


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
