"""Novelda XeThru X4 recordings: I/Q baseband, little-endian, in the two layouts of the vendor's recorder.

``baseband_iq`` carries its range axis in every frame; ``datafloat`` carries none.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    BoolArray,
    Capture,
    CaptureError,
    Card,
    Dataset,
    DatasetFile,
    Params,
    Radar,
    Trajectory,
    nearest,
)
from uwbbench_datasets.measured.recordings import content, list_recordings

Layout = Literal["baseband_iq", "datafloat"]
_HEADS: dict[Layout, np.dtype[np.void]] = {
    "baseband_iq": np.dtype(
        [
            ("counter", "<u4"),
            ("length", "<u4"),
            ("bin_length_m", "<f4"),
            ("sample_rate_hz", "<f4"),
            ("carrier_hz", "<f4"),
            ("range_offset_m", "<f4"),
        ]
    ),
    "datafloat": np.dtype([("id", "<u4"), ("counter", "<u4"), ("length", "<u4")]),
}


@dataclass(frozen=True)
class Axis:
    """Where the bins lie: rate of the samples, carrier, and range of the first bin."""

    sample_rate_hz: float
    carrier_hz: float
    range_offset_m: float


@dataclass(frozen=True)
class Recording:
    """Frames of a recording.

    Attributes
    ----------
    samples : (frames, bins) complex64 array
    counter : (frames,) array
        Frame numbers of the device, increasing.
    axis : Axis or None
        As the file says, None where it does not.
    """

    samples: NDArray[np.complex64]
    counter: NDArray[np.int64]
    axis: Axis | None = None


def read_recording(path: Path, layout: Layout) -> Recording:
    """All frames of a recording.

    Raises
    ------
    CaptureError
        If the file ends inside a frame, or a frame's head contradicts the first one's; names the file and the byte at
        which that frame starts.
    """
    data, head = content(path), _HEADS[layout]
    if len(data) < head.itemsize:
        raise CaptureError(f"{path}: byte 0: {len(data)} bytes are too few for one frame")
    length = int(np.frombuffer(data, head, 1)["length"][0])
    floats = 2 * length if layout == "baseband_iq" else length
    size = head.itemsize + 4 * floats
    if floats < 2 or floats % 2 or size > len(data):
        raise CaptureError(f"{path}: byte 0: a {layout} frame cannot hold {floats} values in {len(data)} bytes")
    whole, rest = divmod(len(data), size)
    frames = np.frombuffer(data, np.dtype([("head", head), ("values", "<f4", floats)]), whole)
    heads, values = frames["head"], frames["values"]
    counter = heads["counter"].astype(np.int64)
    fixed = [name for name in head.names or () if name != "counter"]
    for name in fixed:
        _expect(path, size, heads[name] == heads[name][0], f"'{name}' differs from the first frame's")
    _expect(path, size, np.diff(counter, prepend=-1) > 0, "the frame counter does not increase")
    if rest:
        raise CaptureError(f"{path}: byte {whole * size}: the file ends inside a frame")
    samples = np.empty((whole, floats // 2), np.complex64)
    samples.real, samples.imag = values[:, : floats // 2], values[:, floats // 2 :]
    if layout == "datafloat":
        return Recording(samples, counter)
    _, _, bin_length_m, rate_hz, carrier_hz, offset_m = (float(value) for value in heads[0])
    axis = np.array([bin_length_m, rate_hz, carrier_hz, offset_m])
    # The device divides a rounded speed of light, so its bin is only nearly c / (2 fs).
    if not (np.all(np.isfinite(axis)) and min(axis[1:3]) > 0):
        raise CaptureError(f"{path}: byte 8: bin length, sample rate, carrier and range offset {axis.tolist()}")
    if abs(bin_length_m * 2 * rate_hz / SPEED_OF_LIGHT_M_S - 1) > 0.01:
        raise CaptureError(f"{path}: byte 8: a bin of {bin_length_m:g} m does not fit {rate_hz:g} samples a second")
    return Recording(samples, counter, Axis(rate_hz, carrier_hz, offset_m))


def _expect(path: Path, size: int, fits: BoolArray, rule: str) -> None:
    """Raise at the first frame that breaks a rule."""
    if not np.all(fits):
        raise CaptureError(f"{path}: byte {int(np.argmin(fits)) * size}: {rule}")


class XethruX4Params(Params):
    """Which recordings, and what their files do not say."""

    files: list[str] = Field(
        ["xethru_baseband_iq_20170913_150437.dat", "xethru_datafloat_20250109_180251.dat"],
        min_length=1,
        description="Paths or glob patterns below the dataset's folder.",
    )
    layout: Literal["by_name", "baseband_iq", "datafloat"] = Field(
        "by_name", description="by_name: as the recorder's file name says."
    )
    frame_rate_hz: float = Field(17.0, gt=0, description="Nominal rate: the files count frames, they give no times.")
    sample_rate_hz: float = Field(
        2.916e9, gt=0, description="datafloat only. The X4's 23.328 GHz decimated by 8, as baseband_iq files state it."
    )
    carrier_hz: float = Field(7.29e9, gt=0, description="datafloat only.")
    range_offset_m: float = Field(
        0.4, description="datafloat only: range of the first bin, by default the start that the recording asked for."
    )


class XethruX4(Dataset[XethruX4Params]):
    """Novelda XeThru X4M03, I/Q baseband, a person before the radar; no ground truth.

    **Range axis.** A ``baseband_iq`` frame states sample rate (2.916 GHz), carrier (7.29 GHz) and the range of its
    first bin. A ``datafloat`` frame states none, so they are parameters. Their defaults: the sample rate, and with it
    the bin of 5.14 cm, is that of the other recording. It fits: the script beside the recording asks for 0.4 to 5.0 m,
    which are 89.4 such bins, and the frames have 91. The chip chooses its own start near the one asked for, so ranges
    may be off by a bin or two.

    **Time** is the frame counter over ``frame_rate_hz``. Times in the recorder's meta files are arrivals at the host,
    which jitter by 10 ms; over the whole recordings they give 17.11 and 17.07 frames a second.

    **Bandwidth** is the chip's nominal 1.4 GHz.
    """

    card: ClassVar[Card] = Card(
        title="XeThru X4M03 baseband recordings",
        license="MIT",
        citation="Computing-EECMS, UWB Radar Head Pose Estimation, 2024.",
        source="https://github.com/marcusm111/EECMS-Internship-UWB-Radar-Head-Pose-Estimation at a66ad9d",
        folder="xethru-x4",
        files=(
            DatasetFile(
                "xethru_datafloat_20250109_180251.dat",
                "8ad95ef550530d7908884ab0be1bd83e0fd2f56d4c3c790ddff32b11b321f361",
                "https://raw.githubusercontent.com/marcusm111/EECMS-Internship-UWB-Radar-Head-Pose-Estimation/"
                "1e678696f3efc9082e468771e9992e8f489c624f/x4m03%20matlab%20scripts/matlab/examples/"
                "xethru_recording_20250109_180251_test_recording/xethru_datafloat_20250109_180251.dat",
            ),
            DatasetFile(
                "xethru_baseband_iq_20170913_150437.dat",
                "b2314301a68a26b3c5ea64e127fb784c5d676ba5dccd5748a5884360abbdc993",
                "",
            ),
        ),
    )
    bandwidth_hz: ClassVar[float] = 1.4e9

    @cached_property
    def _recordings(self) -> dict[str, str]:
        return list_recordings(self, self.params.files)

    def names(self) -> list[str]:
        """One capture a recording, named after its file.

        Raises
        ------
        CaptureError
            If a glob pattern matches nothing.
        """
        return list(self._recordings)

    def open(self, name: str) -> Capture:
        """Read one recording.

        Raises
        ------
        CaptureError
            If its file is missing or broken; names the file and the byte.
        """
        if name not in self._recordings:
            raise CaptureError(f"no recording '{name}'.{nearest(name, self._recordings)}")
        path = self.file(self._recordings[name])
        layout = self._layout(path)
        recording = read_recording(path, layout)
        p = self.params
        axis = recording.axis or Axis(p.sample_rate_hz, p.carrier_hz, p.range_offset_m)
        frames, bins = recording.samples.shape
        radar = Radar(
            model="Novelda XeThru X4M03",
            center_frequency_hz=axis.carrier_hz,
            bandwidth_hz=self.bandwidth_hz,
            sample_interval_s=1 / axis.sample_rate_hz,
            frame_rate_hz=p.frame_rate_hz,
            taps=bins,
            first_tap_delay_s=2 * axis.range_offset_m / SPEED_OF_LIGHT_M_S,
        )
        timestamp_s = (recording.counter - recording.counter[0]) / p.frame_rate_hz
        return Capture(
            name=name,
            radar=radar,
            trajectory=Trajectory(timestamp_s, np.zeros((frames, 3)), np.zeros(frames)),
            license=self.card.license,
            citation=self.card.citation,
            description=f"XeThru X4 {layout}; a person, no ground truth"
            + ("." if recording.axis else f"; range axis assumed to start at {axis.range_offset_m:g} m."),
            preamble=recording.samples,
            receivers=(radar.receiver,),
        )

    def _layout(self, path: Path) -> Layout:
        if self.params.layout != "by_name":
            return self.params.layout
        for layout in _HEADS:
            if layout in path.name:
                return layout
        raise CaptureError(f"{path}: its name holds neither 'baseband_iq' nor 'datafloat': give the parameter 'layout'")
