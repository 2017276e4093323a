"""Workers of a run: what they answer, how they end, and that no role is played twice."""

import os
import pickle
import time
from pathlib import Path

import numpy as np
import pytest

import uwbbench
from uwbbench.api import Detections, Stage, registry
from uwbbench.run.crew import Crew, Task, unpacked
from uwbbench.run.crew.messages import Refused, packed


def pid() -> int:
    return os.getpid()


def folder() -> str:
    return str(Path.cwd())


def leave() -> None:
    os.chdir("/")


def end(code: int) -> None:
    os._exit(code)


def end_by(number: int) -> None:
    os.kill(os.getpid(), number)


def wait(seconds: float) -> float:
    time.sleep(seconds)
    return seconds


def close_all() -> None:
    os.closerange(0, 256)
    time.sleep(60)


def allocate(megabytes: int) -> int:
    return len(np.ones((megabytes, 2**20), np.uint8))


def fail() -> None:
    class Unreadable(Exception):
        def __str__(self) -> str:
            raise ZeroDivisionError

    raise Unreadable


def names(kind: str) -> list[str]:
    return [name for name, one in registry.entries(kind).items() if one.package == registry.HERE_ALONE]


@pytest.fixture
def crew():
    with Crew(2) as hands:
        yield hands


def done(crew: Crew, *tasks: Task):
    for task in tasks:
        crew.start(task)
    endings = {ending.task: ending for ending in (crew.next() for _ in tasks)}
    return [endings[task] for task in tasks]


def test_a_role_keeps_its_process_and_no_other_role_gets_it(crew) -> None:
    first, other = done(crew, Task("a", pid, (), 60), Task("b", pid, (), 60))
    (again,) = done(crew, Task("a", pid, (), 60))
    assert unpacked(first.message) == unpacked(again.message) != unpacked(other.message)
    assert os.getpid() not in (unpacked(first.message), unpacked(other.message))


def test_two_tasks_of_a_role_at_once_have_two_processes(crew) -> None:
    both = done(crew, Task("a", wait, (0.01,), 60), Task("a", wait, (0.01,), 60))
    assert both[0].worker != both[1].worker


def test_a_worker_that_was_dismissed_is_followed_by_a_clean_one(crew) -> None:
    (left,) = done(crew, Task("a", leave, (), 60))
    assert unpacked(done(crew, Task("a", folder, (), 60))[0].message) == "/"
    crew.dismiss(left.worker)
    assert unpacked(done(crew, Task("a", folder, (), 60))[0].message) == str(Path.cwd())


def test_a_held_worker_does_only_what_asks_for_it(crew) -> None:
    (first,) = done(crew, Task("a", pid, (), 60))
    crew.hold(first.worker)
    other, same = done(crew, Task("a", pid, (), 60), Task("a", pid, (), 60, worker=first.worker))
    assert unpacked(same.message) == unpacked(first.message) != unpacked(other.message)
    crew.dismiss(first.worker)
    (late,) = done(crew, Task("a", pid, (), 60, worker=first.worker))
    assert late.died
    assert late.raised.reason == "the process that had it at hand has ended"


@pytest.mark.parametrize(
    ("function", "arguments", "says"),
    [
        (end, (3,), "its process ended itself (exit code 3)"),
        (end, (0,), "its process ended itself (exit code 0)"),
        (end_by, (11,), "its process was ended by SIGSEGV"),
        (end_by, (9,), "its process was ended by SIGKILL, as for want of memory"),
        (close_all, (), "its process closed the line to the run"),
        (fail, (), "Unreadable: its text raises ZeroDivisionError"),
    ],
    ids=["exit", "exit as if all were well", "segmentation", "killed", "closed", "unreadable"],
)
def test_every_ending_has_a_reason_and_costs_nothing_else(crew, function, arguments, says) -> None:
    bad, good = done(crew, Task("bad", function, arguments, 60), Task("good", pid, (), 60))
    assert (bad.message, bad.raised.reason) == (None, says)
    assert good.raised is None
    assert done(crew, Task("bad", pid, (), 60))[0].raised is None


def test_a_task_that_takes_too_long_is_ended(crew) -> None:
    (slow,) = done(crew, Task("a", wait, (60.0,), 0.1, ", its limit"))
    assert slow.raised.reason == "took longer than 0.1 s, its limit"
    assert slow.died


def test_a_worker_gets_no_more_memory_than_it_may_have() -> None:
    with Crew(1, memory_mb=1024) as crew:
        (within,) = done(crew, Task("a", allocate, (16,), 60))
        (beyond,) = done(crew, Task("a", allocate, (2000,), 60))
    assert unpacked(within.message) == 16
    assert "MemoryError" in beyond.raised.reason


def test_classes_that_a_script_registers_are_known_to_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_registered", {})

    class Mine(Stage):
        """Only here."""

    try:
        uwbbench.register("stages", "only.here", Mine)
        with Crew(1) as crew:
            assert unpacked(done(crew, Task("a", names, ("stages",), 60))[0].message) == ["only.here"]
    finally:
        registry.take_over({})


def test_messages_of_workers_hold_arrays_and_detections() -> None:
    found = Detections(np.arange(3), range_m=[1.0, 2.0, np.nan], processed=np.arange(5), notes=["n"], chain={"a": 3})
    again = unpacked(packed({"found": found, "number": np.float64(2.5)}))
    np.testing.assert_array_equal(again["found"]["range_m"], found["range_m"])
    np.testing.assert_array_equal(again["found"].processed, np.arange(5))
    assert again["number"] == 2.5


class Calls:
    def __reduce__(self):
        return os.system, ("true",)


@pytest.mark.parametrize(
    "message", [pickle.dumps(Calls()), pickle.dumps(Crew), pickle.dumps(os.getcwd), b"", b"\x80\x05", b"(" * 1000]
)
def test_a_message_that_is_more_than_data_is_refused(message: bytes) -> None:
    with pytest.raises(Refused):
        unpacked(message)
