"""Writing whole or not at all, and identities."""

import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uwbbench.api import StoreError
from uwbbench.run.folder.files import read_json, read_parquet, replacing, write_json, write_parquet, write_text
from uwbbench.run.folder.identity import canonical, digest, file_id

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=10,
)


@given(st.dictionaries(st.text(), JSON, max_size=5))
def test_identity_does_not_depend_on_the_order_of_keys(value: dict[str, object]) -> None:
    assert digest(value) == digest(dict(reversed(list(value.items()))))


@given(JSON, JSON)
def test_identities_are_equal_only_for_equal_content(one: object, other: object) -> None:
    assert (digest(one) == digest(other)) == (canonical(one) == canonical(other))


def test_numbers_and_texts_as_keys_of_one_mapping_have_an_identity() -> None:
    assert digest({5: 1.0, "other": 2.0}) == digest({"5": 1.0, "other": 2.0})


@given(st.text(max_size=50))
def test_a_file_id_is_a_safe_name_for_any_text(name: str) -> None:
    assert file_id(name).isalnum()
    assert file_id(name).isascii()
    assert len(file_id(name)) == 20


def test_undefined_numbers_become_null(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"x": float("nan"), "y": np.float64(1.5), "z": np.array([1, 2])})
    assert read_json(tmp_path / "a.json") == {"x": None, "y": 1.5, "z": [1, 2]}


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "old")

    def fail() -> None:
        with replacing(tmp_path / "a.txt") as partial:
            partial.write_text("half")
            raise ValueError("crash")

    with pytest.raises(ValueError, match="crash"):
        fail()
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_a_file_in_place_of_a_folder_is_one_clear_message(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    with pytest.raises(StoreError, match=r"a/b\.json: cannot be written: (Not a directory|File exists)"):
        write_json(tmp_path / "a" / "b.json", {})


def test_a_full_disk_is_one_clear_message_and_leaves_nothing_behind(tmp_path: Path) -> None:
    code = (
        "import resource, sys, pathlib, numpy, pyarrow\n"
        "from uwbbench.api import StoreError\n"
        "from uwbbench.run.folder.files import write_parquet\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "try:\n"
        "    table = pyarrow.table({'a': numpy.random.default_rng(0).normal(size=10000)})\n"
        "    write_parquet(pathlib.Path(sys.argv[1]), table, {})\n"
        "except StoreError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "t.parquet"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "t.parquet: cannot be written: " in done.stdout
    assert len(done.stdout.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 1000


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1" + bytes(range(200)) + b"PAR1"])
def test_a_broken_table_is_one_clear_message(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "t.parquet").write_bytes(content)
    with pytest.raises(StoreError, match=r"t\.parquet: is not a readable Parquet file"):
        read_parquet(tmp_path / "t.parquet")


def test_a_broken_json_file_is_one_clear_message(tmp_path: Path) -> None:
    (tmp_path / "t.json").write_text('{"a": ')
    with pytest.raises(StoreError, match=r"t\.json: is not valid JSON"):
        read_json(tmp_path / "t.json")


def test_a_folder_named_like_a_column_adds_no_column(tmp_path: Path) -> None:
    write_parquet(tmp_path / "run=3" / "t.parquet", pa.table({"a": [1]}), {"note": "x"})
    table, facts = read_parquet(tmp_path / "run=3" / "t.parquet")
    assert table.column_names == ["a"]
    assert facts == {"note": "x"}
