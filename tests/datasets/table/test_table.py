"""The table adapter: recordings in five formats, read by a mapping, equal the captures they were written from."""

import numpy as np
import pandas as pd
import pytest
import scipy.io

from tests.datasets.table.layouts import FRAMES, LAYOUTS, mapping_of, numbered, opened, responses, scalars, separate
from uwbbench.api import CaptureError
from uwbbench.api.locate import config_folder
from uwbbench.config.source import open_dataset

TEMPLATE = config_folder() / "mappings" / "template.yaml"


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_recording_gives_back_the_capture_that_it_was_written_from(tmp_path, original, original_object, layout):
    suffix, write, stored, samples = LAYOUTS[layout]
    write(tmp_path / f"run.{suffix}", scalars(original) | stored(responses(original)))
    mapping = mapping_of(original, samples)
    if layout == "mat, structure":
        mapping["time"]["column"] = "log.t"
        mapping["first_path"] = dict.fromkeys(("preamble", "sts1", "sts2"), "log.fp")
        mapping["pose"] |= {name: f"log.{name}" for name in ("x", "y", "z", "yaw")}
    dataset = opened(tmp_path, mapping, files=[f"run.{suffix}"])
    assert dataset.names() == ["run"]
    found = dataset.open("run")
    tolerance = 1e-6 * np.abs(original.preamble).max()
    for name, expected in responses(original).items():
        assert getattr(found, name).dtype == np.complex64
        np.testing.assert_allclose(getattr(found, name), expected, rtol=1e-6, atol=tolerance)
    for name in ("timestamp_s", "position_m", "yaw_rad"):
        np.testing.assert_allclose(getattr(found.trajectory, name), getattr(original.trajectory, name), atol=1e-12)
    np.testing.assert_allclose(found.first_path_index, original.first_path_index, rtol=1e-12)
    np.testing.assert_allclose(found.truth.objects[0].outline_m, original_object.outline_m)
    assert (found.truth.objects[0].name, found.truth.objects[0].material) == ("plate", "metal")
    assert found.radar.to_dict() == original.radar.to_dict()


@pytest.fixture
def campaign(tmp_path):
    """A recording as published data sets often look: one row a frame, channels 5 and 9 in turn, two materials."""
    rng = np.random.default_rng(0)
    runs, frames = ("metal-1", "plywood-1"), 40
    rows = {"run": np.repeat(runs, frames), "material": np.repeat(["metal", "plywood"], frames)}
    rows["channel"] = np.tile([5, 9], frames)
    rows["timestamp"] = np.tile(np.arange(frames) * 10.0, 2)
    rows["robot_x"] = np.tile(np.linspace(0, 280, frames), 2)
    rows["robot_y"], rows["robot_yaw"] = np.zeros(2 * frames), np.full(2 * frames, 90.0)
    for prefix in ("i", "q", "sts1_i", "sts1_q", "sts2_i", "sts2_q"):
        rows |= {f"{prefix}_{tap}": rng.integers(-3000, 3000, 2 * frames) for tap in range(50)}
    table = pd.DataFrame(rows)
    table.to_csv(tmp_path / "campaign.csv", index=False)
    (tmp_path / "mapping.yaml").write_text(TEMPLATE.read_text())
    return tmp_path, table


def test_the_template_mapping_reads_a_recording_of_the_layout_it_describes(campaign):
    folder, table = campaign
    dataset = open_dataset("table", {"mapping": "mapping.yaml"}, [folder])
    names = [f"campaign/{run}/ch{channel}" for run in ("metal-1", "plywood-1") for channel in (5, 9)]
    assert dataset.names() == names
    for name in names:
        run, channel = name.split("/")[1], int(name[-1])
        capture = dataset.open(name)
        rows = table[(table.run == run) & (table.channel == channel)]
        expected = (
            rows[[f"sts2_i_{tap}" for tap in range(50)]].to_numpy()
            + 1j * rows[[f"sts2_q_{tap}" for tap in range(50)]].to_numpy()
        )
        np.testing.assert_array_equal(capture.sts2, expected.astype(np.complex64))
        np.testing.assert_allclose(capture.trajectory.timestamp_s, rows.timestamp * 1e-3)
        np.testing.assert_allclose(capture.trajectory.position_m[:, 0], rows.robot_x * 1e-2)
        np.testing.assert_allclose(capture.trajectory.yaw_rad, np.pi / 2)
        assert capture.radar.channel == channel
        assert capture.radar.center_frequency_hz == {5: 6489.6e6, 9: 7987.2e6}[channel]
        assert capture.radar.frame_rate_hz == pytest.approx(50.0)
        target, wall = capture.truth.objects
        assert (target.material, wall.material, wall.structure) == (run.partition("-")[0], "plaster", True)


def test_the_template_documents_every_key_of_a_mapping():
    from uwbbench.api.registry import load_plugin

    module = __import__(load_plugin("datasets", "table").__module__, fromlist=["TableMapping"])
    models, seen = [module.TableMapping], set()
    text = TEMPLATE.read_text()
    while models:
        model = models.pop()
        for name, field in model.model_fields.items():
            seen.add(field.alias or name)
            stack = [field.annotation]
            while stack:
                part = stack.pop()
                stack += getattr(part, "__args__", ())
                if isinstance(part, type) and hasattr(part, "model_fields"):
                    models.append(part)
    assert [key for key in seen if key not in text] == []


def test_receivers_in_a_column_become_captures_with_their_own_mounts(tmp_path, original):
    table = pd.DataFrame(scalars(original) | numbered(separate(responses(original))))
    both = pd.concat([table.assign(rx=1), table.assign(rx=2)])
    both.to_csv(tmp_path / "run.csv", index=False)
    mapping = mapping_of(original, lambda n: {"i": f"{n}_i_{{tap}}", "q": f"{n}_q_{{tap}}"}, receiver_column="rx")
    front = mapping["receivers"].pop("front")
    mapping["receivers"] = {1: front, 2: front | {"mount_yaw_deg": 180}}
    dataset = opened(tmp_path, mapping, files=["run.csv"])
    assert dataset.names() == ["run/1", "run/2"]
    assert dataset.open("run/2").radar.mount_yaw_rad == pytest.approx(np.pi)
    np.testing.assert_array_equal(dataset.open("run/2").preamble, original.preamble)
    del mapping["receivers"][2]
    with pytest.raises(CaptureError, match="receivers: no entry for '2'"):
        opened(tmp_path, mapping, files=["run.csv"]).open("run/2")


def test_receivers_of_one_run_and_channel_are_a_run_that_opens_as_a_drive(tmp_path, original):
    table = pd.DataFrame(scalars(original) | numbered(separate(responses(original))))
    parts = [table.assign(r=run, rx=rx, ch=ch) for run in "ab" for rx in ("f", "s") for ch in (5, 9)]
    pd.concat(parts).to_csv(tmp_path / "log.csv", index=False)
    columns = {"run_column": "r", "receiver_column": "rx", "channel_column": "ch"}
    mapping = mapping_of(original, lambda n: {"i": f"{n}_i_{{tap}}", "q": f"{n}_q_{{tap}}"}, **columns)
    mapping |= {"odometry": mapping["pose"], "receivers": dict.fromkeys("fs", mapping["receivers"]["front"])}
    del mapping["radar"]["channel"]
    dataset = opened(tmp_path, mapping, files=["log.csv"])
    runs = dataset.runs()
    assert list(runs) == ["log/a/ch5", "log/a/ch9", "log/b/ch5", "log/b/ch9"]
    assert runs["log/b/ch9"] == ("log/b/f/ch9", "log/b/s/ch9")
    assert {name for captures in runs.values() for name in captures} == set(dataset.names())
    drive = dataset.open_run("log/b/ch9", runs["log/b/ch9"])
    assert list(drive.radars) == ["f", "s"]
    assert drive.odometry[:, :2] == pytest.approx(original.trajectory.position_m[:, :2])


def test_cells_of_matlab_text_split_runs(tmp_path, original):
    runs = np.array(["a"] * 10 + ["b"] * (FRAMES - 10), dtype=object)
    scipy.io.savemat(tmp_path / "run.mat", scalars(original) | responses(original) | {"run": runs})
    dataset = opened(tmp_path, mapping_of(original, lambda n: {"complex": n}, run_column="run"), files=["run.mat"])
    assert dataset.names() == ["run/a", "run/b"]
    np.testing.assert_array_equal(dataset.open("run/b").preamble, original.preamble[10:])


def test_real_samples_are_rf(tmp_path, original):
    scans = np.random.default_rng(1).normal(size=(FRAMES, 64)).astype(np.float32)
    np.savez(tmp_path / "run.npz", **scalars(original), scan=scans)
    mapping = mapping_of(original, lambda n: {"real": "scan"}, sts1=None, sts2=None)
    capture = opened(tmp_path, mapping, files=["run.npz"]).open("run")
    assert capture.radar.samples == "rf"
    np.testing.assert_array_equal(capture.preamble, scans)


def test_samples_are_scaled(tmp_path, original):
    np.savez(tmp_path / "run.npz", **scalars(original), **responses(original))
    mapping = mapping_of(original, lambda n: {"complex": n, "scale": 0.5})
    capture = opened(tmp_path, mapping, files=["run.npz"]).open("run")
    np.testing.assert_array_equal(capture.preamble, original.preamble * np.float32(0.5))


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_timestamps_are_converted_to_seconds(tmp_path, original, unit, factor):
    columns = scalars(original) | responses(original)
    np.savez(tmp_path / "run.npz", **(columns | {"t": columns["t"] * factor}))
    mapping = mapping_of(original, lambda n: {"complex": n}, time={"column": "t", "unit": unit})
    capture = opened(tmp_path, mapping, files=["run.npz"]).open("run")
    np.testing.assert_allclose(capture.trajectory.timestamp_s, columns["t"], atol=1e-12)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1), ("cm", 100), ("mm", 1000)])
def test_odometry_is_read_beside_the_true_pose(tmp_path, original, unit, factor):
    drift = {"ox": np.arange(FRAMES) * factor, "oy": np.ones(FRAMES) * factor, "oyaw": np.full(FRAMES, 45.0)}
    np.savez(tmp_path / "run.npz", **scalars(original), **responses(original), **drift)
    odometry = {"x": "ox", "y": "oy", "yaw": "oyaw", "length_unit": unit, "angle_unit": "deg"}
    mapping = mapping_of(original, lambda n: {"complex": n}, odometry=odometry)
    capture = opened(tmp_path, mapping, files=["run.npz"]).open("run")
    expected = np.stack([np.arange(FRAMES), np.ones(FRAMES), np.zeros(FRAMES)], axis=1)
    np.testing.assert_allclose(capture.odometry_position_m, expected)
    np.testing.assert_allclose(capture.odometry_yaw_rad, np.pi / 4)


def test_without_timestamps_frames_follow_at_the_frame_rate(tmp_path, original):
    np.savez(tmp_path / "run.npz", **scalars(original), **responses(original))
    mapping = mapping_of(original, lambda n: {"complex": n}, time=None)
    times = opened(tmp_path, mapping, files=["run.npz"]).open("run").trajectory.timestamp_s
    np.testing.assert_allclose(times, np.arange(FRAMES) / 48.0)


def test_missing_cells_make_invalid_frames(tmp_path, original):
    table = pd.DataFrame(scalars(original) | numbered(separate(responses(original))))
    table.loc[3, "preamble_i_7"] = np.nan
    table.to_csv(tmp_path / "run.csv", index=False)
    mapping = mapping_of(original, lambda n: {"i": f"{n}_i_{{tap}}", "q": f"{n}_q_{{tap}}"})
    valid = opened(tmp_path, mapping, files=["run.csv"]).open("run").frames().valid
    assert np.flatnonzero(~valid).tolist() == [3]


def test_a_table_without_rows_is_an_empty_capture(tmp_path, original):
    table = pd.DataFrame(scalars(original) | numbered(separate(responses(original))))
    table.head(0).to_csv(tmp_path / "run.csv", index=False)
    mapping = mapping_of(original, lambda n: {"i": f"{n}_i_{{tap}}", "q": f"{n}_q_{{tap}}"})
    assert len(opened(tmp_path, mapping, files=["run.csv"]).open("run")) == 0


def test_objects_come_from_a_csv_file_and_only_to_their_runs(tmp_path, original):
    np.savez(tmp_path / "one.npz", **scalars(original), **responses(original))
    np.savez(tmp_path / "two.npz", **scalars(original), **responses(original))
    (tmp_path / "objects.csv").write_text(
        "id,material,structure,runs,center_x_m,center_y_m,size_x_m,size_y_m,yaw_deg,outline_m\n"
        "box,concrete,,one,3,1,0.4,0.2,90,\n"
        "wall,brick,true,,,,,,,5 -1; 5 1\n"
    )
    truth = {"exhaustive": False, "objects_file": "objects.csv"}
    dataset = opened(tmp_path, mapping_of(original, lambda n: {"complex": n}, truth=truth), files=["*.npz"])
    box, wall = dataset.open("one").truth.objects
    assert (wall.structure, box.structure, dataset.open("one").truth.exhaustive) == (True, False, False)
    corners = {tuple(corner) for corner in box.outline_m.round(9).tolist()}
    assert corners == {(2.9, 0.8), (3.1, 0.8), (3.1, 1.2), (2.9, 1.2)}
    assert [thing.name for thing in dataset.open("two").truth.objects] == ["wall"]


def test_a_box_turns_counter_clockwise_by_its_yaw(tmp_path, original):
    np.savez(tmp_path / "run.npz", **scalars(original), **responses(original))
    thing = {"id": "bar", "material": "metal", "center_m": [1, 2], "size_m": [2, 0], "yaw_deg": 30}
    mapping = mapping_of(original, lambda n: {"complex": n}, truth={"exhaustive": True, "objects": [thing]})
    outline = opened(tmp_path, mapping, files=["run.npz"]).open("run").truth.objects[0].outline_m
    tip = outline[np.argmax(outline[:, 0])]
    np.testing.assert_allclose(tip, [1 + np.cos(np.pi / 6), 2 + np.sin(np.pi / 6)])


def test_without_objects_there_is_no_truth(tmp_path, original):
    np.savez(tmp_path / "run.npz", **scalars(original), **responses(original))
    mapping = mapping_of(original, lambda n: {"complex": n}, truth=None)
    assert opened(tmp_path, mapping, files=["run.npz"]).open("run").truth is None
