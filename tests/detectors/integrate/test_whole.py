"""The whole chain in one pass, against its stages."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest

from uwbbench import load_detector
from uwbbench.api import Detections, Kernel


@pytest.fixture(scope="module")
def drive(make_drive):
    """A drive past two points, with a direct path, ringing, a stop, an invalid frame, an empty one and a loud one."""
    frame = np.arange(180)
    block = make_drive([(3.0, 0.5), (2.0, -0.7)], 0.006 * (np.minimum(frame, 90) + np.maximum(frame - 130, 0)))
    tap = np.arange(50)
    fixed = np.exp(-((tap - 7) ** 2) / 2.5) + 0.3j * np.exp(-((tap - 9.0) ** 2) / 2)
    gain = np.exp(1j * np.arange(180))[:, None]
    parts = {name: gain * (getattr(block.frames, name) + fixed) for name in ("preamble", "sts1", "sts2")}
    parts["preamble"][11] = 0
    parts["preamble"][17] *= 1e6
    valid = np.ones(180, bool)
    valid[5] = False
    for samples in parts.values():
        samples[5] = np.nan
    return dataclasses.replace(block.frames, valid=valid, **parts)


def _whole(pipeline, radar, frames, cuts, *, fused):
    """Detections of a detector on frames handed over in pieces."""

    class Header:
        def __init__(self):
            self.radar, self.truth, self.name, self.background = radar, None, "drive", None

    stream = pipeline.open(Header(), fused=fused)
    assert any(isinstance(step.stage, Kernel) for step in stream._steps) == fused
    edges = [0, *cuts, len(frames)]
    parts = [stream.step(frames.part(start, stop)) for start, stop in pairwise(edges)]
    return Detections.join([*parts, stream.flush()])


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"pipeline.track.fixed": None},
        {"pipeline.clutter.robot_template": None, "pipeline.smooth.matched": None, "pipeline.filter.sidelobe": None},
    ],
)
@pytest.mark.parametrize("has_sts", [True, False])
def test_one_pass_finds_what_the_stages_find(changes, has_sts, drive, array_radar):
    config = load_detector("champion").config
    left_out = {name.removeprefix("pipeline.") for name in changes}
    steps = tuple(step for step in config.steps if step.label not in left_out)
    pipeline = type(load_detector("champion"))(dataclasses.replace(config, steps=steps))
    radar, frames = dataclasses.replace(array_radar, tx_position_m=(0.0, -0.1, 0.0)), drive
    if not has_sts:
        radar = dataclasses.replace(radar, has_sts=False, array_spacing_m=None)
        frames = dataclasses.replace(drive, sts1=None, sts2=None)
    plain = _whole(pipeline, radar, frames, [], fused=False)
    for cuts in ([], [1, 2, 60, 100, 101]):
        whole = _whole(pipeline, radar, frames, cuts, fused=True)
        assert whole.names == plain.names
        for name in plain.names:
            np.testing.assert_array_equal(whole[name], plain[name], err_msg=name)
        np.testing.assert_array_equal(whole.processed, plain.processed)
    assert len(plain) > 20
