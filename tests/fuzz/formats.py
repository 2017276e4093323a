"""A small sound file of every format that is read, and what a run does with it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import yaml

from tests.api.written import capture_of
from tests.datasets.measured import test_dw1000 as dw1000
from tests.datasets.measured import test_et4173 as et4173
from tests.datasets.measured import test_pulson440 as pulson
from tests.datasets.measured import test_xethru as xethru
from tests.datasets.table import layouts
from uwbbench.api import Anchors, Capture, Messages, list_receivers, open_capture, write_capture
from uwbbench.config.detector import read_detector
from uwbbench.config.source import open_dataset
from uwbbench_datasets.measured.dw1000 import read_log
from uwbbench_datasets.measured.optitrack import read_motion
from uwbbench_datasets.measured.pulson440 import read_scans
from uwbbench_datasets.measured.xethru import read_recording


@dataclasses.dataclass(frozen=True)
class Format:
    """One format.

    Attributes
    ----------
    name : str
        Of the file.
    make : callable
        Writes the sound file, and what belongs to it, and is given its path.
    read : callable
        Reads all of it.
    """

    name: str
    make: Callable[[Path], None]
    read: Callable[[Path], object]


def _capture(path: Path) -> None:
    part = np.array([0, 2, 3])
    messages = Messages(np.array([7, 9, 7]), np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0]), np.ones(3, bool))
    anchors = Anchors(np.array([7, 9]), np.array([[1.0, 2.0], [3.0, 4.0]]), part, messages)
    empty = capture_of(frames=4, name="empty room", truth=None)
    write_capture(path, capture_of(background=empty, anchors=anchors))


def _packed(path: Path) -> None:
    write_capture(path, capture_of())
    with h5py.File(path, "a") as file:
        for name in ("preamble", "sts1", "sts2"):
            values = file[f"receivers/front/{name}"][...]
            del file[f"receivers/front/{name}"]
            file.create_dataset(
                f"receivers/front/{name}", data=values, chunks=(2, 5), compression="gzip", shuffle=True, fletcher32=True
            )


def _all_of(path: Path) -> None:
    for receiver in list_receivers(path):
        _looked_at(open_capture(path, receiver))


def _looked_at(capture: Capture) -> None:
    capture.frames()
    _ = capture.sha256
    if capture.truth is not None:
        capture.truth.seen_from(capture.radar, capture.trajectory)


COLUMNS: dict[str, Any] = {
    "t": np.arange(6.0),
    "re": np.arange(30.0).reshape(6, 5),
    "im": np.ones((6, 5)),
}
MAPPING = {
    "schema": 1,
    "radar": {"model": "any", "channel": 9, "bandwidth_hz": 5e8, "sample_interval_ns": 1.0, "frame_rate_hz": 50.0},
    "receivers": {"front": {"mount_position_m": [0, 0, 0], "mount_yaw_deg": 0, "tx_position_m": [0, 0, 0],
                            "noise_taps": 0}},
    "time": {"column": "t", "unit": "s"},
}  # fmt: skip


def _table(write: Callable[[Path, dict[str, Any]], None], suffix: str, *, numbered: bool = False) -> Format:
    def make(path: Path) -> None:
        arrays = {name: COLUMNS[name] for name in ("re", "im")}
        columns = layouts.numbered(arrays) if numbered else arrays
        names = {"i": "re_{tap}", "q": "im_{tap}"} if numbered else {"i": "re", "q": "im"}
        (path.parent / "mapping.yaml").write_text(yaml.safe_dump({**MAPPING, "preamble": names}))
        write(path, {"t": COLUMNS["t"], **columns})

    def read(path: Path) -> None:
        dataset = open_dataset("table", {"mapping": "mapping.yaml", "files": [path.name]}, [path.parent])
        for name in dataset.names():
            _looked_at(dataset.open(name))

    return Format(f"table.{suffix}", make, read)


def _motion(path: Path) -> None:
    rows = [(number, pulson.pose_row(0.01 * number, 0.1, (1.0, 2.0, 3.0))) for number in range(5)]
    path.write_text(pulson.motion_file(rows))


FORMATS = {
    "capture": Format("capture.h5", _capture, _all_of),
    "packed capture": Format("packed.h5", _packed, _all_of),
    "et4173": Format(
        "101_P1.mat",
        lambda path: path.write_bytes(et4173.mat()) and None,
        lambda path: _looked_at(et4173.walk(path.parent).open("101")),
    ),
    "pulson440": Format("scan.txt", lambda path: path.write_bytes(pulson.scan_file()) and None, read_scans),
    "optitrack": Format("motion.csv", _motion, lambda path: read_motion(path, "radar")),
    "xethru": Format(
        "xethru.dat",
        lambda path: path.write_bytes(xethru.baseband()) and None,
        lambda path: read_recording(path, "baseband_iq"),
    ),
    "dw1000": Format("1.log", lambda path: path.write_text(dw1000.log()) and None, read_log),
    "csv": _table(layouts.write_csv, "csv", numbered=True),
    "parquet": _table(layouts.write_parquet, "parquet"),
    "npz": _table(layouts.write_npz, "npz"),
    "mat": _table(layouts.write_mat, "mat"),
    "mat 7.3": _table(lambda path, columns: layouts.write_mat73(path, columns), "mat"),
    "hdf5": _table(layouts.write_hdf5, "h5"),
    "yaml": Format(
        "detector.yaml",
        lambda path: path.write_text(Path("configs/detectors/paper.yaml").read_text()) and None,
        lambda path: read_detector(str(path)),
    ),
}
