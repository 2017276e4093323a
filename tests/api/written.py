"""A small capture with everything that a capture file can hold, and what it means to be the same."""

import dataclasses

import numpy as np

from uwbbench.api import Capture, Obstacle, Radar, Trajectory, Truth


def capture_of(frames=6, taps=5, samples="iq", sts=True, receiver="front", **parts) -> Capture:
    rng = np.random.default_rng(frames * 100 + taps)

    def response():
        return (rng.normal(size=(frames, taps)) + 1j * rng.normal(size=(frames, taps))).astype(np.complex64)

    radar = Radar(
        model="test",
        center_frequency_hz=7987.2e6,
        bandwidth_hz=499.2e6,
        sample_interval_s=1e-9,
        frame_rate_hz=50.0,
        taps=taps,
        samples=samples,
        channel=9,
        receiver=receiver,
        mount_position_m=(0.1, 0.2, 0.3),
        mount_yaw_rad=0.4,
        tx_position_m=(0.0, -0.25, 0.0),
        noise_taps=min(2, taps),
        array_spacing_m=0.0178,
        has_sts=sts,
        has_first_path=True,
    )
    truth = Truth(
        (
            Obstacle("box", "metal", np.array([[1.0, 0], [1, 1], [2, 1]])),
            Obstacle("wall", "brick", np.array([[5.0, -1, 0], [5, 1, 2]]), structure=True),
        ),
        exhaustive=False,
    )
    given = {
        "name": "run 1",
        "radar": radar,
        "trajectory": Trajectory(np.arange(frames) / 50.0, rng.normal(size=(frames, 3)), rng.normal(size=frames)),
        "truth": truth,
        "source": "simulated",
        "license": "CC0",
        "citation": "nobody",
        "description": "ünïcode",
        "preamble": response() if samples == "iq" else rng.normal(size=(frames, taps)).astype(np.float32),
        "sts1": response() if sts else None,
        "sts2": response() if sts else None,
        "first_path_index": rng.uniform(0, taps, frames),
        "first_path_index_sts1": rng.uniform(0, taps, frames),
        "first_path_index_sts2": rng.uniform(0, taps, frames),
        "odometry_position_m": rng.normal(size=(frames, 3)),
        "odometry_yaw_rad": rng.normal(size=frames),
        "receivers": (receiver,),
    }
    return Capture(**{**given, **parts})


def assert_same(found: Capture, expected: Capture):
    for field in dataclasses.fields(Capture):
        mine, theirs = getattr(found, field.name), getattr(expected, field.name)
        if field.name == "trajectory":
            for name in ("timestamp_s", "position_m", "yaw_rad"):
                np.testing.assert_array_equal(getattr(mine, name), getattr(theirs, name))
        elif field.name == "truth":
            assert (mine is None) == (theirs is None)
            if mine is not None:
                assert mine.exhaustive == theirs.exhaustive
                for a, b in zip(mine.objects, theirs.objects, strict=True):
                    assert (a.name, a.material, a.structure) == (b.name, b.material, b.structure)
                    np.testing.assert_array_equal(a.outline_m, b.outline_m)
        elif isinstance(theirs, np.ndarray):
            np.testing.assert_array_equal(np.asarray(mine), theirs)
        else:
            assert mine == theirs
