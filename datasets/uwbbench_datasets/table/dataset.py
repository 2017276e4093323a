"""Anybody's recording in tables, read by a mapping file and no code.

CSV, Parquet, NPZ, MAT or HDF5, one row or array entry a frame; see :mod:`uwbbench_datasets.table.mapping` for what a
mapping says and ``configs/mappings/template.yaml`` for one to start from.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import (
    Capture,
    CaptureError,
    Card,
    Dataset,
    FloatArray,
    IntArray,
    Params,
    Radar,
    Trajectory,
    Truth,
    nearest,
)
from uwbbench_datasets.capture_files import find_files, short_names
from uwbbench_datasets.table.columns import FrameColumns, labels_of, require_columns
from uwbbench_datasets.table.formats import open_recording
from uwbbench_datasets.table.mapping import ANGLE_RAD, TIME_S, TableMapping, read_mapping


class TableParams(Params):
    """Which mapping, and which files."""

    mapping: str = Field(description="Path of the mapping file.")
    files: list[str] = Field(
        default_factory=list, description="Paths or glob patterns; those that the mapping names if left out."
    )


@dataclass(frozen=True)
class _Part:
    """The rows of one file that make one capture; all of them where no column splits the file."""

    path: Path
    run: str
    receiver: str | None
    channel: int | None
    rows: IntArray | None
    recording: str


class Table(Dataset[TableParams]):
    """Recordings of one's own in tables, read through a mapping file.

    Each run, receiver and channel of a file is a capture, named ``file/run/receiver/ch9`` without the parts that no
    column separates.
    """

    card: ClassVar[Card] = Card(
        title="Tables of the user",
        license="as stated in the mapping",
        citation="as stated in the mapping",
        source="the user's own files",
    )

    @cached_property
    def _mapping_path(self) -> Path:
        return find_files([self.params.mapping], self.roots)[0]

    @cached_property
    def _mapping(self) -> TableMapping:
        return read_mapping(self._mapping_path)

    @cached_property
    def _files(self) -> dict[str, Path]:
        wanted = self._mapping.files  # read first: nothing else matters while the mapping is wrong
        if self.params.files:
            paths = find_files(self.params.files, self.roots)
        elif wanted:
            paths = self._below("files", wanted)
        else:
            raise CaptureError(f"{self._mapping_path}: names no files, and neither do the dataset's parameters")
        backgrounds = self._below("background", self._mapping.background)
        return short_names([path for path in paths if path not in backgrounds])

    def _below(self, key: str, patterns: list[str]) -> list[Path]:
        """Files that the mapping names under a key, in its folder or below."""
        folder = self._mapping_path.parent
        paths = find_files(patterns, [folder])
        outside = [path for path in paths if not path.is_relative_to(folder.resolve())]
        if outside:
            raise CaptureError(f"{self._mapping_path}: {key}: {outside[0]} lies outside the mapping's folder")
        return paths

    @cached_property
    def _backgrounds(self) -> dict[str, _Part]:
        """Recordings with nothing in view, by name."""
        parts: dict[str, _Part] = {}
        for stem, path in short_names(self._below("background", self._mapping.background)).items():
            parts |= self._parts(stem, path)
        return parts

    def _background(self, part: _Part) -> Capture | None:
        """Background of a capture: the one recording of its receiver on its channel."""
        if not self._mapping.background:
            return None
        fits = [
            (name, one)
            for name, one in self._backgrounds.items()
            if (one.receiver, one.channel) == (part.receiver, part.channel)
        ]
        if len(fits) != 1:
            names = f"several, {', '.join(name for name, _ in fits)}" if fits else "none"
            of_what = [f"receiver '{part.receiver}'"] if part.receiver else []
            of_what += [f"channel {part.channel}"] if part.channel else []
            wanted = f"one recording of {' on '.join(of_what) or 'the receiver'}"
            raise CaptureError(f"{self._mapping_path}: background: expected {wanted}, found {names}")
        ((name, found),) = fits
        try:
            return self._capture(name, found, background=True)
        except CaptureError as error:
            text = str(error)
            raise (error if text.startswith(str(found.path)) else CaptureError(f"{found.path}: {text}")) from None

    def names(self) -> list[str]:
        """One capture for each run, receiver and channel of each file.

        Raises
        ------
        ConfigError
            If the mapping is wrong.
        CaptureError
            If no file is found.
        """
        return list(self._runs)

    def runs(self) -> dict[str, tuple[str, ...]]:
        """The receivers of each run of each file; each channel is a run of its own."""
        runs: dict[str, tuple[str, ...]] = {}
        for name, run in self._runs.items():
            runs[run] = (*runs.get(run, ()), name)
        return runs

    @cached_property
    def _runs(self) -> dict[str, str]:
        """Run of each capture."""
        runs: dict[str, str] = {}
        by_channel = self._mapping.channel_column is not None
        for stem, path in self._files.items():
            try:
                parts = self._parts(stem, path)
            except CaptureError:
                runs[stem] = stem  # opening it raises the error
                continue
            for name, part in parts.items():
                runs[name] = f"{part.recording}/ch{part.channel}" if by_channel else part.recording
        return runs

    def open(self, name: str) -> Capture:
        """Read one capture.

        Raises
        ------
        ConfigError
            If the mapping is wrong.
        CaptureError
            If there is no such capture, a column is missing or a file damaged; names the file and the column.
        """
        for stem, path in self._files.items():
            if name == stem or name.startswith(f"{stem}/"):
                parts = self._parts(stem, path)
                if name in parts:
                    try:
                        return replace(self._capture(name, parts[name]), background=self._background(parts[name]))
                    except CaptureError as error:
                        text = str(error)
                        located = text.startswith((str(path), str(self._mapping_path.parent)))
                        raise (error if located else CaptureError(f"{path}: {text}")) from None
        raise CaptureError(f"no capture named '{name}'.{nearest(name, self.names())}")

    def _parts(self, stem: str, path: Path) -> dict[str, _Part]:
        """Captures in a file, by name."""
        mapping = self._mapping
        table = open_recording(path, mapping.delimiter)
        splitting = {
            key: column
            for key in ("run_column", "receiver_column", "channel_column")
            if (column := getattr(mapping, key)) is not None
        }
        if not splitting:
            return {stem: _Part(path, path.stem, None, mapping.radar.channel, None, stem)}
        require_columns(table, {column: key for key, column in splitting.items()})
        columns = table.read(list(splitting.values()))
        labels = {key: labels_of(columns[column], path, column) for key, column in splitting.items()}
        together: dict[tuple[str, ...], list[int]] = {}
        for row, key in enumerate(zip(*labels.values(), strict=True)):
            together.setdefault(key, []).append(row)
        parts: dict[str, _Part] = {}
        for key, rows in together.items():
            value = dict(zip(labels, key, strict=True))
            channel = mapping.radar.channel
            if "channel_column" in value:
                channel = _channel(value["channel_column"], path, splitting["channel_column"])
                value["channel_column"] = f"ch{channel}"
            name = "/".join((stem, *value.values()))
            run, receiver = value.get("run_column", path.stem), value.get("receiver_column")
            recording = f"{stem}/{run}" if "run_column" in value else stem
            parts[name] = _Part(path, run, receiver, channel, np.array(rows), recording)
        return parts

    def _capture(self, name: str, part: _Part, *, background: bool = False) -> Capture:
        mapping = self._mapping
        table = FrameColumns(open_recording(part.path, mapping.delimiter), mapping, part.rows)
        preamble = table.samples(mapping.preamble, "preamble")
        frames = len(preamble)
        sts = [table.samples(item, key) for key, item in (("sts1", mapping.sts1), ("sts2", mapping.sts2)) if item]
        rate_hz = mapping.radar.frame_rate_hz
        if mapping.time is not None:
            timestamp_s = table.vector(mapping.time.column, TIME_S[mapping.time.unit])
        else:
            timestamp_s = np.arange(frames) / (rate_hz or np.nan)
        reported: dict[str, Any] = {
            f"first_path_index{'' if key == 'preamble' else '_' + key}": table.vector(column)
            for key, column in (mapping.first_path.model_dump() if mapping.first_path else {}).items()
            if column is not None
        }
        position_m, yaw_rad = table.pose(mapping.pose) if mapping.pose else (np.zeros((frames, 3)), np.zeros(frames))
        odometry: dict[str, Any] = {}
        if mapping.odometry:
            odometry["odometry_position_m"], odometry["odometry_yaw_rad"] = table.pose(mapping.odometry)
        if len(timestamp_s) != frames:
            raise CaptureError(
                f"preamble has shape {preamble.shape}, but there are {len(timestamp_s)} timestamps; expected (frames, "
                "taps), or set taps_first"
            )
        radar = self._radar(part, preamble, rate_hz or _rate(timestamp_s), bool(sts), bool(reported))
        return Capture(
            name=name,
            radar=radar,
            trajectory=Trajectory(timestamp_s, position_m, yaw_rad),
            truth=self._truth(part, table, structure_alone=background),
            source=mapping.origin,
            license=mapping.license,
            citation=mapping.citation,
            description=mapping.description,
            preamble=preamble,
            sts1=sts[0] if sts else None,
            sts2=sts[1] if sts else None,
            **reported,
            **odometry,
            recording=part.recording,
            receivers=(radar.receiver,),
        )

    def _radar(self, part: _Part, preamble: np.ndarray, rate_hz: float, has_sts: bool, has_first_path: bool) -> Radar:
        mapping = self._mapping
        receiver = part.receiver or next(iter(mapping.receivers))
        if receiver not in mapping.receivers:
            hint = nearest(receiver, mapping.receivers)
            raise CaptureError(f"{self._mapping_path}: receivers: no entry for '{receiver}' in {part.path}.{hint}")
        mount = mapping.receivers[receiver]
        return Radar(
            model=mapping.radar.model,
            center_frequency_hz=mapping.radar.carrier_hz(part.channel),
            bandwidth_hz=mapping.radar.bandwidth_hz,
            sample_interval_s=mapping.radar.interval_s,
            frame_rate_hz=rate_hz,
            taps=int(preamble.shape[1]),
            samples="rf" if mapping.preamble.layout == ("real",) else "iq",
            channel=part.channel,
            receiver=receiver,
            mount_position_m=mount.mount_position_m,
            mount_yaw_rad=mount.mount_yaw_deg * ANGLE_RAD["deg"],
            tx_position_m=mount.tx_position_m,
            noise_taps=mount.noise_taps,
            array_spacing_m=mount.array_spacing_m,
            first_tap_delay_s=mount.first_tap_delay_s,
            has_sts=has_sts,
            has_first_path=has_first_path,
        )

    def _truth(self, part: _Part, table: FrameColumns, *, structure_alone: bool) -> Truth | None:
        facts, column = self._mapping.truth, self._mapping.material_column
        if facts is None:
            return None
        material = "unknown"
        if column is not None:
            materials = list(dict.fromkeys(labels_of(table.cells(column), part.path, column)))
            if len(materials) > 1:
                several = ", ".join(materials)
                raise CaptureError(
                    f"column '{column}' holds several materials in one capture ({several}); "
                    "name a run_column that separates them"
                )
            material = materials[0] if materials else material
        present = [item for item in facts.objects if item.runs is None or part.run in item.runs]
        seen = [item for item in present if item.structure or not structure_alone]
        return Truth(tuple(item.obstacle(material) for item in seen), facts.exhaustive)


def _channel(text: str, path: Path, column: str) -> int:
    number = re.fullmatch(r"(?:ch(?:annel)?)?[ _-]?(\d+)", text, re.IGNORECASE)
    if number is None:
        raise CaptureError(f"{path}: column '{column}': expected a channel number, found '{text}'")
    return int(number[1])


def _rate(timestamp_s: FloatArray) -> float:
    spacing = float(np.median(np.diff(timestamp_s))) if len(timestamp_s) > 1 else 0.0
    if not spacing > 0:
        raise CaptureError("no frame rate follows from the timestamps; give radar.frame_rate_hz in the mapping")
    return 1 / spacing
