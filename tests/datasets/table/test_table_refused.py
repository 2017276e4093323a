"""The table adapter: what a wrong mapping and a recording that does not fit get."""

import h5py
import numpy as np
import pandas as pd
import pytest

from tests.datasets.table.layouts import FRAMES, LAYOUTS, mapping_of, numbered, opened, responses, scalars, separate
from uwbbench.api import CaptureError, ConfigError
from uwbbench.config.source import open_dataset
from uwbbench_datasets.table.formats import open_recording


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
        ("files", ["run\0.npz"], "'run.x00.npz' names no file below .*: it holds a NUL character"),
        ("truth.objects_file", "objects\0.csv", "names no file below .*: it holds a NUL character"),
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


@pytest.mark.parametrize("suffix", ["h5", "mat"])
@pytest.mark.parametrize("kind", ["external", "virtual"])
def test_an_array_in_another_file_is_refused(tmp_path, original, suffix, kind):
    (tmp_path / "secret.bin").write_bytes(bytes(240))
    with h5py.File(tmp_path / f"run.{suffix}", "w") as file:
        if kind == "external":
            file.create_dataset("a", shape=(6, 5), dtype="f8", external=[(str(tmp_path / "secret.bin"), 0, 240)])
        else:
            layout = h5py.VirtualLayout(shape=(6, 5), dtype="f8")
            layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "a", shape=(6, 5))
            file.create_virtual_dataset("a", layout)
    recording = open_recording(tmp_path / f"run.{suffix}")
    with pytest.raises(CaptureError, match=rf"run\.{suffix}: /a: the array lies in another file"):
        recording.read(["a"])
