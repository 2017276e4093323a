"""PulsON 440 scans of a radar that was carried past a tree, from stop to stop."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import ClassVar, Literal

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
    nearest,
)
from uwbbench_datasets.measured.pulson440 import (
    BANDWIDTH_HZ,
    CENTER_FREQUENCY_HZ,
    DEVICE_OFFSET_S,
    Scans,
    read_scans,
)
from uwbbench_datasets.measured.recordings import mean_frame_rate_hz

FOOT_M = 0.3048


class Pulson440TreeParams(Params):
    """What makes a frame."""

    frames: Literal["stops", "scans"] = Field(
        "stops", description="stops: the mean of the 200 scans of each of the 23 stops; scans: all 4600."
    )
    range_bias_m: float = Field(
        0.0, description="Subtracted from the device's range, which fits the taped distance to 6 cm as it is."
    )


class Pulson440Tree(Dataset[Pulson440TreeParams]):
    """Real PulsON 440 carried past one tree outdoors, in 23 stops a foot apart.

    **Order.** The stops follow the radar's own clock, which runs through all files. The number in a file's name is not
    the place of its stop: by the clock, files 3 to 6 lie among those from 16 on. In that order the echo of the tree is
    one smooth hyperbola, with a median residual of 2 cm, in the order of the names it is torn.

    **Poses.** The middle stop is the origin, the stops run from left (+y) to right, the radar looks along +x. A foot
    from stop to stop as noted; the "24 ft 7 inches side to side" of the same note are 22 feet of these.

    **Range.** The device's own count, ``c (scan_start - 10 ns) / 2`` at bin 0, without a bias from any reflector.

    **Truth** is one point. Its distance from the middle stop, 25 feet, was taped; its side, 0.95 m to the right, is
    **fitted on the tree's own echo**. That echo comes 6 cm behind the taped distance. Not exhaustive, as other objects
    are seen and not labelled, and two-dimensional, as heights are unknown.

    **Time.** Stops are 13 to 130 s apart. The averaged scans of one are a frame of its own; a background that is
    subtracted must be made of other stops.
    """

    card: ClassVar[Card] = Card(
        title="PulsON 440 carried past a tree",
        license="MIT",
        citation="Beaver Works Summer Institute, Unmanned Aerial System Synthetic Aperture Radar, 2019, first test.",
        source="https://github.com/jjimmykang/bwsi-backprojection at 440e21f, first_sar_test/trial_1",
        folder="pulson440-tree",
        files=tuple(
            DatasetFile(
                name,
                sha256,
                "https://raw.githubusercontent.com/jjimmykang/bwsi-backprojection/"
                f"8f4d772225b1f377e1cac6962ce80fbd6db0c5f6/backprojection/pulson440/first_sar_test/trial_1/{name}",
            )
            for name, sha256 in (
                ("info.txt", "9b33b85878e571b302be79cb542235494e0d30da71c1a3b5eb95dfe9558f830c"),
                ("scan_1.txt", "e0c599a1e92f2ac3fba4d6bdf6fe4daf8f2ff5a48a7eeb0f3f842e5d9f84d401"),
                ("scan_2.txt", "1e37aa4071a3ee70116db7d732d0b4750f44ca365119272593162e96b6b384f6"),
                ("scan_3.txt", "09b9d2e74d8de5cdce2091c8712be8eead05faea3bf0ed935fd1599501e625f7"),
                ("scan_4.txt", "079b2bc4ac73c5a7c716a03e82045e8732ee5665dad2dfb30d306adfb07f0783"),
                ("scan_5.txt", "82bca581bdd008057d5c1f455da7d9a41b5ca3abd63894618d2fdd5d0191d8ed"),
                ("scan_6.txt", "c3c0a2dca30ccab73ecbf3b176b7082172ec0468aa3b83120d53f363b900b4ad"),
                ("scan_7.txt", "318913ce953aaaedb917a939183434c1e6646d4cc12ba5dc494b863ca56fecb7"),
                ("scan_8.txt", "9974731f6b3590e5545f51349549f8423f16e492ea821793beadee26cedc69ac"),
                ("scan_9.txt", "b89f54e549283943f7a46e4eca4d025a3a2a847fb6754b891a11318eb8642a45"),
                ("scan_10.txt", "786f944ee42e09189a7a4d73608012295e9ff3d2b1edf225af23a0d7df0cb447"),
                ("scan_11.txt", "7cafc82adee402ccddcc4b154dcdb42e06f153cc19b1c8c56783429b14ae32a2"),
                ("scan_12.txt", "a36b5383c3008f896e84de438da09dec560ea83b7e3973e976c7e388467b2730"),
                ("scan_13.txt", "13394c03926ee20885fd8ac3d569e437616935ebdabe8d6cf5799e6473f9d627"),
                ("scan_14.txt", "1aac9a578eb0ace72df03ec7df762f86f69737a9c0b675990b69137b2572718a"),
                ("scan_15.txt", "21f22fde476848bf949b1b4af3ffaadd71e7f16ad2c7975ba811c3bf65f06f6f"),
                ("scan_16.txt", "4506b52ceac2c2f9b0f83dd28bdb6d46de49d3e201fc4274f6efab53e53d4875"),
                ("scan_17.txt", "19733fab7255370572dc6c05fce5dc0b4bbde118ecb169cdc79b652ea7f0c51f"),
                ("scan_18.txt", "417af0c0000af4b3291659612b6271e5a2eddf0b98463439247f354269ed5007"),
                ("scan_19.txt", "dd00b92111e958f66a05018b45ef8a82db3625a81d17fb3664c3e58c7aa5b585"),
                ("scan_20.txt", "7843703ef74f4eae732c7b653ab250335a17a9411b2291293c731d909b9598fa"),
                ("scan_21.txt", "f2bdffcbbf5cd6b9e1f10e529acbbfe04c6fcd3431fb41a9ee8aeb09201d4b21"),
                ("scan_22.txt", "d5ac6fd91d9f936196045d3408887a4607022db42533cf9132eb098c657d1965"),
                ("scan_23.txt", "14cb621c55c2f8e69bbff139b11719791b03372aa3a3350ec2a80f80ad7daf27"),
            )
        ),
    )
    stops: ClassVar[int] = 23
    taped_m: ClassVar[float] = 25 * FOOT_M
    right_m: ClassVar[float] = 0.95

    def names(self) -> list[str]:
        """The one pass."""
        return ["trial_1"]

    def open(self, name: str) -> Capture:
        """Read all stops.

        Raises
        ------
        CaptureError
            If a file is missing or broken, has other settings than the first, or was recorded at the time of another;
            names the file.
        """
        if name not in self.names():
            raise CaptureError(f"no capture named '{name}'.{nearest(name, self.names())}")
        paths = [self.file(f"scan_{number}.txt") for number in range(1, self.stops + 1)]
        files = sorted(((read_scans(path), path) for path in paths), key=lambda each: each[0].clock_s)
        _check_alike(files)
        begin_s = files[0][0].clock_s
        parts = [(scans.samples, scans.clock_s - begin_s + scans.timestamp_s) for scans, _ in files]
        if self.params.frames == "stops":
            parts = [(samples.mean(axis=0, dtype=np.float64)[None], time_s.mean()[None]) for samples, time_s in parts]
        time_s = np.concatenate([each for _, each in parts])
        stop = np.repeat(np.arange(self.stops), [len(each) for _, each in parts])
        position_m = np.zeros((len(stop), 3))
        position_m[:, 1] = FOOT_M * ((self.stops - 1) / 2 - stop)
        scans, path = files[0]
        rates_hz = {"stops": mean_frame_rate_hz(time_s, path), "scans": mean_frame_rate_hz(scans.timestamp_s, path)}
        bias_m = self.params.range_bias_m
        radar = Radar(
            model="TimeDomain PulsON 440",
            center_frequency_hz=CENTER_FREQUENCY_HZ,
            bandwidth_hz=BANDWIDTH_HZ,
            sample_interval_s=scans.sample_interval_s,
            frame_rate_hz=rates_hz[self.params.frames],
            taps=scans.samples.shape[1],
            samples="rf",
            first_tap_delay_s=scans.start_s - DEVICE_OFFSET_S - 2 * bias_m / SPEED_OF_LIGHT_M_S,
        )
        return Capture(
            name=name,
            radar=radar,
            trajectory=Trajectory(time_s, position_m, np.zeros(len(stop))),
            truth=Truth((Obstacle("tree", "tree", self._tree_m()),), exhaustive=False),
            license=self.card.license,
            citation=self.card.citation,
            description=f"PulsON 440 carried past a tree, 23 stops; range bias {bias_m:g} m; distance of the tree as "
            "taped, its side FITTED ON THE SCORED OBJECT.",
            preamble=np.concatenate([each for each, _ in parts]).astype(np.float32),
            receivers=(radar.receiver,),
        )

    def _tree_m(self) -> FloatArray:
        """Place (1, 2) of the tree."""
        return np.array([[np.sqrt(self.taped_m**2 - self.right_m**2), -self.right_m]])


def _check_alike(files: list[tuple[Scans, Path]]) -> None:
    """Raise where a file has other settings than the first, or begins before the one before it ends."""
    first, first_path = files[0]
    for (before, before_path), (scans, path) in pairwise(files):
        for name in ("start_s", "sample_interval_s"):
            if getattr(scans, name) != getattr(first, name):
                raise CaptureError(f"{path}: {name} differs from that of {first_path}")
        if scans.samples.shape[1] != first.samples.shape[1]:
            bins = f"{scans.samples.shape[1]} samples a scan, not {first.samples.shape[1]}"
            raise CaptureError(f"{path}: {bins} as {first_path}")
        if scans.clock_s <= before.clock_s + before.timestamp_s[-1]:
            raise CaptureError(f"{path}: recorded while {before_path} was; each stop has a time of its own")
