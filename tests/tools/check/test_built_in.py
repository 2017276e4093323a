"""Every built-in plugin passes the checks of its kind."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pytest

from uwbbench.api import registry, write_capture
from uwbbench.api.locate import shipped
from uwbbench.tools.check import Conformance, checks_of, examine, subject_of
from uwbbench.tools.check.inputs import usual_capture
from uwbbench.tools.check.process import digests_elsewhere
from uwbbench.tools.check.subject import Subject

pytestmark = pytest.mark.slow

STAGES = [("stage", name) for name in registry.entries("stages")]
MAPPERS = [("mapper", name) for name in registry.entries("mappers")]
METRICS = [("metric", name) for name in registry.entries("metrics")]
DETECTORS = [("detector", name) for name in shipped("detectors")]
SIMULATED = {
    "approach": {"start_m": 2.0, "stop_m": 1.5},
    "limits": {"scene": "echo", "snr_db": 20, "frames": 50},
    "simulated": {"scenes": ["plate"], "set": {"trajectory.speed_m_s": 2.0}},
}
WITHOUT_DEFAULTS = {"first_path.known_pulse": {"shape": "gauss", "width_ns": 3.2}}
OF_AN_EXTRA = {"slam.graph": "gtsam", "slam-graph": "gtsam"}
"""Libraries that come with an extra only."""
MEASURED = ("pulson440-rail", "pulson440-tree", "et4173-walk", "dw1000-apartment", "xethru-x4")


@pytest.fixture(scope="module")
def subjects() -> dict[tuple[str, str], Subject]:
    """All but the datasets of files, with what another process makes of each; one process for all saves a minute."""
    wanted: list[Subject] = [
        subject_of(kind, name, WITHOUT_DEFAULTS.get(name))  # type: ignore[arg-type]
        for kind, name in STAGES + MAPPERS + METRICS + DETECTORS
    ]
    wanted += [subject_of("dataset", name, params) for name, params in SIMULATED.items()]
    for subject, found in zip(wanted, digests_elsewhere(wanted), strict=True):
        subject.digest_elsewhere = found
    return {(subject.kind, subject.name): subject for subject in wanted}


def examined(subject: Subject) -> Conformance:
    """All checks but the hard cases, which tests/stability puts to every shipped detector."""
    return examine(subject, [one.name for one in checks_of(subject) if not one.name.startswith("hard-")])


def failures(found: Conformance) -> Iterator[str]:
    return (f"{one.explain()}\n{one.trace}" for one in found.results if not one.passed)


@pytest.mark.parametrize(
    ("kind", "name"), [*STAGES, *MAPPERS, *METRICS, *DETECTORS, *(("dataset", name) for name in SIMULATED)]
)
def test_it_conforms(subjects, kind, name):
    if name in OF_AN_EXTRA:
        pytest.importorskip(OF_AN_EXTRA[name], reason=f"{name} needs the extra that brings it")
    found = examined(subjects[kind, name])
    assert not list(failures(found)), "\n".join(failures(found))
    assert found.count("passed") > 13


def test_capture_files_conform(tmp_path):
    write_capture(tmp_path / "mine.h5", dataclasses.replace(usual_capture(), license="CC0-1.0"))
    found = examined(subject_of("dataset", "capture", {"files": ["mine.h5"]}, [tmp_path]))
    assert not list(failures(found)), "\n".join(failures(found))
    assert found.count("passed") > 18


@pytest.mark.parametrize("name", MEASURED)
def test_a_measured_dataset_without_its_files_conforms_as_far_as_can_be_seen(name, tmp_path):
    found = examined(subject_of("dataset", name, roots=[tmp_path]))
    assert not list(failures(found)), "\n".join(failures(found))
    assert any("files are not here" in one.detail for one in found.results if one.status == "not applicable")


@pytest.mark.data
def test_a_measured_dataset_with_its_files_conforms(data_dir: Path):
    found = examined(subject_of("dataset", "xethru-x4", roots=[data_dir]))
    assert not list(failures(found)), "\n".join(failures(found))
