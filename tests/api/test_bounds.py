"""What a file declares is checked before anything of that size is made."""

import dataclasses
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.api.written import capture_of
from uwbbench.api import CaptureError, Obstacle, StoreError, Truth, bounds, open_capture, write_capture
from uwbbench.api.bounds import MOST_OBJECTS, MOST_TAPS, MOST_VERTICES, check_columns, check_unfolded
from uwbbench.run.folder.files import read_json, read_parquet
from uwbbench.run.folder.mapped import read_map
from uwbbench_datasets.table.formats import open_recording


@pytest.mark.parametrize("chunks", [None, (1000, 50)])
@pytest.mark.parametrize(("name", "shape"), [("preamble", (10**9, 50)), ("preamble", (449, 10**8)),
                                             ("timestamp_s", (10**9,))])  # fmt: skip
def test_an_array_of_which_nothing_is_stored_is_refused(tmp_path: Path, name: str, shape, chunks) -> None:
    write_capture(tmp_path / "run.h5", capture_of())
    with h5py.File(tmp_path / "run.h5", "a") as file:
        group = file["receivers/front"]
        kind = group[name].dtype
        del group[name]
        group.create_dataset(name, shape=shape, dtype=kind, chunks=chunks and tuple(map(min, chunks, shape)))
    with pytest.raises(
        CaptureError, match=rf"/receivers/front/{name}: declares \d+ bytes, of which the file holds \d+"
    ):
        open_capture(tmp_path / "run.h5")


def test_what_is_packed_well_is_no_fault() -> None:
    check_unfolded("run.h5", 200 << 20, 1)
    check_unfolded("run.h5", 49 << 30, 1 << 30)
    with pytest.raises(CaptureError, match=r"^run\.h5: declares"):
        check_unfolded("run.h5", 51 << 30, 1 << 30)


def test_more_taps_than_any_radar_has_are_refused() -> None:
    with pytest.raises(CaptureError, match=f"capture 'run 1': declares {MOST_TAPS + 1} taps"):
        capture_of(frames=1, taps=MOST_TAPS + 1, sts=False)


@pytest.mark.parametrize(("objects", "vertices"), [(MOST_OBJECTS + 1, 1), (1, MOST_VERTICES + 1)])
def test_more_objects_and_vertices_than_can_be_judged_are_refused(objects: int, vertices: int) -> None:
    some = Obstacle("box", "metal", np.zeros((vertices, 2)))
    with pytest.raises(CaptureError, match=r"capture 'run 1': declares .* may (be|have)"):
        dataclasses.replace(capture_of(), truth=Truth((some,) * objects))


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is packed may unfold to a megabyte."""
    monkeypatch.setattr(bounds, "_MOST_UNFOLDED", 1 << 20)


@pytest.mark.usefixtures("small")
def test_an_archive_that_unfolds_to_far_more_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "run.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("re.npy", bytes(2 << 20))
    with pytest.raises(CaptureError, match=r"run\.npz: declares \d+ bytes"):
        open_recording(tmp_path / "run.npz")
    with pytest.raises(StoreError, match=r"run\.npz: declares \d+ bytes"):
        read_map(tmp_path / "run.npz")


@pytest.mark.usefixtures("small")
def test_a_parquet_file_that_unfolds_to_far_more_is_refused(tmp_path: Path) -> None:
    pq.write_table(pa.table({"re": pa.array(np.zeros(300_000, np.int8))}), tmp_path / "run.parquet")
    with pytest.raises(CaptureError, match=r"run\.parquet: declares \d+ bytes"):
        open_recording(tmp_path / "run.parquet")
    with pytest.raises(StoreError, match=r"run\.parquet: declares \d+ bytes"):
        read_parquet(tmp_path / "run.parquet")
    pq.write_table(pa.table({"re": [1.0]}), tmp_path / "small.parquet")
    check_columns(tmp_path / "small.parquet", pq.ParquetFile(tmp_path / "small.parquet").metadata)


@pytest.mark.parametrize("place", ["position_m", "odometry_position_m", "the outline of 'box'"])
def test_coordinates_beyond_all_that_can_be_seen_are_refused(place: str) -> None:
    whole = capture_of()
    far = np.full((len(whole), 3), 1e300)
    parts = {
        "position_m": {"trajectory": dataclasses.replace(whole.trajectory, position_m=far)},
        "odometry_position_m": {"odometry_position_m": far},
        "the outline of 'box'": {"truth": Truth((Obstacle("box", "metal", far[:3, :2]),))},
    }
    with pytest.raises(CaptureError, match=f"capture 'run 1': {place} has a coordinate of 1e\\+300 m"):
        dataclasses.replace(whole, **parts[place])


def test_a_device_in_place_of_a_file_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "journal.jsonl").symlink_to("/dev/zero")
    with pytest.raises(StoreError, match=r"journal\.jsonl: cannot be read: is neither a file nor a folder"):
        read_json(tmp_path / "journal.jsonl")
