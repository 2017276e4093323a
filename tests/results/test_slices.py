"""Cuts of the leaderboard by channel, material and range."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from uwbbench.api.metric import Outcome
from uwbbench.measure.accuracy.metrics.choice import MetricChoice
from uwbbench.measure.accuracy.metrics.detection import Recall
from uwbbench.measure.accuracy.stats import estimated
from uwbbench.results.results import Scored
from uwbbench.results.slices import MOST_BINS, cuts, range_edges_m, slices

SETTINGS: dict[str, Any] = {"confidence": 0.95, "seed": 0}


def scored(capture: str, channel: int, material: str, range_m: list[float], found: list[int]) -> Scored:
    """A detector that finds what it is told to, in frames whose obstacle is at the given ranges."""
    tp = np.array(found)
    outcome = Outcome(
        group=np.zeros(len(tp), np.int64),
        tp=tp,
        fp=np.zeros_like(tp),
        fn=1 - tp,
        error_frame=np.flatnonzero(tp),
        error_m=np.full(tp.sum(), 0.1),
        matched=np.ones(tp.sum(), bool),
        duration_s=len(tp) / 10,
    )
    names = {"detector": "d", "dataset": "s", "capture": capture, "scoring": "frame", "table": "filtering"}
    return Scored(
        **names,
        source="simulated",
        channel=channel,
        material=material,
        frames=len(tp),
        processed=len(tp),
        numbers={},
        outcome=outcome,
        range_m=np.array(range_m),
    )


ALL_OF_THEM = [
    scored("a", 5, "metal", [0.7, 1.4, 2.6, math.nan], [1, 1, 0, 0]),
    scored("b", 9, "metal", [0.8, 1.2, 2.2, 2.9], [0, 1, 1, 1]),
    scored("c", 9, "wood", [1.6, 1.7, 1.8, 1.9], [0, 0, 0, 1]),
]


def made(members: list[Scored]) -> dict[tuple[str, str, str], Any]:
    board = ("s", "simulated", "frame", "filtering")
    known = {(board, "d"): {"recall": estimated(Recall, [one.outcome for one in members])}}
    found = slices(
        members, MetricChoice({"rank": "recall", "table": ["recall"]}), range_edges_m(members), SETTINGS, known
    )
    return {(one.channel, one.material, one.span): one for one in found}


def test_each_cut_holds_its_captures_and_frames() -> None:
    found = made(ALL_OF_THEM)
    assert found["", "", ""].estimates["recall"].value == pytest.approx(6 / 12)
    assert found["9", "", ""].estimates["recall"].value == pytest.approx(4 / 8)
    assert found["", "metal", ""].captures == 2
    near = found["", "", "0.5 to 1 m"]
    assert (near.captures, near.frames) == (2, 2)
    assert near.estimates["recall"].value == 0.5
    assert found["9", "metal", "2 to 2.5 m"].estimates["recall"].value == 1.0


def test_frames_with_nothing_in_view_are_in_no_bin() -> None:
    found = made(ALL_OF_THEM)
    assert sum(one.frames for (channel, material, span), one in found.items() if span and not channel + material) == 11


def test_a_cut_that_holds_the_same_captures_as_a_wider_one_points_to_it() -> None:
    found = cuts(ALL_OF_THEM)
    assert found["5", ""][0] == ("5", "")
    assert found["5", "metal"][0] == ("5", "")
    assert found["9", "wood"][0] == ("", "wood")
    assert ("5", "wood") not in found


def test_bins_are_as_narrow_as_their_number_allows() -> None:
    edges_m = range_edges_m(ALL_OF_THEM)
    assert np.diff(edges_m) == pytest.approx(0.5)
    assert len(edges_m) - 1 <= MOST_BINS
    far = dataclasses.replace(ALL_OF_THEM[0], range_m=np.array([0.7, 30.0]))
    assert np.diff(range_edges_m([far])) == pytest.approx(5.0)


def test_a_run_without_visible_obstacles_has_no_bins() -> None:
    blind = dataclasses.replace(ALL_OF_THEM[0], range_m=np.full(4, math.nan))
    assert len(range_edges_m([blind])) == 0
    assert set(made([blind])) == {("", "", "")}
