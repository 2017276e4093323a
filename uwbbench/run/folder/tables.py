"""Detections, curves and capture headers as Parquet tables and JSON."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from uwbbench.api.arrays import IntArray
from uwbbench.api.capture import CaptureHeader
from uwbbench.api.detections import HANDED_OUT, Detections
from uwbbench.api.radar import Radar
from uwbbench.api.truth import Obstacle, Trajectory, Truth
from uwbbench.measure.accuracy.ranked import RankedCounts
from uwbbench.run.folder.files import read_json, read_parquet, write_json, write_parquet

_ABOUT = ("name", "source", "license", "citation", "description")
_LATER = ("recording", "robot")
"""Texts about a capture: those that are always there, and those that earlier versions did not store."""


def as_spans(frames: IntArray) -> list[list[int]]:
    """Sorted frame indices as ``[first, last + 1]`` spans.

    Examples
    --------
    >>> as_spans(np.array([0, 1, 2, 5]))
    [[0, 3], [5, 6]]
    """
    if not len(frames):
        return []
    breaks = np.flatnonzero(np.diff(frames) != 1) + 1
    return [[int(run[0]), int(run[-1]) + 1] for run in np.split(frames, breaks)]


def from_spans(spans: Iterable[Sequence[int]]) -> IntArray:
    """Frame indices of spans."""
    runs = [np.arange(start, stop, dtype=np.int64) for start, stop in spans]
    return np.concatenate(runs) if runs else np.empty(0, np.int64)


def write_detections(path: Path, detections: Detections) -> None:
    """Store detections with the frames that were processed, the notes, the chain, and when they were handed out."""
    import pyarrow as pa

    facts: dict[str, Any] = {
        "processed": as_spans(detections.processed),
        "notes": detections.notes,
        "chain": list(detections.chain.items()),
    }
    if detections.answered is not None:
        at_once = np.array_equal(detections.answered, detections.processed)
        facts["answered"] = "at once" if at_once else detections.answered.tolist()
    write_parquet(path, pa.table(dict(detections.columns)), facts)


def read_detections(path: Path, candidates: Path | None = None) -> Detections:
    """Stored detections; with their candidates where those are given."""
    table, facts = read_parquet(path)
    columns: dict[str, Any] = {name: table.column(name).to_numpy() for name in table.column_names}
    read = Detections(
        **columns,
        processed=from_spans(facts["processed"]),
        notes=facts["notes"],
        chain=dict(facts["chain"]),
        candidates=None if candidates is None else read_detections(candidates),
    )
    answered = facts.get("answered")  # earlier versions did not store it
    if answered is None:
        return read
    return read.with_hand_outs(columns[HANDED_OUT], read.processed if answered == "at once" else answered)


def write_curve(path: Path, counts: RankedCounts, rules: Mapping[str, Any]) -> None:
    """Store what a detector would give at every threshold.

    Parameters
    ----------
    path : Path
    counts : RankedCounts
    rules : mapping
        Gate and region that gave them.
    """
    import pyarrow as pa

    columns = {"score": counts.score, "tp": counts.tp.astype(np.int32), "fp": counts.fp.astype(np.int32)}
    keys = ("there", "duration_s", "order", "set_tp", "set_fp", "exhaustive")
    write_parquet(path, pa.table(columns), {"counts": {key: getattr(counts, key) for key in keys}, "rules": rules})


def read_curve(path: Path) -> tuple[RankedCounts, Mapping[str, Any]]:
    """What a detector would give at every threshold, and the gate and region that gave it."""
    table, facts = read_parquet(path)
    score, tp, fp = (table.column(name).to_numpy() for name in ("score", "tp", "fp"))
    counts = RankedCounts(score, tp.astype(np.int64), fp.astype(np.int64), **facts["counts"])
    return counts, facts["rules"]


def write_header(stem: Path, header: CaptureHeader, sha256: str) -> None:
    """Store all of a capture but its samples as ``stem.json`` and, per frame, ``stem.parquet``.

    Parameters
    ----------
    stem : Path
        Of both files, without a suffix.
    header : CaptureHeader
    sha256 : str
        Of the capture's content, samples included.
    """
    import pyarrow as pa

    track = header.trajectory
    columns: dict[str, Any] = {"timestamp_s": track.timestamp_s, "yaw_rad": track.yaw_rad}
    columns |= {f"{axis}_m": track.position_m[:, index] for index, axis in enumerate("xyz")}
    objects = []
    for index, item in enumerate(header.truth.objects if header.truth else ()):
        label: dict[str, Any] = {"name": item.name, "material": item.material, "structure": item.structure}
        if item.moves:
            label["moves"] = list(item.outline_m.shape[1:])
            flat = np.ascontiguousarray(item.outline_m, np.float64).reshape(len(track), -1)
            columns |= {f"outline_{index}_{place}": flat[:, place] for place in range(flat.shape[1])}
        else:
            label["outline_m"] = item.outline_m
        objects.append(label)
    about = {name: getattr(header, name) for name in (*_ABOUT, *_LATER)}
    truth = None if header.truth is None else {"exhaustive": header.truth.exhaustive, "objects": objects}
    write_parquet(stem.with_suffix(".parquet"), pa.table(columns), {})
    about |= {"sha256": sha256, "radar": header.radar.to_dict(), "truth": truth}
    if header.radars:
        about["radars"] = [radar.to_dict() for radar in header.radars]
    write_json(stem.with_suffix(".json"), about)


def read_header(stem: Path) -> CaptureHeader:
    """Stored capture header."""
    data = read_json(stem.with_suffix(".json"))
    table, _ = read_parquet(stem.with_suffix(".parquet"))

    def column(name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
        return np.asarray(table.column(name).to_numpy(), dtype=np.float64)

    truth = None
    if data["truth"] is not None:
        objects = []
        for index, label in enumerate(data["truth"]["objects"]):
            if "moves" in label:
                vertices, axes = label["moves"]
                flat = [column(f"outline_{index}_{place}") for place in range(vertices * axes)]
                outline = np.stack(flat, axis=1).reshape(-1, vertices, axes)
            else:
                outline = np.asarray(label["outline_m"], dtype=np.float64)
            objects.append(Obstacle(label["name"], label["material"], outline, label["structure"]))
        truth = Truth(tuple(objects), data["truth"]["exhaustive"])
    position_m = np.stack([column(f"{axis}_m") for axis in "xyz"], axis=1)
    return CaptureHeader(
        **{name: data[name] for name in _ABOUT},
        **{name: data[name] for name in _LATER if name in data},
        radar=_radar(data["radar"]),
        trajectory=Trajectory(column("timestamp_s"), position_m, column("yaw_rad")),
        truth=truth,
        radars=tuple(_radar(one) for one in data.get("radars", ())),
    )


def _radar(stored: Mapping[str, Any]) -> Radar:
    """Radar as a capture's file has it."""
    values: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in stored.items()}
    return Radar(**values)
