"""DecaRanging logs of a DW1000: channel impulse responses between an anchor and a tag."""

from __future__ import annotations

import csv
import dataclasses
import io
import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from uwbbench.api import (
    Anchors,
    Capture,
    CaptureError,
    Card,
    Dataset,
    DatasetFile,
    FloatArray,
    IntArray,
    Messages,
    Params,
    Radar,
    Trajectory,
    nearest,
)
from uwbbench_datasets.measured.recordings import content, list_recordings, mean_frame_rate_hz

CHIP_HZ = 499.2e6
TICK_S = 1 / (128 * CHIP_HZ)
"""Unit of the chip's 40-bit receive time, which starts anew every 17.2 s (DW1000 User Manual, RX_STAMP)."""
CHANNELS = {
    1: (3494.4e6, 499.2e6),
    2: (3993.6e6, 499.2e6),
    3: (4492.8e6, 499.2e6),
    4: (3993.6e6, 900e6),
    5: (6489.6e6, 499.2e6),
    7: (6489.6e6, 900e6),
}
"""Centre frequency and receiver bandwidth by channel (DW1000 User Manual, table of supported channels)."""

_CHANNEL = re.compile(r"\bChan (\d+)\b")
_LENGTH = re.compile(r"Accum Len ([1-9]\d{0,4})\s*")
_RECEPTION = re.compile(r"RX OK .*\bHLP\((\d+\.\d+)\).*\bRC\(([0-9A-F]{4}) ([0-9A-F]{8})\)")
_DISTANCE = re.compile(r"Anchor ToF: .*\bDist: (-?\d+\.\d+) m\b")
_TAP = re.compile(r"-?\d{1,9}, *-?\d{1,9}[ \t\r]*", re.ASCII)


@dataclass(frozen=True)
class Log:
    """Good receptions of a log.

    Attributes
    ----------
    channel : int
    samples : (frames, taps) complex64 array
        The accumulator.
    first_path_index : (frames,) array
        Fractional tap of the direct path, by the chip's leading-edge detection.
    timestamp_s : (frames,) array
        From the first reception, by the chip's clock.
    distance_m : (n,) array
        Of the tag, each from an exchange of several messages, as the anchor reports it (``Dist:``).
    distance_frame : (n,) int array
        Frame in whose reception each exchange ended.
    """

    channel: int
    samples: NDArray[np.complex64]
    first_path_index: FloatArray
    timestamp_s: FloatArray
    distance_m: FloatArray = field(default_factory=lambda: np.zeros(0))
    distance_frame: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))


def read_log(path: Path) -> Log:
    """All receptions that the chip called good, with their accumulators, and the distances that the anchor reports.

    An accumulator after ``RX E`` belongs to a reception with an error: the chip gives no direct path for it, and it is
    left out, as is a distance from before the first good reception. Two good receptions 17.2 s apart or more would be
    placed too close together in time, as the chip's clock has started anew in between.

    Raises
    ------
    CaptureError
        If an accumulator is incomplete, of another length than the first, or without its reception; names the line.
    """
    lines = content(path).decode("latin-1").replace("\r\n", "\n").split("\n")
    channel = next((int(match[1]) for line in lines[:10] if (match := _CHANNEL.search(line))), None)
    if channel not in CHANNELS:
        raise CaptureError(f"{path}: no DW1000 channel ('Chan N') in the first ten lines: not a DecaRanging log")
    taps = 0
    samples: list[NDArray[np.complex64]] = []
    first_path: list[float] = []
    ticks: list[int] = []
    distances: list[tuple[float, int]] = []
    for number, line in enumerate(lines):
        reported = _DISTANCE.match(line)
        if reported is not None and samples:
            distances.append((float(reported[1]), len(samples) - 1))
        if not line.startswith("Accum"):
            continue
        length = _LENGTH.fullmatch(line)
        if length is None or int(length[1]) != (taps or int(length[1])):
            expected = f"'Accum Len {taps}'" if taps else "'Accum Len' and a number"
            raise CaptureError(f"{path}: line {number + 1}: expected {expected}, not '{line[:40]}'")
        taps = int(length[1])
        accumulator = _accumulator(path, lines, number + 1, taps)
        before = lines[number - 1]
        if before.startswith("RX E"):
            continue
        reception = _RECEPTION.match(before)
        if reception is None:
            raise CaptureError(f"{path}: line {number}: expected 'RX OK' with HLP and RC before the accumulator")
        samples.append(accumulator)
        first_path.append(float(reception[1]))
        ticks.append(int(reception[2] + reception[3], 16))
    if not samples:
        raise CaptureError(f"{path}: holds no reception with its accumulator ('RX OK', 'Accum Len')")
    passed = np.diff(np.array(ticks), prepend=ticks[0]) % 2**40
    distance_m, frame = np.array(distances).reshape(-1, 2).T
    return Log(
        channel,
        np.array(samples),
        np.array(first_path),
        np.cumsum(passed) * TICK_S,
        distance_m,
        frame.astype(np.int64),
    )


def _accumulator(path: Path, lines: list[str], start: int, taps: int) -> NDArray[np.complex64]:
    """Taps (taps,) from the lines that follow."""
    block = lines[start : start + taps]
    good = next((count for count, line in enumerate(block) if not _TAP.fullmatch(line)), len(block))
    if good < taps:
        raise CaptureError(
            f"{path}: line {start + good + 1}: the accumulator of line {start} ends after {good} of {taps} taps"
        )
    pairs = np.array([line.split(",") for line in block]).astype(np.float32)
    return (pairs[:, 0] + 1j * pairs[:, 1]).astype(np.complex64)


def read_table(path: Path, columns: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Cells of the given columns of a CSV file, by the cell in the first of them.

    Raises
    ------
    CaptureError
        If a column is missing or a row is incomplete; names the file and the line.
    """
    text = content(path).decode("utf-8-sig", errors="replace")
    reader = csv.DictReader(io.StringIO(text, newline=""))
    missing = [name for name in columns if name not in (reader.fieldnames or ())]
    if missing:
        raise CaptureError(f"{path}: line 1: no column '{missing[0]}'; expected {', '.join(columns)}")
    table: dict[str, tuple[str, ...]] = {}
    for row in reader:
        cells = [row[name] for name in columns]
        if not all(cells):
            raise CaptureError(f"{path}: line {reader.line_num}: expected {', '.join(columns)}, not {cells}")
        table[cells[0]] = tuple(cells[1:])
    return table


BEFORE_TAPS, NOISE_TAPS = 6, 4
"""Taps of a cropped window before the reported first path, and how many of them hold noise alone."""


def around_first_path(log: Log, taps: int) -> Log:
    """The part of each accumulator that starts :data:`BEFORE_TAPS` taps before its first path.

    Samples beyond the accumulator's end are zero.

    Parameters
    ----------
    log : Log
    taps : int
        Length of the window.
    """
    start = np.floor(log.first_path_index).astype(np.int64) - BEFORE_TAPS
    at = start[:, None] + np.arange(taps)
    within = (at >= 0) & (at < log.samples.shape[1])
    rows = np.arange(len(at))[:, None]
    cropped = np.where(within, log.samples[rows, np.where(within, at, 0)], 0).astype(np.complex64)
    return dataclasses.replace(log, samples=cropped, first_path_index=log.first_path_index - start)


class Dw1000ApartmentParams(Params):
    """Which logs, and how much of each accumulator."""

    files: list[str] = Field(
        ["1.log"], min_length=1, description="Logs, or glob patterns, named after their number in pairs.csv."
    )
    window_taps: int | None = Field(
        100,
        gt=BEFORE_TAPS,
        description="Taps kept of each accumulator, from just before the reported first path on; null: all 1016, in "
        "which the direct path stands near tap 745 and no method that searches the first taps can find it.",
    )
    messages: bool = Field(
        False, description="The distances that the log reports, as messages of an anchor: the tag, by its number."
    )


class Dw1000Apartment(Dataset[Dw1000ApartmentParams]):
    """DW1000 accumulators between an anchor and a tag in a furnished flat: not a radar, no obstacles, no truth.

    The anchor keeps the log: it receives, the tag sends. The capture's robot is the anchor at its place in the flat,
    facing +x, and the transmitter stands where the tag does, so that the baseline is their distance. Heights are not
    published and taken as equal. Each accumulator is cropped around its own first path, as the chip reports it.

    With ``messages`` a capture has what a mapper hears of an anchor: there it is the tag that stands still at a known
    place, and the distance of each exchange is a message without direction. The 126 of ``1.log``, in line of sight, are
    18.1 cm too long on average, and scatter by 2.6 cm.
    """

    card: ClassVar[Card] = Card(
        title="UWB channel impulse responses registered in a furnished apartment",
        license="CC-BY-4.0",
        citation="M. Kolakowski, UWB Channel Impulse Responses Registered in a Furnished Apartment, Zenodo, 2021, "
        "doi 10.5281/zenodo.4742391",
        source="https://github.com/marckolak/uwb-cirs-2018 at 371b893",
        folder="dw1000-apartment",
        files=tuple(
            DatasetFile(
                name,
                sha256,
                "https://raw.githubusercontent.com/marckolak/uwb-cirs-2018/"
                f"dc25a74b0a97418d7a7c4392cb45635f0340e875/results/{name}",
            )
            for name, sha256 in (
                ("1.log", "c007b450cafacc02f8f15e7bf1b1e50fa556d00874a028a036e32a8f24f051ac"),
                ("anchors.csv", "26bd54c3cfc334fdcacade51a233cfeac107669f48b8b1b2bd83f138e829f778"),
                ("labels.csv", "3a5fb3af907fdce5fa93890486158a5ea4377569c559fb8eb27d7d015b2b658b"),
                ("pairs.csv", "207e78d8451d8e0249ca9a4a842ca16d6eb2a0a9dfc6d12aeaa6588bff5485f6"),
                ("tags.csv", "230bfb1dd7486271923b411c0d5f93e9ba279a63a36b5f1361c47983577ad7c0"),
            )
        ),
    )

    @cached_property
    def _logs(self) -> dict[str, str]:
        return list_recordings(self, self.params.files)

    def names(self) -> list[str]:
        """One capture a log, named after its file.

        Raises
        ------
        CaptureError
            If a glob pattern matches nothing.
        """
        return list(self._logs)

    def open(self, name: str) -> Capture:
        """Read one log and the places of its anchor and tag.

        Raises
        ------
        CaptureError
            If a file is missing or broken, or the log is not in the tables; names the file and the line.
        """
        if name not in self._logs:
            raise CaptureError(f"no log '{name}'.{nearest(name, self._logs)}")
        path = self.file(self._logs[name])
        log = read_log(path)
        if self.params.window_taps is not None:
            log = around_first_path(log, self.params.window_taps)
        number = PurePosixPath(name).name
        anchor, tag = self._row("pairs.csv", ("file_number", "anchor_location", "tag_location"), number)
        (label,) = self._row("labels.csv", ("file_id", "label"), number)
        anchor_m, tag_m = self._place("anchors.csv", anchor), self._place("tags.csv", tag)
        center_hz, bandwidth_hz = CHANNELS[log.channel]
        frames, taps = log.samples.shape
        radar = Radar(
            model="Decawave DW1000",
            center_frequency_hz=center_hz,
            bandwidth_hz=bandwidth_hz,
            sample_interval_s=1 / (2 * CHIP_HZ),
            frame_rate_hz=mean_frame_rate_hz(log.timestamp_s, path),
            taps=taps,
            channel=log.channel,
            receiver="anchor",
            tx_position_m=(tag_m[0] - anchor_m[0], tag_m[1] - anchor_m[1], 0.0),
            noise_taps=0 if self.params.window_taps is None else NOISE_TAPS,
            has_first_path=True,
        )
        return Capture(
            name=name,
            radar=radar,
            trajectory=Trajectory(log.timestamp_s, np.tile([*anchor_m, 0.0], (frames, 1)), np.zeros(frames)),
            license=self.card.license,
            citation=self.card.citation,
            description=f"{label}: anchor at place {anchor}, tag at place {tag}. Not a radar, no obstacles.",
            preamble=log.samples,
            first_path_index=log.first_path_index,
            receivers=(radar.receiver,),
            anchors=self._heard(log, tag, tag_m) if self.params.messages else None,
        )

    def _heard(self, log: Log, tag: str, tag_m: tuple[float, float]) -> Anchors:
        """The tag as an anchor, with the distances that the log reports."""
        if not tag.isdecimal():
            raise CaptureError(f"{self.file('pairs.csv')}: a message needs the number of a tag, not '{tag}'")
        count = len(log.distance_m)
        identity = np.full(count, int(tag))
        said = Messages(identity, np.full(count, np.nan), log.distance_m, np.zeros(count, np.bool_))
        return Anchors(np.array([int(tag)]), np.array([tag_m]), log.distance_frame, said)

    def _row(self, table: str, columns: tuple[str, ...], key: str) -> tuple[str, ...]:
        path = self.file(table)
        rows = read_table(path, columns)
        if key not in rows:
            raise CaptureError(f"{path}: no row with {columns[0]} '{key}'")
        return rows[key]

    def _place(self, table: str, location: str) -> tuple[float, float]:
        x, y = self._row(table, ("location", "x", "y"), location)
        try:
            return float(x), float(y)
        except ValueError as error:
            raise CaptureError(f"{self.file(table)}: location '{location}': {error}") from error
