"""The mapping file of the ``table`` adapter: which of somebody's columns is what.

A mapping is one YAML file; ``configs/mappings/template.yaml`` shows every key with a comment. Its keys are the fields
of :class:`TableMapping`. Columns are named as the recording names them. Units are always stated, never guessed.
"""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from uwbbench.api import (
    CHANNEL_CENTER_HZ,
    CaptureError,
    ConfigError,
    FloatArray,
    Obstacle,
    Params,
    YamlFile,
    checked,
    read_yaml,
)

Vector = tuple[float, float, float]
Point = tuple[float, float]

TIME_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
LENGTH_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
ANGLE_RAD = {"rad": 1.0, "deg": math.pi / 180}


class RadarFacts(Params):
    """What is true of the radar, whichever receiver or channel a row is of."""

    model: str = Field(description="Device name, for people.")
    channel: int | None = Field(None, description="IEEE 802.15.4 channel, where no column gives it.")
    center_frequency_hz: float | dict[int, float] | None = Field(
        None, description="Carrier, or one for each channel; may be left out for channels 5 and 9."
    )
    bandwidth_hz: float = Field(gt=0)
    sample_interval_s: float | None = Field(None, gt=0, description="Spacing of the taps; or sample_interval_ns.")
    sample_interval_ns: float | None = Field(None, gt=0)
    frame_rate_hz: float | None = Field(
        None, gt=0, description="Frames a second of one capture; the median spacing of its timestamps if left out."
    )

    @model_validator(mode="after")
    def _one_interval(self) -> RadarFacts:
        if (self.sample_interval_s is None) == (self.sample_interval_ns is None):
            raise ValueError("give either sample_interval_s or sample_interval_ns")
        return self

    @property
    def interval_s(self) -> float:
        """Spacing of the taps in seconds."""
        return self.sample_interval_s or (self.sample_interval_ns or 0.0) * 1e-9

    def carrier_hz(self, channel: int | None) -> float:
        """Carrier on a channel.

        Raises
        ------
        CaptureError
            If neither the mapping nor the standard's table has it.
        """
        given = self.center_frequency_hz
        if isinstance(given, float | int):
            return float(given)
        known = {**CHANNEL_CENTER_HZ, **(given or {})}
        if channel not in known:
            raise CaptureError(f"radar.center_frequency_hz is missing for channel {channel}")
        return known[channel]


class ReceiverFacts(Params):
    """Where a receiver and its transmitter sit on the robot; see the capture format for the conventions."""

    mount_position_m: Vector = Field(description="Receiver in the robot frame.")
    mount_yaw_deg: float = Field(description="Boresight in the robot frame, counter-clockwise from forward.")
    tx_position_m: Vector = Field(description="Transmitter in the robot frame; the mount again where monostatic.")
    noise_taps: int = Field(ge=0, description="Leading taps that precede any arrival; 0 if none.")
    array_spacing_m: float | None = Field(None, gt=0, description="Distance of the antennas behind STS1 and STS2.")
    first_tap_delay_s: float | None = Field(
        None, description="Delay of tap 0 from transmission; left out where delays count from the direct path."
    )


class SampleColumns(Params):
    """How the impulse responses are stored: exactly one of five layouts.

    ``i`` and ``q``; ``magnitude`` and ``phase``; ``complex``; ``interleaved`` (I0 Q0 I1 Q1 ...); or ``real`` (RF).
    A name with ``{tap}`` stands for one column a tap, numbered consecutively from any start (``i_{tap}``); a name
    without it for one column whose cells are arrays.
    """

    i: str | None = None
    q: str | None = None
    complex_: str | None = Field(None, alias="complex")
    interleaved: str | None = None
    magnitude: str | None = None
    phase: str | None = None
    phase_unit: Literal["rad", "deg"] | None = Field(None, description="Needed with phase.")
    real: str | None = None
    scale: float = Field(1.0, description="Factor on all samples.")
    taps_first: bool = Field(False, description="Arrays are stored (taps, frames) instead of (frames, taps).")

    @model_validator(mode="after")
    def _one_layout(self) -> SampleColumns:
        if self.layout not in (("i", "q"), ("complex",), ("interleaved",), ("magnitude", "phase"), ("real",)):
            given = ", ".join(self.layout) or "nothing"
            raise ValueError(f"expected i and q, magnitude and phase, complex, interleaved, or real; found {given}")
        if (self.phase is None) != (self.phase_unit is None):
            raise ValueError("phase and phase_unit (rad or deg) belong together")
        return self

    @property
    def layout(self) -> tuple[str, ...]:
        """Keys given of those that name columns."""
        names = ("i", "q", "complex", "interleaved", "magnitude", "phase", "real")
        return tuple(name for name in names if self.pattern(name) is not None)

    def pattern(self, key: str) -> str | None:
        """Column name or pattern behind a key."""
        name: str | None = getattr(self, "complex_" if key == "complex" else key)
        return name


class TimeColumn(Params):
    """Timestamps."""

    column: str
    unit: Literal["s", "ms", "us", "ns"]


class PoseColumns(Params):
    """Pose of the robot in the world."""

    x: str
    y: str
    z: str | None = Field(None, description="0 if left out.")
    yaw: str
    length_unit: Literal["m", "cm", "mm"]
    angle_unit: Literal["rad", "deg"]


class FirstPathColumns(Params):
    """Fractional tap of the direct path as the chip reports it, counted from the first tap as 0."""

    preamble: str
    sts1: str | None = None
    sts2: str | None = None


class ObjectFacts(Params):
    """One labelled object: an outline in the world, or a rectangle by centre, size and yaw."""

    id: str = Field(min_length=1)
    material: str | None = Field(None, description="Left out where material_column gives it.")
    outline_m: list[tuple[float, ...]] | None = Field(None, description="Corners [x, y] or [x, y, z]; one is a point.")
    center_m: Point | None = None
    size_m: Point | None = Field(None, description="Extent along the object's own x and y.")
    yaw_deg: float = 0.0
    structure: bool = Field(False, description="A wall or the like, which no detector is asked to find.")
    runs: list[str] | None = Field(None, description="Runs in which the object stands; all if left out.")

    @model_validator(mode="after")
    def _one_shape(self) -> ObjectFacts:
        box = self.center_m is not None and self.size_m is not None
        half = (self.center_m is None) != (self.size_m is None)
        if half or box == (self.outline_m is not None):
            raise ValueError("give either outline_m, or center_m and size_m")
        lengths = {len(corner) for corner in self.outline_m or [(0.0, 0.0)]}
        if lengths not in ({2}, {3}):
            raise ValueError("outline_m needs at least one corner, all of 2 or all of 3 coordinates")
        return self

    def obstacle(self, material: str) -> Obstacle:
        """Object in the world, of its own material or else the given one."""
        if self.outline_m is not None:
            outline = np.array(self.outline_m, float)
        else:
            half: FloatArray = np.array(self.size_m, float) / 2
            cosine, sine = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
            corners = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]]) * half
            outline = np.array(self.center_m) + corners @ np.array([[cosine, sine], [-sine, cosine]])
        return Obstacle(self.id, self.material or material, outline, self.structure)


class TruthFacts(Params):
    """Labelled objects, written here or in a CSV file beside the mapping."""

    exhaustive: bool = Field(description="false where unlabelled objects are visible too.")
    objects: list[ObjectFacts] = Field(default_factory=list)
    objects_file: str | None = Field(
        None,
        description="CSV below the mapping's folder with columns id, material, structure, runs (names separated by "
        "blanks) and either outline_m ('x y; x y; ...') or center_x_m, center_y_m, size_x_m, size_y_m, yaw_deg.",
    )


class TableMapping(Params):
    """A mapping from the columns of a recording to a capture."""

    version: Literal[1] = Field(alias="schema", description="Version of this file format.")
    files: list[str] = Field(default_factory=list, description="Paths or globs below the mapping's folder.")
    delimiter: str = Field(",", min_length=1, max_length=1, description="Between the columns of a CSV file.")
    origin: Literal["measured", "simulated"] = "measured"
    license: str = "unknown"
    citation: str = ""
    description: str = ""
    radar: RadarFacts
    receivers: dict[str, ReceiverFacts] = Field(min_length=1, description="By name; one name if no column gives it.")
    run_column: str | None = None
    receiver_column: str | None = None
    channel_column: str | None = None
    material_column: str | None = Field(None, description="Material of the objects that state none themselves.")
    preamble: SampleColumns
    sts1: SampleColumns | None = None
    sts2: SampleColumns | None = None
    time: TimeColumn | None = Field(None, description="Left out, frames follow one another at radar.frame_rate_hz.")
    first_path: FirstPathColumns | None = None
    pose: PoseColumns | None = None
    odometry: PoseColumns | None = None
    truth: TruthFacts | None = None
    background: list[str] = Field(
        default_factory=list,
        description="Paths or globs, below the mapping's folder, of recordings with the same columns and nothing in "
        "view: the background of the captures of the same receiver and channel. They are no captures themselves.",
    )

    @field_validator("receivers", mode="before")
    @classmethod
    def _named(cls, value: Any) -> Any:
        return {str(name): facts for name, facts in value.items()} if isinstance(value, dict) else value

    @model_validator(mode="after")
    def _consistent(self) -> TableMapping:
        if (self.sts1 is None) != (self.sts2 is None):
            raise ValueError("give both sts1 and sts2, or neither")
        if any(part is not None and part.layout == ("real",) for part in (self.sts1, self.sts2)):
            raise ValueError("sts1 and sts2 are complex; 'real' is for the preamble of an RF radar")
        if self.receiver_column is None and len(self.receivers) > 1:
            raise ValueError("several receivers need a receiver_column that separates them")
        if self.time is None and self.radar.frame_rate_hz is None:
            raise ValueError("without a time column, radar.frame_rate_hz must be given")
        return self


def read_mapping(path: Path) -> TableMapping:
    """Read a mapping file, and the objects file that it names.

    Raises
    ------
    ConfigError
        If a file cannot be read or a key is wrong; names the file, every wrong key and the nearest valid one.
    """
    source = read_yaml(path)
    mapping = checked(TableMapping, source.data, source)
    inside = (
        *mapping.files,
        *mapping.background,
        *([mapping.truth.objects_file] if mapping.truth and mapping.truth.objects_file else []),
    )
    for name in inside:
        below(path.parent, name)
    truth = mapping.truth
    if truth is None:
        return mapping
    listed = read_objects(below(path.parent, truth.objects_file)) if truth.objects_file else []
    whole = truth.model_copy(update={"objects": [*truth.objects, *listed]})
    if not whole.objects:
        raise ConfigError(f"{path}: truth: expected objects or an objects_file with rows")
    nameless = [item.id for item in whole.objects if item.material is None]
    if nameless and mapping.material_column is None:
        raise ConfigError(f"{path}: truth: no material for {', '.join(nameless)}; state it, or name a material_column")
    return mapping.model_copy(update={"truth": whole})


def below(folder: Path, name: str) -> Path:
    """Path that a mapping names, in the mapping's folder.

    Raises
    ------
    ConfigError
        If it leads out of that folder, by ``..``, as an absolute path or through a link.
    """
    if "\0" in name:
        raise ConfigError(f"{name!r} names no file below {folder}: it holds a NUL character")
    path = folder / name
    if Path(name).is_absolute() or ".." in Path(name).parts or not path.resolve().is_relative_to(folder.resolve()):
        raise ConfigError(
            f"'{name}' must lie below the mapping's folder {folder}; name files elsewhere in 'files' "
            "of the dataset's parameters"
        )
    return path


def read_objects(path: Path) -> list[ObjectFacts]:
    """Objects of a CSV file.

    Raises
    ------
    ConfigError
        If it cannot be read or a row is wrong; names file and line.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [(reader.line_num, row) for reader in [csv.DictReader(file)] for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path}: cannot be read as CSV: {error}") from error
    objects = []
    for line, row in rows:
        fields = _object(row, f"{path}:{line}")
        objects.append(checked(ObjectFacts, fields, YamlFile(f"{path}:{line}", fields, {})))
    return objects


def _object(row: dict[str, Any], where: str) -> dict[str, Any]:
    """Fields of :class:`ObjectFacts` from the flat columns of one CSV row."""
    given = {name: text for name, text in row.items() if text not in (None, "")}
    if None in given:
        raise ConfigError(f"{where}: more cells than columns")
    fields = dict(given)
    for key in ("center", "size"):
        pair = [fields.pop(f"{key}_{axis}_m", None) for axis in "xy"]
        if pair != [None, None]:
            fields[f"{key}_m"] = pair
    if "outline_m" in fields:
        fields["outline_m"] = [re.split(r"[\s,]+", corner.strip()) for corner in fields["outline_m"].split(";")]
    if "runs" in fields:
        fields["runs"] = fields["runs"].split()
    return fields
