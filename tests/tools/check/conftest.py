"""Plugins that are broken in one place, installed and examined."""

from collections.abc import Callable

import pytest

from uwbbench.api.case import CheckResult
from uwbbench.tools.check import Conformance, examine, subject_of

Examine = Callable[..., Conformance]


@pytest.fixture
def examine_plugin(install_plugin) -> Examine:
    """Install a module with one class ``Broken`` and put checks to it."""

    def run(kind: str, source: str, *checks: str, roots=(), **params: object) -> Conformance:
        install_plugin("broken", {f"{kind}s": {"broken": "broken_module:Broken"}}, {"broken_module.py": source})
        return examine(subject_of(kind, "broken", params, roots), checks or None)  # type: ignore[arg-type]

    return run


@pytest.fixture
def judged(examine_plugin) -> Callable[..., CheckResult]:
    """Result of one check of one broken plugin."""

    def run(kind: str, source: str, check: str, **params: object) -> CheckResult:
        (result,) = examine_plugin(kind, source, check, **params).results
        return result

    return run
