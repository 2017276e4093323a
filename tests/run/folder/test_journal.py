"""The journal survives whatever ends a run."""

from pathlib import Path

import pytest

from uwbbench.api import StoreError
from uwbbench.run.folder import journal
from uwbbench.run.folder.journal import Entry


def entry(unit: str, status: journal.Status = "done", **values: object) -> Entry:
    return Entry(unit=unit, kind="accuracy", detector="d", dataset="s", capture="c", status=status, **values)


def test_entries_come_back_as_they_went(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    given = [entry("a", facts={"frames": 3}), entry("b", "failed", reason="no\nluck", traceback="T\n  x")]
    for one in given:
        journal.append(path, one)
    assert journal.read(path) == ({one.unit: one for one in given}, [])


def test_no_journal_is_an_empty_one(tmp_path: Path) -> None:
    assert journal.read(tmp_path / "journal.jsonl") == ({}, [])


def test_the_last_entry_of_a_unit_holds(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    journal.append(path, entry("a", "failed", reason="once"))
    journal.append(path, entry("a"))
    assert journal.read(path)[0]["a"].status == "done"


@pytest.mark.parametrize("cut", [1, 10, 60])
def test_a_torn_last_line_is_ignored_with_a_note_and_the_next_one_stays_whole(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "journal.jsonl"
    journal.append(path, entry("a"))
    whole = path.read_bytes()
    journal.append(path, entry("b"))
    path.write_bytes(path.read_bytes()[: len(whole) + cut])
    found, notes = journal.read(path)
    assert list(found) == ["a"]
    assert len(notes) == 1
    assert "line 2" in notes[0]
    journal.append(path, entry("c"))
    assert list(journal.read(path)[0]) == ["a", "c"]


@pytest.mark.parametrize("line", [b"\x00\x00\x00", b"[]", b"3", b'{"unit": "x"}', b"\xff\xfe"])
def test_a_damaged_line_is_ignored_with_a_note(tmp_path: Path, line: bytes) -> None:
    path = tmp_path / "journal.jsonl"
    journal.append(path, entry("a"))
    path.write_bytes(line + b"\n" + path.read_bytes())
    found, notes = journal.read(path)
    assert list(found) == ["a"]
    assert "line 1" in notes[0]


def test_keys_of_a_later_version_are_ignored(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    journal.append(path, entry("a"))
    path.write_bytes(path.read_bytes().replace(b'{"unit"', b'{"later": 1, "unit"'))
    assert list(journal.read(path)[0]) == ["a"]


def test_a_journal_that_cannot_be_written_is_one_clear_message(tmp_path: Path) -> None:
    (tmp_path / "journal.jsonl").mkdir()
    with pytest.raises(StoreError, match=r"journal\.jsonl: cannot be written: Is a directory"):
        journal.append(tmp_path / "journal.jsonl", entry("a"))
