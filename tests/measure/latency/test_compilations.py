"""Compiled code that appears during a measurement."""

from collections.abc import Callable

import numba
import pytest

from uwbbench.measure.latency.compilations import Compilations, undisturbed


def fresh_kernel() -> Callable[[float], float]:
    @numba.njit
    def doubled(value):  # type: ignore[no-untyped-def]
        return value + value

    return doubled


def test_a_first_call_is_noticed_and_a_second_is_not() -> None:
    doubled = fresh_kernel()
    with Compilations() as first:
        doubled(1.0)
    with Compilations() as second:
        doubled(2.0)
    assert first.count > 0
    assert second.count == 0


def test_other_types_are_compiled_anew_and_noticed() -> None:
    doubled = fresh_kernel()
    doubled(1.0)
    with Compilations() as watch:
        doubled(1)
    assert watch.count > 0


def test_a_kernel_loaded_from_the_disk_cache_is_noticed(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    (tmp_path / "kernel.py").write_text("def doubled(value):\n    return value + value\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    import kernel  # type: ignore[import-not-found]

    numba.njit(cache=True)(kernel.doubled)(1.0)
    cached = numba.njit(cache=True)(kernel.doubled)
    with Compilations() as watch:
        cached(1.0)
    assert sum(cached.stats.cache_hits.values()) == 1
    assert watch.count > 0


def test_a_disturbed_measurement_is_repeated_until_nothing_is_compiled() -> None:
    doubled, runs = fresh_kernel(), []

    def measured() -> int:
        runs.append(doubled(1.0))
        return len(runs)

    assert undisturbed(measured) == (2, 0)


def test_a_measurement_that_compiles_every_time_says_so() -> None:
    runs: list[float] = []

    def measured() -> int:
        runs.append(fresh_kernel()(1.0))
        return len(runs)

    result, compilations = undisturbed(measured, tries=3)
    assert result == 3
    assert compilations > 0
