"""Poses and maps in a run folder: they come back exactly, and what is damaged is refused in one message."""

import dataclasses
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from uwbbench.api import Detections, Grid, Landmarks, Map, Mapped, Poses, Radar, StoreError
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.truth import Trajectory
from uwbbench.run.folder import RunFolder
from uwbbench.run.folder.mapped import read_map, write_map

TIME_S = np.arange(10) / 8


def made(*, smoothed=True, covariance=True, grid=True) -> Mapped:
    rng = np.random.default_rng(1)
    root = rng.normal(0, 1, (6, 3, 3))
    poses = Poses(np.arange(6) + 2, rng.normal(0, 1, (6, 3)), root + root.transpose(0, 2, 1) if covariance else None)
    landmarks = Landmarks(
        np.array([4, 7]),
        np.array([0, 2]),
        rng.normal(0, 1, 2),
        rng.normal(0, 1, 2),
        rng.normal(0, 1, (2, 2, 2)),
        np.array([3, 1]),
    )
    cells = Grid(np.array([-1.0, 2.0]), 0.05, rng.normal(0, 1, (3, 4))) if grid else None
    later = Poses(np.arange(5), rng.normal(0, 1, (5, 3))) if smoothed else None
    return Mapped(poses, Map(landmarks, rng.normal(0, 1, (3, 2, 2)), rng.normal(0, 1, (4, 2)), cells), later)


def arrays(value):
    """All arrays and numbers in a dataclass, by their place."""
    if dataclasses.is_dataclass(value):
        return [part for field in dataclasses.fields(value) for part in arrays(getattr(value, field.name))]
    return [value]


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.create(tmp_path / "run", {"experiment": {}})


def stored(folder: RunFolder, mapped: Mapped | None) -> Mapped | None:
    folder.write_detections("unit", Detections([1], range_m=[2.0], receiver=[0]), None)
    folder.write_mapped("unit", mapped, TIME_S)
    return folder.detections("unit").mapped


@pytest.mark.parametrize("lacking", [{}, {"smoothed": False}, {"covariance": False}, {"grid": False}])
def test_poses_and_map_come_back_exactly(folder: RunFolder, lacking: dict[str, bool]) -> None:
    mapped = made(**lacking)
    back = stored(folder, mapped)
    for own, read in zip(arrays(mapped), arrays(back), strict=True):
        assert type(own) is type(read)
        np.testing.assert_array_equal(read, own)
        assert getattr(own, "dtype", None) == getattr(read, "dtype", None)


def test_a_mapper_without_any_answer_is_stored_too(folder: RunFolder) -> None:
    back = stored(folder, Mapped(Poses.none(), Map()))
    assert back is not None
    assert (len(back.poses), len(back.map.landmarks), back.smoothed, back.map.grid) == (0, 0, None, None)


def test_the_table_of_poses_is_one_that_people_can_read(folder: RunFolder) -> None:
    stored(folder, made())
    table = pq.read_table(folder.path / "poses" / "unit.parquet").to_pandas()
    assert list(table)[:6] == ["smoothed", "index", "time_s", "x_m", "y_m", "yaw_rad"]
    assert [name for name in table if name.startswith("covariance")] == [
        f"covariance_{pair}" for pair in ("0_0", "0_1", "0_2", "1_1", "1_2", "2_2")
    ]
    assert table["time_s"].tolist() == [*TIME_S[2:8], *TIME_S[:5]]
    assert table["smoothed"].sum() == 5


def test_a_plain_detector_and_a_folder_of_an_earlier_version_have_none(folder: RunFolder) -> None:
    stored(folder, made())
    assert stored(folder, None) is None
    assert not (folder.path / "maps" / "unit.npz").exists()


def test_they_are_results_and_are_sealed(folder: RunFolder) -> None:
    stored(folder, made())
    assert folder.result_files() == ["detections/unit.parquet", "maps/unit.npz", "poses/unit.parquet"]


@pytest.mark.parametrize("name", ["poses/unit.parquet", "maps/unit.npz"])
@pytest.mark.parametrize("damage", ["missing", "empty", "cut", "other", "turned"])
def test_a_damaged_file_is_one_message_that_names_it(folder: RunFolder, name: str, damage: str) -> None:
    stored(folder, made())
    path = folder.path / name
    content = path.read_bytes()
    if damage == "missing":
        path.unlink()
    else:
        middle = len(content) // 3
        turned = (
            content[:middle] + bytes(255 - byte for byte in content[middle : middle + 400]) + content[middle + 400 :]
        )
        path.write_bytes({"empty": b"", "cut": content[:-50], "other": b"hello\n" * 50, "turned": turned}[damage])
    with pytest.raises(StoreError) as refused:
        folder.detections("unit")
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


def rewritten(path: Path, **changes) -> Path:
    """The stored map with other arrays; None takes one out."""
    write_map(path, made().map)
    with np.load(path) as stored:
        arrays = {**stored, **changes}
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    return path


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"points_m": None}, "it has no array 'points_m'"),
        ({"grid_cell_m": None}, "it has no array 'grid_cell_m'"),
        ({"points_m": np.zeros((2, 3))}, r"'points_m' must be real numbers of shape \(n, 2\), not float64 of \(2, 3\)"),
        ({"points_m": np.zeros((2, 2), int)}, r"'points_m' must be real numbers"),
        ({"landmark_kind": np.array([0.0, 1.0])}, "'landmark_kind' must be whole numbers"),
        ({"landmark_kind": np.array([0, 3])}, "landmarks are of the kinds 0 to 2"),
        ({"landmark_a": np.zeros(3)}, "the columns of its landmarks differ in length"),
        ({"points_m": np.array([[print, 1]], dtype=object)}, "is not a readable map: ValueError: Object arrays"),
    ],
)
def test_arrays_that_are_no_map_are_refused_with_what_was_expected(tmp_path: Path, changes, reason) -> None:
    with pytest.raises(StoreError, match=reason):
        read_map(rewritten(tmp_path / "map.npz", **changes))


def test_a_table_that_holds_no_poses_is_refused(folder: RunFolder) -> None:
    stored(folder, made())
    path = folder.path / "poses" / "unit.parquet"
    pq.write_table(pa.table({"index": [1, 2]}), path)
    with pytest.raises(StoreError, match="is no table of poses"):
        folder.detections("unit")


def test_the_radars_of_a_run_come_back_with_its_header(folder: RunFolder) -> None:
    radar = Radar("test", 8e9, 5e8, 1e-9, 8.0, 50)
    side = dataclasses.replace(radar, receiver="side", mount_yaw_rad=1.5, mount_position_m=(0.1, 0.2, 0.3))
    track = Trajectory(TIME_S, np.zeros((10, 3)), np.zeros(10))
    for radars in ((radar, side), ()):
        header = CaptureHeader(name="run", radar=radar, trajectory=track, radars=radars)
        folder.write_header(f"run{len(radars)}", header, "sha")
        assert folder.header(f"run{len(radars)}").radars == radars
