"""Small stages, installed for every test of pipelines, detectors of them, and a capture for them."""

import numpy as np
import pytest

from uwbbench.api import Capture, Detections, Radar, Trajectory
from uwbbench.detect.pipeline import Pipeline, detector_from_yaml

STAGES = '''
import numpy as np
from pydantic import Field
from uwbbench.api import Block, Detections, Filter, Params, Stage, ports


class Every(Stage[Params]):
    """Every tap of every frame is a detection."""
    produces = ports("detections", "tap", "amplitude")

    def step(self, block):
        frames = block.frames
        tap = np.tile(np.arange(frames.taps, dtype=float), len(frames))
        return block.replace(detections=Detections(
            np.repeat(frames.index, frames.taps), tap=tap, amplitude=frames.amplitude.ravel()))


class AtLeastParams(Params):
    minimum: float = Field(0.0)


class AtLeast(Filter[AtLeastParams]):
    """Strong detections."""
    consumes = ports("detections", "amplitude")

    def keep(self, block):
        return block.detections["amplitude"] >= self.params.minimum


class Meters(Stage[Params]):
    """Range by tap and by where the robot stands."""
    consumes = ports("detections", "tap")
    produces = ports("range_m")
    rowwise = True

    def step(self, block):
        found = block.detections
        return block.with_columns(range_m=found["tap"] + block.frames.position_m[block.rows, 0])


class LateParams(Params):
    frames: int = 2


class Late(Stage[LateParams]):
    """Holds every frame back for a while."""
    consumes = ports("detections")

    def open(self, radar):
        super().open(radar)
        self.held = None

    def step(self, block):
        whole = block if self.held is None else Block.join([self.held, block])
        ready = max(0, len(whole.frames) - self.params.frames)
        self.held = self.cut(whole, ready, len(whole.frames))
        return self.cut(whole, 0, ready)

    def flush(self):
        held, self.held = self.held, None
        return held

    @staticmethod
    def cut(block, start, stop):
        rows = (block.rows >= start) & (block.rows < stop)
        return Block(block.frames.part(start, stop), detections=block.detections.take(rows))


class Phase(Stage[Params]):
    """Needs STS."""
    consumes = ports("detections")
    produces = ports("pdoa_rad")
    needs = ports("sts")

    def step(self, block):
        return block.with_columns(pdoa_rad=np.zeros(len(block.detections)))


class AfterPhase(Stage[Params]):
    """Consumes what Phase produces."""
    consumes = ports("pdoa_rad")

    def step(self, block):
        self.note("phase was used")
        return block


class Known(Stage[Params]):
    """Yields the true range."""
    needs = ports("truth")
    produces = ports("detections", "range_m")

    def show_truth(self, truth, trajectory):
        self.range_m = truth.seen_from(self.radar, trajectory).range_m[:, 0]

    def step(self, block):
        index = block.frames.index
        return block.replace(detections=Detections(index, range_m=self.range_m[index]))


class Mute(Stage[Params]):
    """Frames are gone behind it."""
    removes = ports("frames")

    def step(self, block):
        return block


class NeedsFrames(Stage[Params]):
    """Wants frames."""
    consumes = ports("frames")

    def step(self, block):
        return block
'''
NAMES = {
    "every": "Every",
    "at_least": "AtLeast",
    "meters": "Meters",
    "late": "Late",
    "phase": "Phase",
    "after_phase": "AfterPhase",
    "known": "Known",
    "mute": "Mute",
    "needs_frames": "NeedsFrames",
}


@pytest.fixture(autouse=True)
def stages(install_plugin):
    points = {f"t.{name}": f"teststages:{target}" for name, target in NAMES.items()}
    install_plugin("teststages", {"stages": points}, {"teststages.py": STAGES})


def detector(*steps) -> Pipeline:
    """Detector of steps such as ``late``, or ``(name, params)``."""
    lines = ["schema: 1", "name: mine", "pipeline:"]
    for number, step in enumerate(steps):
        name, params = (step, "{}") if isinstance(step, str) else step
        optional = name.endswith("?")
        name = name.rstrip("?")
        lines.append(f"  - {{use: t.{name}, as: {name}-{number}, params: {params}, optional: {str(optional).lower()}}}")
    return detector_from_yaml("\n".join(lines))


def capture_of(frames=10, taps=4, invalid=()) -> Capture:
    rng = np.random.default_rng(3)
    preamble = (rng.normal(size=(frames, taps)) + 1j * rng.normal(size=(frames, taps))).astype(np.complex64)
    preamble[list(invalid), 1] = np.nan
    position_m = np.stack([np.arange(frames) * 100.0, np.zeros(frames), np.zeros(frames)], axis=1)
    return Capture(
        name="run",
        radar=Radar("test", 8e9, 5e8, 1e-9, 50.0, taps=taps),
        trajectory=Trajectory(np.arange(frames) / 50.0, position_m, np.zeros(frames)),
        preamble=preamble,
    )


def rows_of(found: Detections):
    columns = sorted(found.columns)
    rows = np.stack([found[name].astype(float) for name in columns], axis=1)
    return columns, rows[np.lexsort(rows.T[::-1])]


def assert_same(left: Detections, right: Detections):
    (names, rows), (other_names, other_rows) = rows_of(left), rows_of(right)
    assert names == other_names
    np.testing.assert_array_equal(rows, other_rows)
    np.testing.assert_array_equal(left.processed, right.processed)
    assert left.notes == right.notes


CHAIN = ("every", ("at_least", "{minimum: 0.5}"), "meters", ("at_least", "{minimum: 1.0}"))
