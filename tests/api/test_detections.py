"""The table of detections: absent columns, processed frames, joining."""

import numpy as np
import pytest

from uwbbench.api import COLUMNS, Detections, Map, Mapped, Poses


def test_a_column_that_nobody_computed_reads_as_nan():
    found = Detections([0, 1], range_m=[1.0, 2.0])
    assert "azimuth_rad" not in found
    assert np.isnan(found.azimuth_rad).all()
    assert found["range_m"].tolist() == [1.0, 2.0]


def test_processed_and_empty_differs_from_not_processed():
    assert Detections.empty(processed=[0, 1, 2]).processed.tolist() == [0, 1, 2]
    assert Detections.empty().processed.tolist() == []


def test_frames_with_a_detection_count_as_processed_where_nothing_else_is_said():
    assert Detections([4, 4, 2]).processed.tolist() == [2, 4]


def test_dropping_rows_keeps_the_processed_frames():
    kept = Detections([0, 1], processed=[0, 1, 2]).take(np.array([False, True]))
    assert (kept.frame.tolist(), kept.processed.tolist()) == ([1], [0, 1, 2])


def test_joining_fills_what_one_part_lacks():
    left = Detections([0], range_m=[1.0], cluster=[3], notes=["a"])
    right = Detections([1], tap=[7.0], processed=[1, 2], notes=["a", "b"])
    both = Detections.join([left, right])
    np.testing.assert_array_equal(both["range_m"], [1.0, np.nan])
    np.testing.assert_array_equal(both["tap"], [np.nan, 7.0])
    assert both["cluster"].tolist() == [3, -1]
    assert (both.processed.tolist(), both.notes) == ([0, 1, 2], ("a", "b"))


def test_joining_nothing_is_empty():
    assert len(Detections.join([])) == 0


def test_columns_of_different_length_are_refused():
    with pytest.raises(ValueError, match="differ in length"):
        Detections([0, 1], range_m=[1.0])


def test_changing_a_column_leaves_the_original_alone():
    found = Detections([0], range_m=[1.0])
    assert found.with_columns(range_m=[2.0]).range_m.tolist() == [2.0]
    assert found.range_m.tolist() == [1.0]


def test_candidates_are_found_once_and_only_when_asked_for():
    calls = []
    found = Detections([0], candidates=lambda: calls.append(1) or Detections([0, 0]))
    assert calls == []
    assert len(found.candidates) == len(found.candidates) == 2
    assert calls == [1]


def test_the_exported_table_has_every_column_in_order_and_the_plugins_own_behind():
    table = Detections([0, 1], cluster=[-1, 2], flavour=[0.5, 0.6]).to_pandas()
    assert tuple(table.columns) == (*COLUMNS, "flavour")
    assert table["cluster"].tolist() == [-1, 2]
    assert table["range_m"].isna().all()


def test_a_table_without_clustering_has_missing_clusters_not_noise():
    assert Detections([0]).to_pandas()["cluster"].isna().all()


def test_records_are_the_rows_as_plain_values():
    table = np.array([[0.0, 2.5, 7.0], [0.0, 3.5, np.inf]])
    table[:, 0] = np.array([4, 2**53 + 1]).view(np.float64)
    compiled = Detections.of_table(("range_m", "tap"), table, (4, np.ones(1, bool)), ())
    expected = [{"frame": 4, "range_m": 2.5, "tap": 7.0}, {"frame": 2**53 + 1, "range_m": 3.5, "tap": np.inf}]
    assert compiled.records() == expected
    assert Detections(compiled.frame, range_m=[2.5, 3.5], tap=[7.0, np.inf]).records() == expected
    assert {type(value) for row in expected for value in row.values()} == {int, float}
    assert Detections.empty().records() == []


def test_hand_outs_stay_with_the_rows_and_processed_frames_must_match():
    found = Detections([1, 2], range_m=[1.0, 2.0], processed=[0, 1, 2]).with_hand_outs([3, 2], [0, 1, 2])
    part = found.take(np.array([True, False]))
    assert part["handed_out"].tolist() == [3]
    assert part.answered.tolist() == [0, 1, 2]
    with pytest.raises(ValueError, match="2 frames answered, but 3 processed"):
        found.with_hand_outs([3, 2], [0, 1])
    assert found.annotated(processed=np.array([1, 2])).answered is None


def test_poses_and_map_stay_with_the_rows():
    mapped = Mapped(Poses.of_one(0, np.zeros(3)), Map())
    found = Detections([1, 2], range_m=[1.0, 2.0]).annotated(mapped=mapped)
    assert Detections([1]).mapped is None
    assert found.take(np.array([True, False])).with_columns(tap=[3.0]).annotated(notes=["n"]).mapped is mapped
