"""Suites: experiments whose captures and rules are frozen, their smaller version and their private half."""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import simulated_approach
from uwbbench.api import ConfigError, StoreError
from uwbbench.config.seeds import HIDDEN, Seeds, read_seeds, write_seeds
from uwbbench.run import run_experiment
from uwbbench.run.experiment import read_experiment
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.verify import verify
from uwbbench.run.freeze import freeze
from uwbbench.run.suite import ChangedCapture, Mark, lock_of, read_frozen

SUITE = """\
schema: 1
detectors: [oracle]
datasets:
  - {use: approach, name: plate, params: {speed_m_s: 3.0, runs: 4, seed: 1}, repeats: []}
scoring: object
latency: {frames: 20, blocks: 8}
quick: {captures: 2}
"""
MEASURED = "  - {use: capture, name: measured, optional: true, params: {files: [mine.h5]}}\nscoring"


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    """A frozen suite of four captures of 45 frames."""
    path = tmp_path / "tiny.yaml"
    path.write_text(SUITE)
    freeze(path)
    return path


@pytest.fixture
def seeds(tmp_path: Path) -> Path:
    write_seeds(tmp_path / "secret")
    return tmp_path / "secret"


def changed_lock(suite: Path, change: Callable[[dict[str, Any]], None]) -> None:
    data = json.loads(lock_of(suite).read_text())
    change(data)
    lock_of(suite).write_text(json.dumps(data))


def quick_run(suite: Path, out: Path, **how: Any) -> RunFolder:
    return run_experiment(read_experiment(suite, quick=True, **how), out, jobs=1)


def test_a_run_says_which_version_of_the_suite_it_is_of(suite: Path, tmp_path: Path) -> None:
    folder = quick_run(suite, tmp_path / "run")
    frozen = read_frozen(suite)
    assert folder.manifest["experiment"]["suite"] == {"version": frozen.version, "quick": True, "seeds": ""}
    assert folder.manifest["frozen"] == frozen.contents()
    assert verify(folder).passed


def test_a_changed_capture_stops_the_run_and_is_named(suite: Path, tmp_path: Path) -> None:
    name = "approach-ch9-metal-3"
    mark = {"sha256": "0" * 64, "sketch": [1.0, 0.0, 1.0, 0.0]}

    def other(data: dict[str, Any]) -> None:
        data["captures"]["plate"][name] = mark
        rules = [rule.to_dict() for rule in run_rules(suite)]
        data["version"] = replace(read_frozen(suite), captures=marks(data)).version_of(rules)

    changed_lock(suite, other)
    with pytest.raises(
        ChangedCapture, match=rf"suite 'tiny', version \w+: capture '{name}' of dataset 'plate' was cha"
    ):
        quick_run(suite, tmp_path / "run")


def run_rules(suite: Path) -> Any:
    from uwbbench.run.folder.scored import rules_of

    return rules_of(read_experiment(suite, frozen=False).to_dict())


def marks(data: dict[str, Any]) -> dict[str, dict[str, Mark]]:
    return {
        label: {name: Mark(one["sha256"], tuple(one["sketch"])) for name, one in of.items()}
        for label, of in data["captures"].items()
    }


def test_a_capture_that_the_suite_has_not_is_refused_before_anything_is_run(suite: Path, tmp_path: Path) -> None:
    suite.write_text(SUITE.replace("runs: 4", "runs: 5"))
    with pytest.raises(ChangedCapture, match="has a capture 'approach-ch9-metal-5', which the suite has not"):
        run_experiment(read_experiment(suite), tmp_path / "run", jobs=1)
    assert not (tmp_path / "run").exists()


def test_a_capture_that_is_gone_is_named(suite: Path, tmp_path: Path) -> None:
    suite.write_text(SUITE.replace("runs: 4", "runs: 3"))
    with pytest.raises(ChangedCapture, match="capture 'approach-ch9-metal-4' of dataset 'plate' is no longer there"):
        run_experiment(read_experiment(suite), tmp_path / "run", jobs=1)


@pytest.mark.parametrize("changes", [{"gate_m": 0.1}, {"scoring": "frame"}, {"region.min_range_m": 0.5}])
def test_other_rules_are_not_run_under_the_name_of_the_suite(suite: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="the scoring rules are not the suite's"):
        read_experiment(suite, changes)


def test_other_detectors_are(suite: Path) -> None:
    assert read_experiment(suite, {"detectors": ["paper"]}).part.version == read_frozen(suite).version


def test_an_experiment_that_extends_a_suite_is_free(suite: Path) -> None:
    mine = suite.with_name("mine.yaml")
    mine.write_text("schema: 1\nextends: ./tiny.yaml\ngate_m: 0.1\n")
    assert read_experiment(mine).frozen is None


def test_a_damaged_lock_file_is_named(suite: Path) -> None:
    lock_of(suite).write_text("[]")
    with pytest.raises(ConfigError, match=r"tiny\.lock\.json: is no lock file of a suite; remove it"):
        read_experiment(suite)


def test_the_last_bits_of_samples_do_not_make_another_capture_but_one_sample_does() -> None:
    capture = simulated_approach(speed_m_s=3.0)
    mark = Mark.of(capture)
    rounded = np.asarray(capture.preamble).astype(np.complex128) * (1 + 1e-9)
    assert mark.fits(replace(capture, preamble=rounded))
    other = np.array(capture.preamble)
    other[20, 30] += 1e-3 * np.abs(other).max()
    assert not mark.fits(replace(capture, preamble=other))


def test_a_quick_run_takes_captures_from_all_of_a_dataset_and_times_nothing(suite: Path, tmp_path: Path) -> None:
    entries = quick_run(suite, tmp_path / "run").entries()
    assert [(entry.kind, entry.capture) for entry in entries] == [
        ("accuracy", "approach-ch9-metal-1"),
        ("accuracy", "approach-ch9-metal-3"),
    ]


def test_an_experiment_without_a_quick_version_says_so(suite: Path) -> None:
    suite.write_text(SUITE.replace("quick: {captures: 2}\n", ""))
    with pytest.raises(ConfigError, match=r"tiny\.yaml: has no 'quick'"):
        read_experiment(suite, quick=True)


def test_an_optional_dataset_is_skipped_and_does_not_belong_to_the_version(suite: Path, tmp_path: Path) -> None:
    suite.write_text(SUITE.replace("scoring", MEASURED))
    folder = quick_run(suite, tmp_path / "run")
    assert "mine.h5" in folder.manifest["skipped"]["measured"]
    assert {entry.status for entry in folder.entries()} == {"done"}
    assert folder.manifest["experiment"]["suite"]["version"] == read_frozen(suite).version


# The private half ----------------------------------------------------------------------------------------------


def stored(folder: Path) -> bytes:
    """All that a run leaves, with tables as text too."""
    import pyarrow.parquet as pq

    files = [path for path in folder.rglob("*") if path.is_file()]
    tables = [str(pq.read_table(path).to_pydict()).encode() for path in files if path.suffix == ".parquet"]
    return b"\n".join([path.read_bytes() for path in files] + tables + [str(files).encode()])


def test_a_private_half_has_other_captures_and_carries_the_hash_of_its_seeds_only(
    suite: Path, seeds: Path, tmp_path: Path
) -> None:
    folder = quick_run(suite, tmp_path / "run", seeds=seeds)
    known = read_seeds(seeds)
    part = folder.manifest["experiment"]["suite"]
    assert part == {"version": read_frozen(suite).version, "quick": True, "seeds": known.sha256}
    assert not set(folder.manifest["data"].values()) & set(read_frozen(suite).contents()["plate"].values())
    left = stored(folder.path)
    assert str(known.of("plate")).encode() not in left
    assert hex(known.of("plate"))[2:].encode() not in left
    assert known.number.hex().encode() not in left
    assert verify(folder).passed


def test_the_same_seeds_give_the_same_captures(suite: Path, seeds: Path, tmp_path: Path) -> None:
    first, again = (quick_run(suite, tmp_path / name, seeds=seeds) for name in ("first", "again"))
    assert first.manifest["data"] == again.manifest["data"]


def test_what_a_plugin_says_of_its_failure_is_stored_without_the_seed(suite: Path, seeds: Path, tmp_path: Path) -> None:
    experiment = read_experiment(suite, quick=True, seeds=seeds)
    (dataset,) = experiment.datasets
    wrong = replace(dataset, secret={**dataset.secret, "runs": 0})  # refused by its model, with what was given
    seed = str(dataset.secret["seed"])
    folder = run_experiment(replace(experiment, datasets=(wrong,)), tmp_path / "run", jobs=1)
    assert {entry.status for entry in folder.entries()} == {"failed"}
    assert seed.encode() not in stored(folder.path)


def test_a_seed_in_a_message_is_hidden(suite: Path, seeds: Path, tmp_path: Path, monkeypatch) -> None:
    from uwbbench.config.source import CaptureRef

    def fail(self: CaptureRef) -> None:
        raise ValueError(f"seed {self.secret['seed']} is unlucky")

    monkeypatch.setattr(CaptureRef, "open", fail)
    folder = run_experiment(read_experiment(suite, quick=True, seeds=seeds), tmp_path / "run", isolated=False)
    assert {entry.reason for entry in folder.entries()} == {f"ValueError: seed {HIDDEN} is unlucky"}
    assert str(read_seeds(seeds).of("plate")).encode() not in stored(folder.path)


def test_a_private_half_is_resumed_with_its_own_seeds_only(suite: Path, seeds: Path, tmp_path: Path) -> None:
    quick_run(suite, tmp_path / "run", seeds=seeds)
    other = tmp_path / "other"
    write_seeds(other)
    for how in ({}, {"seeds": other}):
        with pytest.raises(StoreError, match=r"was run with seeds \w+, not with .*resume it with the same --seeds"):
            run_experiment(read_experiment(suite, quick=True, **how), tmp_path / "run", jobs=1, resume=True)
    done = run_experiment(read_experiment(suite, quick=True, seeds=seeds), tmp_path / "run", jobs=1, resume=True)
    assert len(done.manifest["sessions"]) == 2


def test_a_dataset_that_cannot_be_drawn_is_left_out_of_the_private_half(suite: Path, seeds: Path) -> None:
    suite.write_text(SUITE.replace("scoring", MEASURED))
    experiment = read_experiment(suite, seeds=seeds)
    assert [dataset.label for dataset in experiment.datasets] == ["plate"]
    assert experiment.left_out == ("measured",)


def test_seeds_of_scenes_reach_every_draw_of_them() -> None:
    known = Seeds(os.urandom(32))
    assert known.of("rooms") != known.of("metal")
    assert known.of("rooms").bit_length() <= 128
