"""What the operating system counts."""

import mmap
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from uwbbench.measure.latency import counters
from uwbbench.measure.latency.counters import Usage, core_waits, counted

linux = pytest.mark.skipif(sys.platform != "linux", reason="perf_event_open is of Linux")


@linux
def test_page_faults_are_counted_of_the_work_alone() -> None:
    def touch_new_memory() -> None:
        with mmap.mmap(-1, 3000 * mmap.PAGESIZE) as memory:
            memory[:: mmap.PAGESIZE] = bytes(3000)

    touched, reason = counted(touch_new_memory, counters.SOFTWARE, counters.PAGE_FAULTS)
    if touched is None:
        pytest.skip(reason)
    idle, _ = counted(lambda: None, counters.SOFTWARE, counters.PAGE_FAULTS)
    assert idle is not None
    assert idle < 100
    assert touched > idle


def test_instructions_are_counted_or_the_reason_is_given() -> None:
    count, reason = counted(lambda: sum(range(1000)))
    assert (count is None) == reason.startswith("not counted: ")
    assert count is None or count > 1000


@linux
def test_an_event_that_does_not_exist_is_a_reason_and_the_work_is_not_done() -> None:
    done: list[int] = []
    count, reason = counted(lambda: done.append(1), kind=counters.SOFTWARE, event=10**6)
    assert count is None
    assert reason.startswith("not counted: ")
    assert done == []


@pytest.mark.skipif(sys.platform == "win32", reason="not told by Windows")
def test_usage_counts_the_pages_that_are_touched() -> None:
    before = Usage.now()
    held = np.ones(64 << 20, np.uint8)
    after = Usage.now()
    assert before is not None
    assert after is not None
    found = after.since(before)
    assert set(found) == {"minor_faults", "major_faults", "voluntary_switches", "involuntary_switches"}
    assert found["minor_faults"] > 0
    assert len(held) == 64 << 20


def test_waits_for_the_core_are_never_taken_back() -> None:
    with core_waits() as waited_ns:
        before = waited_ns()
        sum(range(10**5))
        assert 0 <= before <= waited_ns()


@pytest.mark.skipif(not Path("/proc/thread-self/schedstat").is_file(), reason="the system does not tell")
def test_sharing_a_core_is_waiting_for_it() -> None:
    core = min(os.sched_getaffinity(0))
    code = f"import os; os.sched_setaffinity(0, {{{core}}}); print('ready', flush=True)\nwhile True: pass"
    allowed = os.sched_getaffinity(0)
    other = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    try:
        assert other.stdout is not None
        other.stdout.readline()
        os.sched_setaffinity(0, {core})
        with core_waits() as waited_ns:
            before, start = waited_ns(), time.process_time()
            while time.process_time() - start < 0.2:
                pass
            assert waited_ns() - before > 20e6
    finally:
        os.sched_setaffinity(0, allowed)
        other.kill()
        other.communicate()
