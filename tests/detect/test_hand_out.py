"""After which frame detections are handed out, found by driving a detector."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tests.detect.pipeline.conftest import STAGES
from uwbbench.api import Capture
from uwbbench.detect.hand_out import DIFFERENT
from uwbbench.detect.pipeline import Pipeline, detector_from_yaml, load_detector
from uwbbench.measure.latency.received import laps, received

MORE = '''


class Sudden(Late):
    """Holds frames back from the 150th on."""

    def step(self, block):
        before = min(max(150 - block.frames.first, 0), len(block.frames))
        if before == len(block.frames):
            return block
        late = super().step(self.cut(block, before, len(block.frames)))
        return Block.join([self.cut(block, 0, before), late]) if before else late


class AtEnd(Late):
    """Holds everything back."""

    def step(self, block):
        self.held = block if self.held is None else Block.join([self.held, block])
        return self.cut(block, 0, 0)


class Greedy(Stage[Params]):
    """Finds one tap of the first frame of each block, against the contract."""
    produces = ports("detections", "tap")

    def step(self, block):
        return block.replace(detections=Detections(block.frames.index[:1], tap=np.ones(len(block.frames.index[:1]))))
'''


@pytest.fixture(autouse=True)
def stages(install_plugin: Callable[..., Path]) -> None:
    named = {"every": "Every", "late": "Late", "sudden": "Sudden", "at_end": "AtEnd", "greedy": "Greedy"}
    points = {f"hand.{name}": f"handstages:{target}" for name, target in named.items()}
    install_plugin("handstages", {"stages": points}, {"handstages.py": STAGES + MORE})


def detector(*steps: str) -> Pipeline:
    """Detector of steps as YAML has them."""
    return detector_from_yaml("schema: 1\nname: n\npipeline:\n" + "".join(f"  - {step}\n" for step in steps))


EVERY = "{use: hand.every}"


def test_a_detector_that_answers_every_frame_hands_out_with_its_frame(approach: Capture) -> None:
    found = load_detector("paper-filtering").run(approach, handed_out=True)
    assert len(found) > 20
    assert_array_equal(found["handed_out"], found.frame)
    assert_array_equal(found.answered, found.processed)


@pytest.mark.parametrize("wait", [1, 3, 50])
def test_a_detector_that_waits_hands_out_so_many_frames_later_or_at_the_end(approach: Capture, wait: int) -> None:
    frames = len(approach)
    found = detector(EVERY, f"{{use: hand.late, params: {{frames: {wait}}}}}").run(approach, handed_out=True)
    assert len(found) == frames * approach.radar.taps
    assert_array_equal(found["handed_out"], np.minimum(found.frame + wait, frames))
    assert_array_equal(found.answered, np.minimum(found.processed + wait, frames))


def test_a_detector_that_answers_only_at_the_end_is_found_out(approach: Capture) -> None:
    found = detector(EVERY, "{use: hand.at_end}").run(approach, handed_out=True)
    assert len(found) == len(approach) * approach.radar.taps
    assert set(found["handed_out"]) == {len(approach)}


def test_a_wait_that_begins_in_the_middle_is_found_too(approach: Capture) -> None:
    capture = laps(received(approach), 300)[0]
    capture = dataclasses.replace(capture, preamble=np.concatenate([approach.preamble] * 9)[:300])
    found = detector(EVERY, "{use: hand.sudden}").run(capture, handed_out=True)
    waits = found["handed_out"] - found.frame
    assert waits[found.frame < 150].max() == 0
    assert set(waits[(found.frame >= 150) & (found.frame < 290)]) == {2}


def test_clustering_hands_detections_out_when_they_are_clustered(approach: Capture) -> None:
    found = load_detector("paper").run(approach, handed_out=True)
    assert found["handed_out"].max() == len(approach)  # of which the rest is clustered
    assert np.median(found["handed_out"] - found.frame) > 10
    assert_array_equal(found.answered, found.processed)


def test_the_detections_are_those_of_the_batch(approach: Capture) -> None:
    paper = load_detector("paper")
    batch, found = paper.run(approach), paper.run(approach, handed_out=True)
    assert set(found.columns) - set(batch.columns) == {"handed_out"}
    for name, values in batch.columns.items():
        assert_array_equal(found[name], values, err_msg=name)


def test_a_detector_that_finds_other_things_in_a_stream_has_no_hand_outs_but_a_note(approach: Capture) -> None:
    found = detector("{use: hand.greedy}").run(approach, handed_out=True)
    assert found.answered is None
    assert "handed_out" not in found
    assert DIFFERENT in found.notes


def test_frames_that_are_invalid_are_answered_by_nobody(approach: Capture) -> None:
    samples = np.array(approach.preamble)
    samples[7] = np.nan
    found = load_detector("paper-filtering").run(dataclasses.replace(approach, preamble=samples), handed_out=True)
    assert 7 not in found.processed
    assert_array_equal(found.answered, found.processed)
