"""The table adapter: recordings in five formats, read by a mapping, equal the captures they were written from."""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import yaml

from uwbbench.api import CaptureError, ConfigError, Obstacle
from uwbbench.api.locate import config_folder
from uwbbench.config.source import open_dataset

TEMPLATE = config_folder() / "mappings" / "template.yaml"
FRAMES = 24


@pytest.fixture(scope="module")
def original():
    dataset = open_dataset("approach", {"start_m": 1.0, "stop_m": 0.856}, [])
    capture = dataset.open(dataset.names()[0])
    assert len(capture) == FRAMES
    return capture


@pytest.fixture(scope="module")
def original_object(original) -> Obstacle:
    return original.truth.objects[0]


def mapping_of(capture, samples, **changes):
    """Mapping of a recording of the simulated approach; ``samples`` gives the layout of each response."""
    outline = capture.truth.objects[0].outline_m.tolist()
    return {
        "schema": 1,
        "origin": "simulated",
        "radar": {
            "model": capture.radar.model,
            "channel": 9,
            "bandwidth_hz": capture.radar.bandwidth_hz,
            "sample_interval_s": capture.radar.sample_interval_s,
            "frame_rate_hz": capture.radar.frame_rate_hz,
        },
        "receivers": {
            "front": {
                "mount_position_m": [0, 0, 0],
                "mount_yaw_deg": 0,
                "tx_position_m": list(capture.radar.tx_position_m),
                "noise_taps": capture.radar.noise_taps,
                "array_spacing_m": capture.radar.array_spacing_m,
            }
        },
        "preamble": samples("preamble"),
        "sts1": samples("sts1"),
        "sts2": samples("sts2"),
        "time": {"column": "t", "unit": "s"},
        "first_path": {"preamble": "fp", "sts1": "fp", "sts2": "fp"},
        "pose": {"x": "x", "y": "y", "z": "z", "yaw": "yaw", "length_unit": "m", "angle_unit": "rad"},
        "truth": {"exhaustive": True, "objects": [{"id": "plate", "material": "metal", "outline_m": outline}]},
        **changes,
    }


def scalars(capture):
    track = capture.trajectory
    x, y, z = track.position_m.T
    return {"t": track.timestamp_s, "x": x, "y": y, "z": z, "yaw": track.yaw_rad, "fp": capture.first_path_index}


def responses(capture):
    return {name: np.asarray(getattr(capture, name)) for name in ("preamble", "sts1", "sts2")}


def numbered(columns):
    """Arrays (frames, taps) as one column a tap."""
    return {f"{name}_{tap}": values[:, tap] for name, values in columns.items() for tap in range(values.shape[1])}


def separate(columns):
    return {f"{name}_{part}": getattr(values, attr) for name, values in columns.items() for part, attr in PARTS}


PARTS = (("i", "real"), ("q", "imag"))


def opened(folder: Path, mapping, **params):
    (folder / "mapping.yaml").write_text(yaml.safe_dump(mapping))
    return open_dataset("table", {"mapping": "mapping.yaml", **params}, [folder])


def write_csv(path, columns):
    pd.DataFrame(columns).to_csv(path, index=False)


def write_parquet(path, columns):
    pd.DataFrame({name: list(v) if v.ndim > 1 else v for name, v in columns.items()}).to_parquet(path)


def write_npz(path, columns):
    np.savez(path, **columns)


def write_mat(path, columns):
    scipy.io.savemat(path, columns)


def write_hdf5(path, columns):
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file[name] = values


def write_mat73(path, columns):
    """As MATLAB's ``save -v7.3`` lays arrays out: transposed, vectors as columns, complex as real and imag."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            stored = np.atleast_2d(values) if values.ndim == 1 else values.T
            if np.iscomplexobj(stored):
                pair = np.empty(stored.shape, [("real", "f4"), ("imag", "f4")])
                pair["real"], pair["imag"] = stored.real, stored.imag
                stored = pair
            file[name] = stored


def magnitude_phase(columns):
    parts = {f"{name}_a": np.abs(values.astype(complex)) for name, values in columns.items()}
    return parts | {f"{name}_p": np.rad2deg(np.angle(values.astype(complex))) for name, values in columns.items()}


def interleaved(columns):
    return {name: np.ascontiguousarray(values).view(np.float32) for name, values in columns.items()}


def in_cells(columns):
    return {name: [json.dumps(row.tolist()) for row in values] for name, values in columns.items()}


LAYOUTS = {
    "csv, I and Q columns": (
        "csv",
        write_csv,
        lambda r: numbered(separate(r)),
        lambda n: {"i": f"{n}_i_{{tap}}", "q": f"{n}_q_{{tap}}"},
    ),
    "csv, magnitude and phase columns": (
        "csv",
        write_csv,
        lambda r: numbered(magnitude_phase(r)),
        lambda n: {"magnitude": f"{n}_a_{{tap}}", "phase": f"{n}_p_{{tap}}", "phase_unit": "deg"},
    ),
    "csv, complex text columns": (
        "csv",
        write_csv,
        lambda r: {k: [str(value).replace("j", "i") for value in v] for k, v in numbered(r).items()},
        lambda n: {"complex": f"{n}_{{tap}}"},
    ),
    "csv, interleaved array in a cell": (
        "csv",
        write_csv,
        lambda r: in_cells(interleaved(r)),
        lambda n: {"interleaved": n},
    ),
    "csv, interleaved numbered columns": (
        "csv",
        write_csv,
        lambda r: numbered(interleaved(r)),
        lambda n: {"interleaved": f"{n}_{{tap}}"},
    ),
    "parquet, I and Q array columns": (
        "parquet",
        write_parquet,
        separate,
        lambda n: {"i": f"{n}_i", "q": f"{n}_q"},
    ),
    "parquet, I and Q columns": (
        "parquet",
        write_parquet,
        lambda r: numbered(separate(r)),
        lambda n: {"i": f"{n}_i_{{tap}}", "q": f"{n}_q_{{tap}}"},
    ),
    "npz, complex array": ("npz", write_npz, dict, lambda n: {"complex": n}),
    "npz, taps by frames": (
        "npz",
        write_npz,
        lambda r: {name: values.T for name, values in r.items()},
        lambda n: {"complex": n, "taps_first": True},
    ),
    "npz, last axis I and Q": (
        "npz",
        write_npz,
        lambda r: {name: np.stack([v.real, v.imag], axis=-1) for name, v in r.items()},
        lambda n: {"interleaved": n},
    ),
    "mat, complex array": ("mat", write_mat, dict, lambda n: {"complex": n}),
    "mat, structure": (
        "mat",
        lambda path, columns: write_mat(path, {"log": columns}),
        dict,
        lambda n: {"complex": f"log.{n}"},
    ),
    "mat 7.3, complex array": ("mat", write_mat73, dict, lambda n: {"complex": n}),
    "hdf5, complex array in a group": (
        "h5",
        write_hdf5,
        lambda r: {f"cir/{name}": values for name, values in r.items()},
        lambda n: {"complex": f"cir/{n}"},
    ),
}


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


# What bad input gets.


def changed(mapping, path, value):
    *parents, last = path.split(".")
    here = mapping
    for key in parents:
        here = here[key]
    here[last] = value
    return mapping


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("preambel", {}, r"mapping\.yaml:\d+: preambel: unknown key 'preambel'\. Did you mean 'preamble'"),
        ("radar.bandwith_hz", 1, r"radar\.bandwith_hz: unknown key 'bandwith_hz'\. Did you mean 'bandwidth_hz'"),
        ("receivers.front.noise_tabs", 4, r"receivers\.front\.noise_tabs: unknown key.*Did you mean 'noise_taps'"),
        ("radar.sample_interval_ns", 1, "radar: give either sample_interval_s or sample_interval_ns"),
        ("pose.length_unit", "km", r"pose\.length_unit: .*found 'km'"),
        ("time", {"column": "t"}, r"time: key 'unit' is missing"),
        ("sts2", None, "give both sts1 and sts2, or neither"),
        ("preamble", {"i": "a"}, "preamble: expected i and q"),
        ("preamble", {"magnitude": "a", "phase": "b"}, "phase and phase_unit"),
        ("receivers", {}, "receivers"),
        ("schema", 2, "schema"),
        ("truth.objects", [], "truth: expected objects"),
        ("truth.objects", [{"id": "a", "outline_m": [[0, 0]]}], "no material for a"),
        ("truth.objects", [{"id": "a", "center_m": [0, 0]}], r"objects\[0\]: give either outline_m, or center_m"),
        ("truth.objects", [{"id": "a", "outline_m": [[0, 0], [1, 1, 1]]}], "all of 2 or all of 3"),
        ("files", ["../*.npz"], "must lie below the mapping's folder"),
        ("files", ["/etc/*.npz"], "must lie below the mapping's folder"),
        ("truth.objects_file", "../objects.csv", "must lie below the mapping's folder"),
        ("truth.objects_file", "none.csv", r"none\.csv: cannot be read"),
    ],
)
def test_a_wrong_mapping_is_refused_with_file_and_key(tmp_path, original, path, value, message):
    mapping = changed(mapping_of(original, lambda n: {"complex": n}), path, value)
    with pytest.raises(ConfigError, match=message) as caught:
        opened(tmp_path, mapping, files=["*.npz"]).names() or None
    assert str(tmp_path) in str(caught.value)


@pytest.mark.parametrize("text", ["a: [", "- 1\n- 2\n", "", "\x00", "a: !!python/object:os.system x"])
def test_a_mapping_that_is_not_plain_yaml_is_refused(tmp_path, text):
    (tmp_path / "mapping.yaml").write_text(text)
    np.savez(tmp_path / "run.npz", a=np.zeros(1))
    with pytest.raises(ConfigError, match=r"mapping\.yaml:(\d+:)? "):
        open_dataset("table", {"mapping": "mapping.yaml", "files": ["run.npz"]}, [tmp_path]).names()


def test_a_link_out_of_the_mappings_folder_is_refused(tmp_path, original):
    (tmp_path / "inside").mkdir()
    np.savez(tmp_path / "run.npz", **scalars(original), **responses(original))
    (tmp_path / "inside" / "run.npz").symlink_to(tmp_path / "run.npz")
    mapping = mapping_of(original, lambda n: {"complex": n}, files=["*.npz"])
    with pytest.raises(CaptureError, match="outside the mapping's folder"):
        opened(tmp_path / "inside", mapping).names()


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("pose.x", "xx", "no column 'xx', which the mapping's pose.x names"),
        ("time.column", "fpp", r"no column 'fpp', which the mapping's time\.column names\. Did you mean 'fp'"),
        ("preamble", {"complex": "preambel"}, r"no column 'preambel'.*Did you mean 'preamble'"),
        ("preamble", {"i": "re_{tap}", "q": "im_{tap}"}, r"no columns like 're_\{tap\}'.*preamble\.i"),
        ("preamble", {"complex": "x"}, r"preamble: column 'x' has shape"),
        ("preamble", {"complex": "odd"}, "shape .* timestamps; .*taps_first"),
        ("pose.x", "preamble", "column 'preamble' has shape"),
        ("pose.x", "word", "column 'word' does not hold numbers"),
        ("radar.channel", 2, r"radar\.center_frequency_hz is missing for channel 2"),
        ("preamble", {"i": "gap_{tap}", "q": "gap_{tap}"}, "column 'gap_1' is missing"),
        ("preamble", {"interleaved": "three"}, "even count"),
        ("time.column", "falling", "must be finite and not decrease"),
        ("run_column", "rnu", "no column 'rnu', which the mapping's run_column names"),
        ("material_column", "word", "several materials in one capture"),
    ],
)
def test_a_column_that_does_not_fit_is_named_with_the_file(tmp_path, original, path, value, message):
    zeros = np.zeros(FRAMES)
    extra = {"word": np.array(["a", "b"] * (FRAMES // 2)), "gap_0": zeros, "gap_2": zeros, "falling": -np.arange(24.0)}
    extra |= {"odd": np.zeros((7, 3)), "three": np.zeros((FRAMES, 3))}
    np.savez(tmp_path / "run.npz", **scalars(original), **responses(original), **extra)
    mapping = changed(mapping_of(original, lambda n: {"complex": n}), path, value)
    with pytest.raises(CaptureError, match=message) as caught:
        opened(tmp_path, mapping, files=["run.npz"]).open("run")
    assert "run.npz" in str(caught.value)


def test_an_empty_cell_in_a_splitting_column_is_named_with_its_row(tmp_path, original):
    table = pd.DataFrame(scalars(original) | numbered(separate(responses(original)))).assign(run="a")
    table.loc[4, "run"] = None
    table.to_csv(tmp_path / "run.csv", index=False)
    mapping = mapping_of(original, lambda n: {"i": f"{n}_i_{{tap}}", "q": f"{n}_q_{{tap}}"}, run_column="run")
    dataset = opened(tmp_path, mapping, files=["run.csv"])
    assert dataset.names() == ["run"]
    with pytest.raises(CaptureError, match=r"run\.csv: column 'run' is empty in row 5"):
        dataset.open("run")


@pytest.mark.parametrize("suffix", ["csv", "parquet", "npz", "mat", "h5", "xyz"])
@pytest.mark.parametrize("content", [b"", b"\x00\xff garbage \x00" * 20])
def test_a_file_that_is_no_table_is_listed_and_refused_by_name(tmp_path, original, suffix, content):
    (tmp_path / f"run.{suffix}").write_bytes(content)
    dataset = opened(tmp_path, mapping_of(original, lambda n: {"complex": n}), files=["run.*"])
    with pytest.raises(CaptureError, match=rf"run\.{suffix}: "):
        dataset.open(dataset.names()[0])


@pytest.mark.parametrize("layout", ["parquet, I and Q columns", "npz, complex array", "mat, complex array"])
@pytest.mark.parametrize("kept", [0.3, 0.8, 0.99])
def test_a_truncated_file_is_refused_by_name(tmp_path, original, layout, kept):
    suffix, write, stored, samples = LAYOUTS[layout]
    path = tmp_path / f"run.{suffix}"
    write(path, scalars(original) | stored(responses(original)))
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(CaptureError, match=rf"run\.{suffix}"):
        opened(tmp_path, mapping_of(original, samples), files=[path.name]).open("run")


def test_pickled_arrays_are_never_loaded(tmp_path, original):
    np.savez(tmp_path / "run.npz", **scalars(original), **responses(original), evil=np.array([print], dtype=object))
    mapping = changed(mapping_of(original, lambda n: {"complex": n}), "pose.x", "evil")
    with pytest.raises(CaptureError, match=r"run\.npz: cannot be read: .*pickle"):
        opened(tmp_path, mapping, files=["run.npz"]).open("run")


def test_no_files_anywhere_is_said(tmp_path, original):
    with pytest.raises(CaptureError, match="names no files"):
        opened(tmp_path, mapping_of(original, lambda n: {"complex": n})).names()
