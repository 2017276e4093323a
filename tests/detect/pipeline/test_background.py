"""Stages that need a background: what they are shown, and what becomes of them where there is none."""

import dataclasses

import numpy as np
import pytest

from tests.detect.pipeline.conftest import assert_same, capture_of, detector
from uwbbench.api import CaptureError, ConfigError
from uwbbench.detect import opening

ABOVE = '''
import numpy as np
from uwbbench.api import Detections, Params, Stage, ports


class Louder(Stage[Params]):
    """Detections of taps that are louder than in every frame of the background; keeps what it was shown."""
    consumes = ports("profile")
    produces = ports("detections", "tap", "range_m")
    needs = ports("background")
    shown = []

    def show_background(self, blocks):
        blocks = list(blocks)
        Louder.shown.append(blocks)
        self.limit = max((block.profile[block.frames.valid].max() for block in blocks if len(block.frames)), default=0)

    def step(self, block):
        row, tap = np.nonzero(block.profile > self.limit)
        found = Detections(block.frames.index[row], tap=tap.astype(float), range_m=tap.astype(float))
        return block.replace(detections=found)


class Counted(Stage[Params]):
    """Amplitudes and the number of frames so far: state that a background must not leave behind."""
    produces = ports("profile")

    def open(self, radar):
        super().open(radar)
        self.frames = 0

    def step(self, block):
        count = self.frames + 1 + np.arange(len(block.frames))
        self.frames += len(block.frames)
        return block.replace(profile=block.frames.amplitude + count[:, None])


class LessBackground(Stage[Params]):
    """Profile less the mean of the background's."""
    consumes = ports("profile")
    produces = ports("profile")
    needs = ports("background")

    def show_background(self, blocks):
        self.mean = np.concatenate([block.profile for block in blocks]).mean(axis=0)

    def step(self, block):
        return block.replace(profile=block.profile - self.mean)


class Sighted(Stage[Params]):
    """A profile of the number of true objects."""
    needs = ports("truth")
    produces = ports("profile")

    def show_truth(self, truth, trajectory):
        self.count = len(truth.objects)

    def step(self, block):
        return block.replace(profile=np.full(block.frames.preamble.shape, float(self.count)))
'''
PLAYERS = {"louder": "Louder", "counted": "Counted", "less": "LessBackground", "sighted": "Sighted"}


@pytest.fixture
def shown(install_plugin):
    points = {f"t.{name}": f"abovestages:{target}" for name, target in PLAYERS.items()}
    install_plugin("abovestages", {"stages": points}, {"abovestages.py": ABOVE})
    from uwbbench.api.registry import load_plugin

    seen = load_plugin("stages", "t.louder").shown
    seen.clear()
    return seen


def with_background(frames=10, background_frames=7, **parts):
    capture = capture_of(frames)
    empty = dataclasses.replace(capture_of(background_frames, **parts), name="empty")
    return dataclasses.replace(capture, background=empty)


def test_a_stage_is_shown_the_background_behind_the_steps_before_it_opened_anew(shown):
    capture = with_background()
    stream = detector("counted", "louder").open(capture)
    (blocks,) = shown
    profile = np.concatenate([block.profile for block in blocks])
    expected = capture.background.frames().amplitude + (1 + np.arange(7))[:, None]
    np.testing.assert_array_equal(profile, expected)
    first = stream.step(capture.frames(0, 10))
    row, _ = np.nonzero(capture.frames().amplitude + (1 + np.arange(10))[:, None] > expected.max())
    assert first.frame.tolist() == row.tolist()  # counted from 1 again


def test_frames_of_the_background_come_in_bounded_blocks_with_invalid_ones_cleared(shown, monkeypatch):
    monkeypatch.setattr(opening, "BATCH_FRAMES", 3)
    detector("counted", "louder").open(with_background(invalid=[4]))
    (blocks,) = shown
    assert [len(block.frames) for block in blocks] == [3, 3, 1]
    assert np.concatenate([block.frames.valid for block in blocks]).tolist() == [True] * 4 + [False] + [True] * 2
    assert not np.any(blocks[1].frames.preamble[1])


def test_frames_that_a_step_holds_back_are_shown_too(shown):
    detector("every", "late", "counted", "louder").open(with_background())
    (blocks,) = shown
    assert sum(len(block.frames) for block in blocks) == 7


def test_of_two_stages_with_a_background_the_second_sees_what_the_first_makes_of_it(shown):
    detector("counted", "less", "louder").open(with_background())
    (blocks,) = shown
    assert np.abs(np.concatenate([block.profile for block in blocks]).mean(axis=0)).max() < 1e-12


def test_a_background_without_ground_truth_has_nothing_in_it(shown, approach):
    empty = dataclasses.replace(approach, truth=None)
    detector("sighted", "louder").open(dataclasses.replace(approach, background=empty))
    (blocks,) = shown
    assert not np.any(blocks[0].profile)


def test_a_stream_with_a_background_equals_the_batch(shown):
    pipeline, capture = detector("counted", "less", "louder"), with_background()
    stream = pipeline.open(capture)
    parts = [stream.step(capture.frames(row, row + 1)) for row in range(10)]
    assert_same(type(parts[0]).join([*parts, stream.flush()]), pipeline.run(capture))


def test_without_a_background_the_detector_is_refused(shown):
    message = r"'mine', step 'louder-1': capture 'run' has no background \(a recording of its radar with nothing"
    with pytest.raises(ConfigError, match=message):
        detector("counted", "louder").open(capture_of())
    with pytest.raises(ConfigError, match=message):
        detector("counted", "louder").open(with_background().header)


def test_without_a_background_an_optional_stage_is_left_out_with_a_note(shown):
    pipeline = detector("every", "counted", "less?")
    (note,) = pipeline.open(capture_of()).notes
    assert note.startswith("left out, as the capture has no background")
    assert note.endswith(": less-2")
    assert pipeline.open(with_background()).notes == ()


def test_a_background_that_is_damaged_is_named(shown):
    class Damaged:
        shape = (7, 4)
        file = None

        def __getitem__(self, key, /):
            raise OSError("inflate() failed")

    capture = with_background()
    broken = dataclasses.replace(capture.background, preamble=Damaged())
    with pytest.raises(CaptureError, match="capture 'empty': preamble: cannot be read, damaged file"):
        detector("counted", "louder").open(dataclasses.replace(capture, background=broken))
