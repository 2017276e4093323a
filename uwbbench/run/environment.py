"""What a run depends on besides its configuration: versions, machine, command."""

from __future__ import annotations

import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from uwbbench import __version__
from uwbbench.api import registry
from uwbbench.measure.latency.machine import machine

_PACKAGES = ("numpy", "scipy", "scikit-learn", "joblib", "pyarrow", "pandas", "h5py", "pydantic")


def versions() -> dict[str, str]:
    """Versions of Python, uwbbench, the libraries under it, and every package that registers a plugin."""
    numbers = {"python": platform.python_version(), "uwbbench": __version__}
    for name in _PACKAGES:
        try:
            numbers[name] = version(name)
        except PackageNotFoundError:
            numbers[name] = "not installed"
    for kind in registry.KINDS:
        for entry in registry.entries(kind).values():
            name, _, number = entry.package.rpartition(" ")
            numbers.setdefault(name, number)
    return numbers


def case_packages() -> list[str]:
    """Names and versions of the packages, uwbbench apart, that bring hard cases of their stages."""
    own = f"uwbbench {__version__}"
    return sorted({entry.package for entry in registry.entries("cases").values()} - {own})


def session(jobs: int) -> dict[str, Any]:
    """One call of the program that worked on a run."""
    return {
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": list(sys.argv),
        "jobs": jobs,
        "threads_per_job": 1,
        "versions": versions(),
        "case_packages": case_packages(),
        "machine": machine(),
    }
