"""Damaged files of every format are read, or refused with one message: nothing else happens."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from tests.api.written import capture_of
from tests.fuzz.flips import read_all
from tests.fuzz.formats import FORMATS
from uwbbench.api import CaptureError, apart, in_child, list_receivers, open_capture, write_capture


@pytest.mark.parametrize("name", ["capture", "mat", "yaml"])
def test_some_damaged_copies_are_read_or_refused(name: str, tmp_path: Path) -> None:
    counts, faults = read_all(FORMATS[name], range(1, 6), tmp_path)
    assert faults == []
    assert counts.total() == 5


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_more_damaged_copies_are_read_or_refused(name: str, tmp_path: Path) -> None:
    counts, faults = read_all(FORMATS[name], range(1000, 1040), tmp_path)
    assert faults == []
    assert counts.total() == 40
    assert counts["refused"] > 0


# The child.


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "run.h5").write_bytes(b"whatever")
    return tmp_path / "run.h5"


@pytest.fixture
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """A child is given up after a short time."""
    monkeypatch.setattr(apart, "LEAST_S", 0.3)


def spin() -> None:
    while True:
        pass


def raise_one() -> None:
    raise CaptureError("run.h5: of its own")


def test_what_a_child_finds_is_handed_back(path: Path) -> None:
    found = in_child(path, lambda: {"pid": os.getpid(), "values": np.arange(5)})
    assert found["pid"] != os.getpid()
    np.testing.assert_array_equal(found["values"], np.arange(5))


def test_an_error_of_a_child_is_raised_here(path: Path) -> None:
    with pytest.raises(CaptureError, match=r"^run\.h5: of its own$"):
        in_child(path, raise_one)


def test_a_crash_is_one_message(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(CaptureError, match=r"run\.h5: damaged: the library that reads it crashed over it \(SIGSEGV\)"):
        in_child(path, lambda: os.kill(os.getpid(), signal.SIGSEGV))
    assert capfd.readouterr().err == ""


def test_an_end_without_an_answer_is_one_message(path: Path) -> None:
    with pytest.raises(CaptureError, match=r"run\.h5: damaged: .*exit code 7"):
        in_child(path, lambda: os._exit(7))


@pytest.mark.usefixtures("soon")
@pytest.mark.parametrize("work", [spin, signal.pause, lambda: time.sleep(100)])
def test_a_hang_is_given_up(path: Path, work) -> None:
    with pytest.raises(CaptureError, match=r"run\.h5: damaged: reading it was given up after 0 s"):
        in_child(path, work)


def test_more_memory_than_a_child_may_have_is_one_message(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "MOST_BYTES", 1 << 28)
    with pytest.raises(CaptureError, match=r"run\.h5: damaged: reading it takes more than"):
        in_child(path, lambda: np.ones(1 << 27))


def test_a_file_is_examined_once_and_again_when_it_has_changed(path: Path) -> None:
    def examined() -> bool:
        """Whether a child is started for it, in which nothing comes to mind here."""
        before = len(apart._examined)
        apart.examine(path, lambda: None)
        return len(apart._examined) > before

    assert [examined(), examined()] == [True, False]
    path.write_bytes(b"something else")
    assert [examined(), examined()] == [True, False]


@pytest.mark.usefixtures("soon")
def test_a_file_that_hung_a_child_is_refused_at_once_from_then_on(path: Path) -> None:
    for work in (spin, lambda: None):
        with pytest.raises(CaptureError, match="given up"):
            apart.examine(path, work)


def test_a_trusted_file_is_not_examined(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UWBBENCH_TRUST_FILES", "1")
    assert in_child(path, os.getpid) == os.getpid()


def test_a_capture_that_this_process_wrote_needs_no_child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_capture(tmp_path / "run.h5", capture_of())
    monkeypatch.setattr(os, "fork", None)
    assert list_receivers(tmp_path / "run.h5") == ("front",)
    open_capture(tmp_path / "run.h5")


def test_a_capture_is_read_in_a_child_before_it_is_read_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_capture(tmp_path / "run.h5", capture_of())
    apart._examined.clear()
    seen = []
    monkeypatch.setattr(apart, "in_child", lambda path, work: seen.append(path))
    for _ in range(3):
        open_capture(tmp_path / "run.h5")
    assert seen == [tmp_path / "run.h5"]
