"""Costs that the operating system or the processor counts: instructions, page faults, waits for the core.

Conventions
-----------
* Only what this process does in user space is counted, as the kernel's part depends on the machine.
* What cannot be counted is None, with the reason; it is never estimated.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

if sys.platform != "win32":
    import resource

HARDWARE, INSTRUCTIONS = 0, 1
SOFTWARE, PAGE_FAULTS = 1, 2
"""Kinds of events and events, from ``linux/perf_event.h``."""

_CALL_NUMBER = {"x86_64": 298, "aarch64": 241}
_DISABLED, _EXCLUDE_KERNEL, _EXCLUDE_HYPERVISOR = 1 << 0, 1 << 5, 1 << 6
_ENABLE, _DISABLE = 0x2400, 0x2401
_REFUSED = {
    errno.ENOENT: "this machine has no such counter, as is usual for virtual ones",
    errno.EACCES: "not allowed, see kernel.perf_event_paranoid",
    errno.EPERM: "not allowed, see kernel.perf_event_paranoid",
    errno.ENOSYS: "the system has no perf_event_open",
}
_ATTRIBUTES_BYTES = 64
"""Size of the first version of ``struct perf_event_attr``, which every kernel accepts."""


def counted(work: Callable[[], object], kind: int = HARDWARE, event: int = INSTRUCTIONS) -> tuple[int | None, str]:
    """Events of a kind while some work is done, in user space, on this thread.

    Parameters
    ----------
    work : callable
    kind, event : int
        As ``perf_event_open(2)`` numbers them.

    Returns
    -------
    count : int or None
        None where the machine does not count them; the work is then not done.
    reason : str
        Why not; empty where it counted.
    """
    if sys.platform != "linux" or platform.machine() not in _CALL_NUMBER:
        return None, f"not counted: {sys.platform} on {platform.machine()} is not supported"
    import fcntl

    flags = _DISABLED | _EXCLUDE_KERNEL | _EXCLUDE_HYPERVISOR
    # type, size, config, sample_period, sample_type, read_format, flags, and two fields that are not used
    layout = struct.pack("=IIQQQQQIIQ", kind, _ATTRIBUTES_BYTES, event, 0, 0, 0, flags, 0, 0, 0)
    attributes = ctypes.create_string_buffer(layout, _ATTRIBUTES_BYTES)
    system = ctypes.CDLL(None, use_errno=True)
    number = ctypes.c_long(_CALL_NUMBER[platform.machine()])
    this_thread, any_core, no_group, no_flags = 0, -1, -1, ctypes.c_ulong(0)
    descriptor = system.syscall(number, ctypes.byref(attributes), this_thread, any_core, no_group, no_flags)
    if descriptor < 0:
        error = ctypes.get_errno()
        return None, f"not counted: {_REFUSED.get(error, os.strerror(error))}"
    try:
        fcntl.ioctl(descriptor, _ENABLE, 0)
        work()
        fcntl.ioctl(descriptor, _DISABLE, 0)
        return int.from_bytes(os.read(descriptor, 8), sys.byteorder), ""
    finally:
        os.close(descriptor)


@contextmanager
def core_waits() -> Iterator[Callable[[], int]]:
    """Give a reader of how long this thread has waited for its core so far, in nanoseconds.

    Linux counts that for each thread (``/proc/thread-self/schedstat``, second number); elsewhere it reads 0.
    """
    try:
        descriptor = os.open("/proc/thread-self/schedstat", os.O_RDONLY)
    except OSError:
        yield lambda: 0
        return
    try:
        yield lambda: int(os.pread(descriptor, 64, 0).split()[1])
    finally:
        os.close(descriptor)


@dataclass(frozen=True)
class Usage:
    """What the operating system has counted of this process so far.

    Attributes
    ----------
    minor_faults, major_faults : int
        Pages that had to be mapped, and those read from disk.
    voluntary_switches, involuntary_switches : int
        How often the process waited, and how often others took its core.
    """

    minor_faults: int
    major_faults: int
    voluntary_switches: int
    involuntary_switches: int

    @classmethod
    def now(cls) -> Usage | None:
        """Counts so far; None where the operating system does not report them."""
        if sys.platform == "win32":
            return None
        usage = resource.getrusage(resource.RUSAGE_SELF)
        return cls(usage.ru_minflt, usage.ru_majflt, usage.ru_nvcsw, usage.ru_nivcsw)

    def since(self, before: Usage) -> dict[str, int]:
        """What has been counted since an earlier moment."""
        return {name: now - getattr(before, name) for name, now in vars(self).items()}
