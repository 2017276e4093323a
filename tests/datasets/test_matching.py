"""Glob patterns: what they match, and that a search ends."""

import glob
from pathlib import Path

import pytest

from uwbbench.api import CaptureError
from uwbbench_datasets import matching
from uwbbench_datasets.capture_files import find_files
from uwbbench_datasets.matching import matching_files

PATTERNS = (
    "*.h5",
    "**/*.h5",
    "**",
    "a/*/*.h5",
    "?/b/run[12].h5",
    "a/**/run1.h5",
    ".hidden/*",
    "**/b",
    "none/*",
    "a/..",
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("top.h5", "a/b/run1.h5", "a/b/run2.h5", "a/c/d/run1.h5", ".hidden/run.h5", "a/.run3.h5", "a/note.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "link").symlink_to(tmp_path / "a" / "b")
    return tmp_path


@pytest.mark.parametrize("pattern", PATTERNS)
def test_what_the_standard_library_finds_is_found(folder: Path, pattern: str) -> None:
    expected = glob.glob(pattern, root_dir=folder, recursive=True)  # noqa: PTH207
    assert matching_files(folder, pattern) == sorted(path for path in expected if (folder / path).is_file())


def test_an_absolute_pattern_is_found_from_anywhere(folder: Path) -> None:
    assert matching_files(Path("nowhere"), f"{folder}/a/**/run1.h5") == [
        f"{folder}/a/b/run1.h5",
        f"{folder}/a/c/d/run1.h5",
    ]


def test_a_search_of_everything_is_given_up(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matching, "MOST_SEEN", 5)
    with pytest.raises(CaptureError, match=r"'\*\*/\*': more than 5 files and folders would have to be looked at"):
        find_files(["**/*"], [folder])


def test_folders_that_hold_themselves_are_not_followed_for_ever(folder: Path) -> None:
    (folder / "a" / "again").symlink_to(folder)
    assert "a/again/top.h5" in matching_files(folder, "**/top.h5")


def test_a_name_with_a_nul_character_is_one_message(folder: Path) -> None:
    with pytest.raises(CaptureError, match=r"'run\\x00.h5' names no file"):
        find_files(["run\0.h5"], [folder])
