"""What goes into a run folder comes out again."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from uwbbench.api import Capture, Detections, Obstacle, StoreError, Truth
from uwbbench.measure.accuracy.scoring import Region, ScoringRules
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.tables import as_spans, from_spans

FLOATS = st.floats(allow_nan=True, allow_infinity=True, width=64)


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.create(tmp_path / "run", {"experiment": {}})


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_detections_come_back_exactly(folder: RunFolder, data: st.DataObject) -> None:
    count = data.draw(st.integers(0, 5))
    columns = {
        name: data.draw(arrays(np.float64, count, elements=FLOATS))
        for name in data.draw(st.sets(st.sampled_from(["range_m", "score_db", "own column / \"'"])))
    }
    frame = data.draw(arrays(np.int64, count, elements=st.integers(0, 20)))
    processed = np.array(sorted(data.draw(st.sets(st.integers(0, 20)))), np.int64)
    given_ = Detections(frame, processed=processed, notes=["a note | <b>"], chain={"z": 3, "a": 1}, **columns)
    folder.write_detections("unit", given_, None)
    back = folder.detections("unit")
    assert list(back.columns) == list(given_.columns)
    for name, values in given_.columns.items():
        np.testing.assert_array_equal(back.columns[name], values)
        assert back.columns[name].dtype == values.dtype
    np.testing.assert_array_equal(back.processed, processed)
    assert (back.notes, list(back.chain.items())) == (given_.notes, [("z", 3), ("a", 1)])
    assert back.candidates is None


def test_empty_is_not_missing(folder: RunFolder) -> None:
    folder.write_detections("unit", Detections.empty(processed=[0, 1, 5]), None)
    assert folder.detections("unit").processed.tolist() == [0, 1, 5]
    with pytest.raises(StoreError, match="cannot be read"):
        folder.detections("other")


def test_candidates_come_back_with_their_detections(folder: RunFolder) -> None:
    folder.write_detections("unit", Detections([1], range_m=[2.0]), Detections([1, 2], retained=[1.0, 0.0]))
    candidates = folder.detections("unit").candidates
    assert candidates is not None
    assert candidates["retained"].tolist() == [1.0, 0.0]


@given(st.sets(st.integers(0, 200)))
def test_spans_are_the_same_frames(frames: set[int]) -> None:
    indices = np.array(sorted(frames), np.int64)
    np.testing.assert_array_equal(from_spans(as_spans(indices)), indices)


@pytest.mark.parametrize("moving", [False, True])
def test_a_header_comes_back_exactly(folder: RunFolder, approach: Capture, moving: bool) -> None:
    outline_m = np.random.default_rng(0).normal(size=(len(approach), 4, 2) if moving else (4, 2))
    if moving:
        outline_m[3] = np.nan
    objects = (Obstacle("a/\"b'", "metal", outline_m), Obstacle("wall", "concrete", np.eye(2, 3), structure=True))
    given_ = dataclasses.replace(approach, truth=Truth(objects, exhaustive=False)).header
    folder.write_header("id", given_, "hash")
    back = folder.header("id")
    assert back.radar == given_.radar
    assert (back.name, back.source, back.license, len(back)) == (
        given_.name,
        "simulated",
        given_.license,
        len(approach),
    )
    for name in ("timestamp_s", "position_m", "yaw_rad"):
        np.testing.assert_array_equal(getattr(back.trajectory, name), getattr(given_.trajectory, name))
    assert back.truth is not None
    assert not back.truth.exhaustive
    for one, other in zip(back.truth.objects, objects, strict=True):
        assert (one.name, one.material, one.structure) == (other.name, other.material, other.structure)
        np.testing.assert_array_equal(one.outline_m, other.outline_m)
    assert folder.content("id") == "hash"


def test_a_header_without_truth_comes_back_without(folder: RunFolder, approach: Capture) -> None:
    folder.write_header("id", dataclasses.replace(approach, truth=None).header, "hash")
    assert folder.header("id").truth is None


def test_a_header_of_an_earlier_version_has_the_usual_recording_and_no_robot(
    folder: RunFolder, approach: Capture
) -> None:
    header = dataclasses.replace(approach, name="monday/front", recording="walk", robot="twin, seed 1").header
    folder.write_header("id", header, "hash")
    assert (folder.header("id").recording, folder.header("id").robot) == ("walk", "twin, seed 1")
    (stored,) = (folder.path / "captures").glob("*.json")
    facts = json.loads(stored.read_text())
    stored.write_text(json.dumps({name: value for name, value in facts.items() if name not in ("recording", "robot")}))
    assert (folder.header("id").recording, folder.header("id").robot) == ("monday", "")


def test_scores_come_back_with_their_rules(folder: RunFolder) -> None:
    rules = [ScoringRules("object", 0.3, Region(1.0, 4.0, 0.5), 2)]
    folder.write_scores([{"detector": "a", "f1": 0.5}, {"detector": "b\udcff", "reason": "failed"}], rules)
    assert folder.rules == rules
    assert folder.scores()["detector"].tolist() == ["a", "b\\udcff"]


def test_a_run_without_scores_says_how_to_go_on(folder: RunFolder) -> None:
    with pytest.raises(StoreError, match="the run did not end; continue it with --resume"):
        folder.scores()


def test_a_folder_with_something_in_it_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(StoreError, match="already exists and is not empty"):
        RunFolder.create(tmp_path, {})


@pytest.mark.parametrize("below", ["file", "file/run"])
def test_a_file_in_place_of_the_folder_is_one_clear_message(tmp_path: Path, below: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="file"):
        RunFolder.create(tmp_path / below, {})


@pytest.mark.parametrize("manifest", [None, "[]", "{}", '{"format": "uwbbench-run", "format_version": 2}', "{"])
def test_what_is_no_run_folder_is_refused(tmp_path: Path, manifest: str | None) -> None:
    if manifest is not None:
        (tmp_path / "manifest.json").write_text(manifest)
    with pytest.raises(StoreError, match=r"manifest\.json"):
        RunFolder(tmp_path)
