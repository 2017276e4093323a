"""PulsON 440 scans of a radar on a rail, with its OptiTrack motion.

A scan file is a 32-byte configuration, then packets of 1452 bytes, all big-endian; a scan spans several packets.
"""

from __future__ import annotations

from dataclasses import dataclass
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
    DatasetFolder,
    FloatArray,
    Obstacle,
    Params,
    Radar,
    Trajectory,
    Truth,
    nearest,
)
from uwbbench_datasets.measured.onset import REST_S, moved_by_poses_m, moved_by_scans_m, onset_s, span_s
from uwbbench_datasets.measured.optitrack import Motion, read_motion, z_up
from uwbbench_datasets.measured.recordings import content, mean_frame_rate_hz

BIN_S = 1e-9 / (512 * 1.024)
"""Time unit of the receiver: scans are sampled at a whole number of these, here 32, which is 61.035 ps."""
CENTER_FREQUENCY_HZ, BANDWIDTH_HZ = 3.95e9, 1.7e9
"""Middle and width of the device's band, 3.1 to 4.8 GHz."""

_CONFIGURATION = np.dtype(
    [("node", ">u4"), ("start_ps", ">i4"), ("stop_ps", ">i4"), ("step", ">u2"), ("pii", ">u2"), ("rest", "V16")]
)
_SAMPLES = 350
_PACKET = np.dtype(
    [
        ("type", ">u2"),
        ("id", ">u2"),
        ("source", ">u4"),
        ("timestamp_ms", ">u4"),
        ("reserved", "V16"),
        ("start_ps", ">i4"),
        ("stop_ps", ">i4"),
        ("step", ">i2"),
        ("kind", "V4"),
        ("n_samples", ">u2"),
        ("total_samples", ">u4"),
        ("index", ">u2"),
        ("count", ">u2"),
        ("samples", ">i4", _SAMPLES),
    ]
)
_SCAN_PACKET = 0xF201


@dataclass(frozen=True)
class Scans:
    """What a scan file holds.

    Attributes
    ----------
    samples : (scans, bins) float32 array
        Real RF.
    timestamp_s : (scans,) array
        From the first scan, by the radar's millisecond clock.
    clock_s : float
        That clock at the first scan; it runs on from recording to recording until the radar is switched off.
    start_s, sample_interval_s : float
        Delay of bin 0 as the device counts it, and spacing of the bins.
    """

    samples: NDArray[np.float32]
    timestamp_s: FloatArray
    clock_s: float
    start_s: float
    sample_interval_s: float


def read_scans(path: Path) -> Scans:
    """All complete scans of a file.

    A last scan whose packets were not all written when the recording was stopped is left out; nothing else is
    forgiven.

    Raises
    ------
    CaptureError
        If a packet is cut short, of another type, out of order or missing, or if the settings change on the way;
        names the file and the byte at which that packet starts.
    """
    data = content(path)
    whole, rest = divmod(len(data) - _CONFIGURATION.itemsize, _PACKET.itemsize)
    if rest:
        where = max(_CONFIGURATION.itemsize + whole * _PACKET.itemsize, 0)
        raise CaptureError(f"{path}: byte {where}: the file ends inside a packet or its configuration")
    packets = np.frombuffer(data, _PACKET, whole, _CONFIGURATION.itemsize)
    _expect(path, packets["type"] == _SCAN_PACKET, f"a scan packet starts with 0x{_SCAN_PACKET:04X}")
    count = int(packets["count"][0]) if whole else 0
    if count < 1 or whole < count:
        raise CaptureError(f"{path}: byte {_CONFIGURATION.itemsize}: no complete scan")
    for name in ("source", "start_ps", "stop_ps", "step", "total_samples", "count"):
        _expect(path, packets[name] == packets[name][0], f"{name} changes during the recording")
    scan, index = np.divmod(np.arange(whole), count)
    _expect(
        path, packets["index"] == index, f"packets of a scan are numbered 0 to {count - 1}: one is missing or twice"
    )
    _expect(path, packets["id"] == (packets["id"][0] + scan) % 65536, "scans are numbered one by one: one is missing")
    sizes = packets["n_samples"][:count].astype(int)
    _expect(path, packets["n_samples"] == sizes[index], "n_samples changes from scan to scan")
    step, bins = int(packets["step"][0]), int(packets["total_samples"][0])
    if step < 1 or sizes.max() > _SAMPLES or sizes.sum() != bins or bins < 1:
        raise CaptureError(
            f"{path}: byte {_CONFIGURATION.itemsize}: {bins} samples in packets of {sizes.tolist()}, step {step}: "
            f"packets of at most {_SAMPLES} samples must add up to the scan, and the step must be positive"
        )
    configuration = np.frombuffer(data, _CONFIGURATION, 1)[0]
    if configuration["start_ps"] != packets["start_ps"][0]:
        raise CaptureError(f"{path}: byte 4: scan start differs from that of the packets")
    complete = whole // count
    milliseconds = packets["timestamp_ms"][: complete * count : count].astype(np.int64)
    _expect(path, np.repeat(np.diff(milliseconds, prepend=milliseconds[:1]) >= 0, count), "time runs backwards")
    held = (np.arange(_SAMPLES) < sizes[:, None]).ravel()
    samples = packets["samples"][: complete * count].reshape(complete, count * _SAMPLES)[:, held]
    return Scans(
        samples=samples.astype(np.float32),
        timestamp_s=(milliseconds - milliseconds[0]) / 1000,
        clock_s=int(milliseconds[0]) / 1000,
        start_s=int(configuration["start_ps"]) * 1e-12,
        sample_interval_s=step * BIN_S,
    )


def _expect(path: Path, fits: BoolArray, rule: str) -> None:
    """Raise at the first packet that breaks a rule."""
    if not np.all(fits):
        byte = _CONFIGURATION.itemsize + int(np.argmin(fits)) * _PACKET.itemsize
        raise CaptureError(f"{path}: byte {byte}: {rule}")


OWN_SCAN = "scan_2105627.txt"
"""Trial 6, on whose reflectors the range bias was fitted."""
DEVICE_OFFSET_S = 10e-9
"""Delay in the device and to its antennas that the start of a scan includes."""


class Pulson440RailParams(Params):
    """Which recording, and the two constants that tie radar, motion and reflectors together."""

    scan: str = Field(OWN_SCAN, description="Scan file of the radar (binary, whatever its suffix says).")
    motion: str = Field("group6_trial_008.csv", description="OptiTrack export of the same run.")
    body: str = Field("radar_group6", description="Rigid body of the radar in the export.")
    frames: Literal["all", "moving"] = Field("all", description="moving: from the onset of motion to its end.")
    reflectors: Literal["both", "left", "right"] = Field("both", description="Which of the two are labelled.")
    range_bias_m: float | None = Field(
        None,
        description="Subtracted from the device's range. null: what the other reflector gives where one is labelled, "
        "0.43 m, fitted on both, where both are.",
    )
    time_offset_s: float | None = Field(
        None, description="Added to radar time to get motion time; null: from the onset of motion in both."
    )


class Pulson440Rail(Dataset[Pulson440RailParams]):
    """Real PulsON 440 moving on a rail in a cluttered room, two labelled corner reflectors.

    **Range.** The device counts a range of ``c (scan_start - 10 ns) / 2`` at bin 0. ``first_tap_delay_s`` is chosen so
    that ``c delay / 2`` is that range minus ``range_bias_m``. The bias is known from the reflectors alone: the device's
    own count, which fits the walk and the tree, is off by 0.4 m on this rail. Where one reflector is labelled, the bias
    is what the *other* one gives, and range errors mean something; where both are, spread and detection do, and
    absolute range does not. For other trials of the same day it is a bias from another recording.

    **Time.** Radar and motion capture have no common clock. Both see the onset of motion
    (:mod:`uwbbench_datasets.measured.onset`), to about 0.03 s, which is 1 cm of range. No reflector is looked at.

    **Poses.** Position and heading of the rigid body, interpolated to the radar's own timestamps (17.3 ms apart); NaN
    where the body was not tracked. Coordinates are OptiTrack's as (X, -Z, Y), z up, reflectors included. The body's
    x axis (yaw 0) points from the rail to the reflectors, which stand about 7 m away on that side.

    **Band.** The device is specified from 3.1 to 4.8 GHz, and so is the radar's header. In this recording the mean
    spectrum, smoothed over 100 MHz, is above -10 dB from 3.07 to 4.59 GHz.

    **Truth** is not exhaustive: the room is full of unlabelled objects, so precision has no meaning here.

    **Other trials** of the same day come with ``uwbbench fetch pulson440-rail --more trial_3``; ``scan`` and ``motion``
    then name their files, such as ``trial_3/group6_trial_005.csv``. That the reflectors stand where they do in trial 6
    is taken for granted there.
    """

    card: ClassVar[Card] = Card(
        title="PulsON 440 on a rail before two corner reflectors",
        license="MIT",
        citation="Beaver Works Summer Institute, Unmanned Aerial System Synthetic Aperture Radar, 2019, trial 6.",
        source="https://github.com/jjimmykang/bwsi-backprojection at 440e21f, rail_sar_test/trial_6 (RailSAR_07242019)",
        folder="pulson440-rail",
        files=(
            DatasetFile(
                "scan_2105627.txt",
                "3a5c9a51724547786c011f914183faf28ba81af9cf605ac20c0ea0d372a9eb98",
                "https://raw.githubusercontent.com/jjimmykang/bwsi-backprojection/"
                "d5c65fa75cb9fa158b1e2e1dd8189d1e19e0e99d/jimmy_backproj/pulson440/rail_sar_test/trial_6/"
                "scan_2105627.txt",
            ),
            DatasetFile(
                "group6_trial_008.csv",
                "cbea12035c966c431b395088424a8c849d5045e7a89cfaac818d4697b003b342",
                "https://raw.githubusercontent.com/jjimmykang/bwsi-backprojection/"
                "0afa22507560f34e3a93267f0c777a274d428f75/jimmy_backproj/pulson440/RailSAR_07242019/"
                "group6_trial_008.csv",
            ),
        ),
        more=tuple(
            DatasetFolder(
                f"trial_{number}",
                "https://api.github.com/repos/jjimmykang/bwsi-backprojection/contents/backprojection/pulson440/"
                f"rail_sar_test/trial_{number}?ref=8f4d772225b1f377e1cac6962ce80fbd6db0c5f6",
                (".txt", ".csv"),
            )
            for number in (1, 3, 4, 5, 7)
        ),
    )
    bias_of_m: ClassVar[dict[str, float]] = {"both": 0.43, "left": 0.40, "right": 0.46}
    """Range bias by the labelled reflectors: for the left one fitted on the right one, and the other way round."""
    reflectors_y_up_m: ClassVar[dict[str, tuple[float, float, float]]] = {
        "left": (2.203936, 0.037515, -3.873749),
        "right": (2.328990, 0.039530, 1.037974),
    }

    def names(self) -> list[str]:
        """The one run, named after its scan file."""
        return [Path(self.params.scan).stem]

    def open(self, name: str) -> Capture:
        """Read scans and motion.

        Raises
        ------
        CaptureError
            If a file is missing or broken; names the file and the place in it.
        """
        if name not in self.names():
            raise CaptureError(f"no capture named '{name}'.{nearest(name, self.names())}")
        p = self.params
        path, motion_path = self.file(p.scan), self.file(p.motion)
        scans, motion = read_scans(path), read_motion(motion_path, p.body)
        offset_s, time_note = self._time_offset(path, scans, motion_path, motion)
        bias_m, range_note = self._range_bias()
        time_s = scans.timestamp_s
        position_m, yaw_rad = motion.at(time_s + offset_s)
        kept = np.ones(len(time_s), bool)
        if p.frames == "moving":
            first, last = span_s(motion.time_s, motion.position_m)
            kept = (time_s + offset_s >= first) & (time_s + offset_s <= last)
            if not kept.any():
                raise CaptureError(
                    f"{path}: no scan while '{p.body}' moves, from {first:.2f} to {last:.2f} s of {motion_path}"
                )
        radar = Radar(
            model="TimeDomain PulsON 440",
            center_frequency_hz=CENTER_FREQUENCY_HZ,
            bandwidth_hz=BANDWIDTH_HZ,
            sample_interval_s=scans.sample_interval_s,
            frame_rate_hz=mean_frame_rate_hz(time_s, path),
            taps=scans.samples.shape[1],
            samples="rf",
            first_tap_delay_s=scans.start_s - DEVICE_OFFSET_S - 2 * bias_m / SPEED_OF_LIGHT_M_S,
        )
        reflectors = (
            Obstacle(f"{side} reflector", "corner reflector", z_up(np.array([place_m])))
            for side, place_m in self.reflectors_y_up_m.items()
            if p.reflectors in ("both", side)
        )
        return Capture(
            name=name,
            radar=radar,
            trajectory=Trajectory(time_s[kept], position_m[kept], yaw_rad[kept]),
            truth=Truth(tuple(reflectors), exhaustive=False),
            license=self.card.license,
            citation=self.card.citation,
            description=f"PulsON 440 on a rail; {range_note}; {time_note}.",
            preamble=scans.samples[kept],
            receivers=(radar.receiver,),
        )

    def _range_bias(self) -> tuple[float, str]:
        """Range bias, and what it was fitted on."""
        given_m, labelled = self.params.range_bias_m, self.params.reflectors
        if given_m is not None:
            return given_m, f"range bias {given_m:g} m as given"
        bias_m, own = self.bias_of_m[labelled], self.params.scan == OWN_SCAN
        on = {"both": "both reflectors", "left": "the right reflector", "right": "the left reflector"}[labelled]
        if not own:
            return bias_m, f"range bias {bias_m:g} m, fitted on {on} of trial 6, another recording"
        scored = "FITTED ON THE SCORED OBJECTS" if labelled == "both" else "which is not labelled here"
        return bias_m, f"range bias {bias_m:g} m fitted on {on}, {scored}"

    def _time_offset(self, path: Path, scans: Scans, motion_path: Path, motion: Motion) -> tuple[float, str]:
        """What to add to radar time to get motion time, and where it comes from."""
        given_s = self.params.time_offset_s
        if given_s is not None:
            return given_s, f"time offset {given_s:g} s as given"
        wavelength_m = SPEED_OF_LIGHT_M_S / CENTER_FREQUENCY_HZ
        seen_s = onset_s(scans.timestamp_s, moved_by_scans_m(scans.timestamp_s, scans.samples, wavelength_m))
        tracked_s = onset_s(motion.time_s, moved_by_poses_m(motion.time_s, motion.position_m))
        if seen_s is None or tracked_s is None:
            raise CaptureError(
                f"{path if seen_s is None else motion_path}: shows no onset of motion after {REST_S:g} s at rest, to "
                "tie the clocks of radar and motion together; give 'time_offset_s'"
            )
        return tracked_s - seen_s, f"time offset {tracked_s - seen_s:.2f} s from the onset of motion"
