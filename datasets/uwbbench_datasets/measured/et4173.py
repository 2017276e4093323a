"""PulsON 4xx nodes of the ET4173 recordings (MATLAB files): a person walks a known path."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from uwbbench.api import (
    SPEED_OF_LIGHT_M_S,
    Capture,
    CaptureError,
    Card,
    Dataset,
    DatasetFile,
    FloatArray,
    Obstacle,
    Params,
    Radar,
    Trajectory,
    Truth,
    in_child,
    nearest,
)
from uwbbench_datasets.measured.pulson440 import BANDWIDTH_HZ, BIN_S, CENTER_FREQUENCY_HZ, DEVICE_OFFSET_S
from uwbbench_datasets.measured.recordings import mean_frame_rate_hz

_FIELDS = ("scn", "Tstmp", "Nbin", "Tstrt")
_RAW = (
    "https://raw.githubusercontent.com/Hong-01/"
    "ET4173-Clutter-Suppression-for-Positioning-with-Multiple-UWB-Radars/"
    "772af1571c026c9f2cec3a79e0d4988d169d9c22/UWB%20Data/"
)


def read_scans(path: Path) -> tuple[FloatArray, FloatArray, float, float]:
    """Scans of one node.

    Returns
    -------
    samples : (frames, bins) array
        Real RF.
    timestamp_s : (frames,) array
        From the first scan.
    sample_interval_s : float
    start_s : float
        Delay of bin 0 as the device counts it.

    Raises
    ------
    CaptureError
        If the file is no MATLAB file, or its ``scn`` is not an array of scans of one length and step.
    """
    import scipy.io  # here, so that not each child has to  # noqa: F401

    return in_child(path, lambda: _read_scans(path))


def _read_scans(path: Path) -> tuple[FloatArray, FloatArray, float, float]:
    from scipy.io import loadmat

    try:
        variables: dict[str, Any] = loadmat(path, squeeze_me=True, struct_as_record=False, variable_names=["scn"])
    except Exception as error:  # scipy's errors for broken files share no base class
        raise CaptureError(f"{path}: not a MATLAB file that can be read: {error}") from error
    if "scn" not in variables:
        raise CaptureError(f"{path}: holds no variable 'scn'")
    scans = np.atleast_1d(variables["scn"]).ravel()
    for number, scan in enumerate(scans):
        missing = [name for name in _FIELDS if not hasattr(scan, name)]
        if missing:
            raise CaptureError(f"{path}: scn({number + 1}) has no field {', '.join(missing)}")
    columns = {name: [np.asarray(getattr(scan, name)) for scan in scans] for name in _FIELDS}
    for name, values in columns.items():
        dimensions = 1 if name == "scn" else 0
        wrong = [
            number
            for number, value in enumerate(values)
            if value.dtype.kind not in "iuf" or value.ndim != dimensions or value.shape != values[0].shape
        ]
        if wrong:
            expected = "one row of numbers, as long as the first" if dimensions else "one number"
            raise CaptureError(f"{path}: scn({wrong[0] + 1}).{name} must be {expected}")
    samples, milliseconds, steps, starts_ps = (np.array(columns[name], float) for name in _FIELDS)
    if samples.size == 0:
        raise CaptureError(f"{path}: 'scn' is empty")
    if not np.all(steps == steps[0]) or not steps[0] >= 1:
        raise CaptureError(f"{path}: Nbin, the step from bin to bin, must be positive and the same in every scan")
    if not np.all(starts_ps == starts_ps[0]):
        raise CaptureError(f"{path}: Tstrt, the delay of bin 0, must be the same in every scan")
    return samples, (milliseconds - milliseconds[0]) / 1000, float(steps[0]) * BIN_S, float(starts_ps[0]) * 1e-12


class Et4173WalkParams(Params):
    """Where ranges count from."""

    range_offset_m: float | None = Field(
        None, description="Range of bin 0; null: by the device's own count, which puts it at 1.124 m."
    )


class Et4173Walk(Dataset[Et4173WalkParams]):
    """Two of four fixed PulsON nodes; one person walks (1, -1), (1, 1), (-1, 1), (1, -1) m.

    **Range.** Bin 0 is where the device counts it, ``c (Tstrt - 10 ns) / 2``, 1.124 m, with the same 10 ns as the
    other PulsON recordings. A fit that puts the *leading edge* of the person on the path gives 1.112 m; it is not used.

    **Truth** is the path, straight between four corners. When the person passes them is nowhere noted: the frames are
    **fitted on the echo of the person**, who is scored. A moving point at the person's leading edge, NaN before the
    first corner and after the last. The person is 0.37 m wide: score with a gate of 0.20 m or wider.
    The truth is not exhaustive, and two-dimensional, as heights are unknown.

    **Poses.** Node 101 stands at (-2, 2) m, node 102 at (2, 2) m. The axes of the published path do not show where the
    antennas look: each node's boresight is taken to be the path's centre, (0, 0).

    **Band.** The device is specified from 3.1 to 4.8 GHz. The mean spectrum of the moving part, smoothed over 100 MHz,
    is above -10 dB from 3.17 to 4.78 GHz (101) and from 3.14 to 4.71 GHz (102).
    """

    card: ClassVar[Card] = Card(
        title="ET4173: one person walking before PulsON nodes",
        license="MIT",
        citation="Y. Hong, Clutter Suppression for Positioning with Multiple UWB Radars (ET4173), 2024.",
        source="https://github.com/Hong-01/ET4173-Clutter-Suppression-for-Positioning-with-Multiple-UWB-Radars"
        " at 772af15",
        folder="et4173-walk",
        files=(
            DatasetFile(
                "101_P1.mat", "3182fad45d393fa3fc4abf81e60f4280e2b8a518fca1557a94b24821dadfeab3", _RAW + "101_P1.mat"
            ),
            DatasetFile(
                "102_P1.mat", "8ec95581738147c457a69033cb380cce0a6014a7a1cb99f8f7fcdd364e5bd8fe", _RAW + "102_P1.mat"
            ),
        ),
    )
    nodes_m: ClassVar[dict[str, tuple[float, float]]] = {"101": (-2.0, 2.0), "102": (2.0, 2.0)}
    corner_frames: ClassVar[tuple[float, ...]] = (53.8, 248.0, 437.2, 762.1)
    corners_m: ClassVar[tuple[tuple[float, float], ...]] = ((1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0))

    def names(self) -> list[str]:
        """The nodes."""
        return list(self.nodes_m)

    def open(self, name: str) -> Capture:
        """Read one node.

        Raises
        ------
        CaptureError
            If its file is missing or broken; names the file and the place in it.
        """
        if name not in self.nodes_m:
            raise CaptureError(f"no node '{name}'.{nearest(name, self.nodes_m)}")
        path = self.file(f"{name}_P1.mat")
        samples, timestamp_s, sample_interval_s, start_s = read_scans(path)
        offset_m = self.params.range_offset_m
        frames = len(samples)
        x_m, y_m = self.nodes_m[name]
        radar = Radar(
            model="TimeDomain PulsON 4xx",
            center_frequency_hz=CENTER_FREQUENCY_HZ,
            bandwidth_hz=BANDWIDTH_HZ,
            sample_interval_s=sample_interval_s,
            frame_rate_hz=mean_frame_rate_hz(timestamp_s, path),
            taps=samples.shape[1],
            samples="rf",
            receiver=name,
            first_tap_delay_s=start_s - DEVICE_OFFSET_S if offset_m is None else 2 * offset_m / SPEED_OF_LIGHT_M_S,
        )
        person = Obstacle("person", "person", self._path(frames)[:, None, :])
        return Capture(
            name=name,
            radar=radar,
            trajectory=Trajectory(
                timestamp_s, np.tile([x_m, y_m, 0.0], (frames, 1)), np.full(frames, np.arctan2(-y_m, -x_m))
            ),
            truth=Truth((person,), exhaustive=False),
            license=self.card.license,
            citation=self.card.citation,
            description="One person walking along a known path; "
            + ("range by the device's own count" if offset_m is None else f"bin 0 at {offset_m:g} m as given")
            + "; when the person passes the corners is FITTED ON THE SCORED OBJECT.",
            preamble=samples.astype(np.float32),
            recording=self.card.folder,
            receivers=tuple(self.nodes_m),
        )

    def _path(self, frames: int) -> FloatArray:
        """Place (frames, 2) of the person; NaN where it is not known."""
        corners = np.array(self.corners_m).T
        x, y = (np.interp(np.arange(frames), self.corner_frames, each, np.nan, np.nan) for each in corners)
        return np.column_stack([x, y])
