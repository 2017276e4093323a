import itertools
import os

from uwbbench.detect.sources import source_hash

later = itertools.count(1)


def package(folder, **files):
    root = folder / "hashed"
    root.mkdir(exist_ok=True)
    for name, text in {"__init__": "", **files}.items():
        path = root / f"{name}.py"
        path.write_text(text)
        modified_ns = path.stat().st_mtime_ns + next(later) * 10**9  # whatever the grain of the clock of files
        os.utime(path, ns=(modified_ns, modified_ns))


def test_a_change_in_what_a_module_imports_from_its_package_changes_its_hash(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    files = {
        "stage": "def open():\n    from hashed.loops import run\n",
        "loops": "from . import parts\nimport numpy\nrun = 1\n",
        "parts": "value = 1\n",
        "other": "value = 1\n",
    }
    package(tmp_path, **files)
    before = source_hash("hashed.stage")
    assert source_hash("hashed.stage") == before
    package(tmp_path, **files, unrelated="value = 2\n")
    package(tmp_path, **{**files, "other": "value = 2\n"})
    assert source_hash("hashed.stage") == before
    package(tmp_path, **{**files, "parts": "value = 2\n"})
    assert source_hash("hashed.stage") != before


def test_the_compiled_loops_behind_a_stage_are_part_of_its_hash():
    assert len({source_hash(f"uwbbench_detectors.{name}") for name in ("cluster", "peaks", "cfar")}) == 3
