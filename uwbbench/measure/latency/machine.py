"""The machine that results were made on."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any


def machine() -> dict[str, Any]:
    """Where it ran."""
    return {
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "usable_cores": usable_cores(),
        "os": platform.platform(),
        "architecture": platform.machine(),
        "governor": governor(),
        "turbo": turbo(),
    }


def versions() -> dict[str, str]:
    """Of the interpreter and the libraries that decide how fast a detector runs."""
    return {"python": platform.python_version(), **{name: metadata.version(name) for name in ("numpy", "numba")}}


def load() -> float | None:
    """Processes that ran or waited for a core, mean of the last minute; None where the system does not say."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def governor(root: Path = Path("/sys/devices/system/cpu")) -> str | None:
    """Rule by which the first core's frequency is chosen; None where the system does not say."""
    return _line(root / "cpu0/cpufreq/scaling_governor")


def turbo(root: Path = Path("/sys/devices/system/cpu")) -> bool | None:
    """Whether cores may run above their nominal frequency; None where the system does not say."""
    boost, no_turbo = _line(root / "cpufreq/boost"), _line(root / "intel_pstate/no_turbo")
    if boost is not None:
        return boost == "1"
    return None if no_turbo is None else no_turbo == "0"


def _line(path: Path) -> str | None:
    try:
        return path.read_text().strip()
    except OSError:  # virtual machines and other systems have no such file
        return None


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def cpu_model() -> str:
    """Name of the processor, as the operating system gives it."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
