"""A detector that is timed turn by turn: which frames, for how long, and what counts as its time."""

import contextlib
import itertools
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from uwbbench.api import Capture, CaptureError, Detections
from uwbbench.detect.pipeline import load_detector
from uwbbench.measure.latency import player
from uwbbench.measure.latency.player import Player, in_turns, turn_frames
from uwbbench.measure.latency.received import received


class Recording:
    """A detector that notes whose turn it is and on which frame, in a list that several share."""

    needs: frozenset[str] = frozenset()
    stages = ()

    def __init__(self, name: str, log: list[tuple[str, int]]) -> None:
        self.name, self.log = name, log

    def open(self, _: Capture) -> "Recording":
        return self

    def step(self, frames: object) -> Detections:
        self.log.append((self.name, frames.first))  # type: ignore[attr-defined]
        return Detections.empty()


def recorded(capture: Capture, frames: int, log: list[tuple[str, int]]) -> list[Player]:
    whole = received(capture, frames)
    return [Player(Recording(name, log), capture, whole) for name in "AB"]  # type: ignore[arg-type]


def test_both_go_through_the_same_frames_in_blocks_of_abba_and_baab(approach: Capture) -> None:
    log: list[tuple[str, int]] = []
    times_s = in_turns(recorded(approach, 8, log), size=1, blocks=4)
    assert "".join(name for name, _ in log) == "ABBA" + "BAAB" + "ABBA" + "BAAB"
    assert [frame for _, frame in log] == [frame for frame in range(4) for _ in "ABBA"]
    assert times_s.shape == (4, 2, 2)
    assert np.all(times_s > 0)


def test_both_turns_of_a_block_are_the_same_work_of_streams_of_their_own(approach: Capture) -> None:
    seen: list[list[int]] = []

    class Remembering(Recording):
        """A detector each of whose streams notes the frames that it has seen."""

        def open(self, _: Capture) -> "Recording":
            seen.append([])
            stream = Recording(self.name, [])
            mine, step = seen[-1], stream.step

            def noting(frames: object) -> Detections:
                mine.append(frames.first)  # type: ignore[attr-defined]
                return step(frames)

            stream.step = noting  # type: ignore[method-assign]
            return stream

    one = Player(Remembering("A", []), approach, received(approach, 6))  # type: ignore[arg-type]
    for _ in range(6):
        one.turn(2)
    assert seen == [[0, 1, 2, 3, 4, 5]] * 2


def test_a_capture_starts_again_where_a_turn_does_not_fit(approach: Capture) -> None:
    log: list[tuple[str, int]] = []
    in_turns(recorded(approach, 5, log), size=2, blocks=3)
    assert [frame for name, frame in log if name == "A"] == [0, 1, 0, 1, 2, 3, 2, 3, 0, 1, 0, 1]


def test_taking_turns_again_starts_from_the_first_frame(approach: Capture) -> None:
    log: list[tuple[str, int]] = []
    players = recorded(approach, 8, log)
    in_turns(players, size=1, blocks=1)
    log.clear()
    in_turns(players, size=1, blocks=1)
    assert log[0] == ("A", 0)
    assert all(len(one.waited_s) == 2 for one in players)


def test_a_capture_without_frames_cannot_be_timed(approach: Capture) -> None:
    with pytest.raises(CaptureError, match="nothing to time"):
        Player(load_detector("null"), approach, received(approach, 0))


def waiting(reading_ns: Callable[[], int]) -> Callable[[], contextlib.AbstractContextManager[Callable[[], int]]]:
    """Clock of the waits for the core, as the system would have it."""

    @contextlib.contextmanager
    def waits() -> Iterator[Callable[[], int]]:
        yield reading_ns

    return waits


def test_time_in_which_others_had_the_core_is_left_out(approach: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    waited_ns = 0

    class Interrupted(Recording):
        """Takes 20 ms of every call, of which the core is said to be lost for 15."""

        def step(self, frames: object) -> Detections:
            nonlocal waited_ns
            time.sleep(0.02)
            waited_ns += 15_000_000
            return super().step(frames)

    monkeypatch.setattr(player, "core_waits", waiting(lambda: waited_ns))
    one = Player(Interrupted("A", []), approach, received(approach, 8))  # type: ignore[arg-type]
    start = time.perf_counter()
    spent_s = one.turn(2)
    elapsed_s = time.perf_counter() - start
    assert 0.0099 <= spent_s <= elapsed_s - 0.03
    assert one.waited_s == [pytest.approx(0.03)]


def test_a_wait_longer_than_what_was_timed_is_none_of_it(approach: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = itertools.count()
    monkeypatch.setattr(player, "core_waits", waiting(lambda: next(seconds) * 10**9))
    one = Player(Recording("A", []), approach, received(approach, 8))  # type: ignore[arg-type]
    assert one.turn(1) > 0


@pytest.mark.parametrize(
    ("call_s", "frames", "size"),
    [
        ([1e-6, 1e-5], 15_000, 1500),  # 1.5 ms of the faster
        ([1e-4, 1e-4], 6400, 64),  # work that comes every fifty frames is part of every turn
        ([1e-6, 0.005], 1000, 6),  # thirty milliseconds of the slower at most
        ([1.0, 2.0], 1000, 1),
        ([1e-4, 1e-4], 100, 100),  # equal parts, of which no frame is left over
        ([1e-4, 1e-4], 130, 65),
        ([1e-4, 1e-4], 3, 3),
    ],
)
def test_a_turn_is_long_enough_for_the_faster_and_not_too_long_for_the_slower(
    call_s: list[float], frames: int, size: int
) -> None:
    assert turn_frames(call_s, frames) == size


def test_the_time_of_a_call_is_found_in_few_calls_of_a_slow_detector(approach: Capture) -> None:
    class Slow(Recording):
        def step(self, frames: object) -> Detections:
            time.sleep(0.02)
            return super().step(frames)

    log: list[tuple[str, int]] = []
    assert Player(Slow("A", log), approach, received(approach, 8)).call_s() >= 0.02  # type: ignore[arg-type]
    assert len(log) == 1
