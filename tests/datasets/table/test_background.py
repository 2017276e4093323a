"""The background that a mapping names: a recording with the same columns and nothing in view."""

import numpy as np
import pandas as pd
import pytest
import yaml

from tests.datasets.table.layouts import mapping_of, opened, responses, scalars
from uwbbench.api import CaptureError, ConfigError, open_capture, write_capture

WALL = {"id": "wall", "material": "brick", "structure": True, "outline_m": [[5, -1], [5, 1]]}


@pytest.fixture
def recorded(tmp_path, original):
    """Folder with a recording and a background, and the mapping of both."""
    arrays = scalars(original) | responses(original)
    np.savez(tmp_path / "run.npz", **arrays)
    quiet = {name: values[:15] for name, values in arrays.items()}
    np.savez(tmp_path / "empty.npz", **{**quiet, "preamble": quiet["preamble"] * 0.5})
    mapping = mapping_of(original, lambda name: {"complex": name}, files=["*.npz"], background=["empty.npz"])
    mapping["truth"]["objects"].append(WALL)
    return tmp_path, mapping


def test_the_recording_named_is_the_background_and_no_capture(recorded, original):
    dataset = opened(*recorded)
    assert dataset.names() == ["run"]
    capture = dataset.open("run")
    assert [item.name for item in capture.truth.objects] == ["plate", "wall"]
    background = capture.background
    assert (background.name, len(background)) == ("empty", 15)
    assert [item.name for item in background.truth.objects] == ["wall"]
    np.testing.assert_allclose(background.preamble, np.asarray(original.preamble)[:15] * 0.5)


def test_a_background_is_converted_into_the_capture_file(recorded, tmp_path):
    capture = opened(*recorded).open("run")
    write_capture(tmp_path / "run.h5", capture)
    assert open_capture(tmp_path / "run.h5").sha256 == capture.sha256


def test_files_that_the_use_names_may_match_the_background_too(recorded):
    folder, mapping = recorded
    assert opened(folder, mapping, files=["*.npz"]).names() == ["run"]


def test_a_background_that_is_missing_or_elsewhere_is_named(recorded):
    folder, mapping = recorded
    with pytest.raises(CaptureError, match=r"no file matches 'gone\.npz'"):
        opened(folder, {**mapping, "background": ["gone.npz"]}).names()
    with pytest.raises(ConfigError, match=r"'\.\./empty\.npz' must lie below the mapping's folder"):
        opened(folder, {**mapping, "background": ["../empty.npz"]}).names()


def test_two_backgrounds_of_one_receiver_are_refused(recorded):
    folder, mapping = recorded
    np.savez(folder / "other.npz", **dict(np.load(folder / "empty.npz")))
    found = r"mapping.yaml: background: expected one recording of channel 9, found several, empty, other"
    with pytest.raises(CaptureError, match=found):
        opened(folder, {**mapping, "background": ["empty.npz", "other.npz"]}).open("run")


def test_a_damaged_background_is_named_once(recorded):
    folder, mapping = recorded
    (folder / "empty.npz").write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(CaptureError, match=r"empty\.npz") as caught:
        opened(folder, mapping).open("run")
    assert "\n" not in str(caught.value)
    assert "run.npz" not in str(caught.value)


def test_each_receiver_has_the_background_of_its_own(tmp_path):
    def table(name, scale):
        rows = [
            {"receiver": receiver, "t": frame * 0.02, **{f"i_{tap}": scale * number for tap in range(8)}, **ZERO}
            for number, receiver in enumerate(("left", "right"), start=1)
            for frame in range(5)
        ]
        pd.DataFrame(rows).to_csv(tmp_path / name, index=False)

    mount = {"mount_position_m": [0, 0, 0], "mount_yaw_deg": 0, "tx_position_m": [0, -0.25, 0], "noise_taps": 0}
    mapping = {
        "schema": 1,
        "files": ["run.csv"],
        "background": ["empty.csv"],
        "radar": {"model": "a", "center_frequency_hz": 8e9, "bandwidth_hz": 5e8, "sample_interval_ns": 1.0},
        "receivers": {"left": mount, "right": mount},
        "receiver_column": "receiver",
        "preamble": {"i": "i_{tap}", "q": "q_{tap}"},
        "time": {"column": "t", "unit": "s"},
    }
    table("run.csv", 10)
    table("empty.csv", 1)
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(mapping))
    dataset = opened(tmp_path, mapping)
    for name, level in (("run/left", 1), ("run/right", 2)):
        capture = dataset.open(name)
        assert np.all(np.asarray(capture.preamble) == 10 * level)
        assert np.all(np.asarray(capture.background.preamble) == level)
        assert (capture.recording, capture.background.name) == ("run", name.replace("run", "empty"))


ZERO = {f"q_{tap}": 0 for tap in range(8)}
